"""Measurement operators in the form of other libraries, one module each.

A module imports its library, so none is imported here.
"""

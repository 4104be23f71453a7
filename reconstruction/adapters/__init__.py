"""Measurement operators as other libraries have theirs, so that their methods run on any capture.

One module for each library; none is imported unless its library is there.
"""

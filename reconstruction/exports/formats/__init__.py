"""Formats of other programs: one module each, with its `Export`."""

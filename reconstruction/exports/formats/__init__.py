"""Export formats, one module each, with its `Export`."""

"""Common foundation: arrays, errors, files and folders, registries, text."""

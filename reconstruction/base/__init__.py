"""What everything else stands on: arrays, errors, files and folders, registries, text."""

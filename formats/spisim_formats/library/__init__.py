"""Shared by formats: files and folders, parts, materials, textures, units, and scene files."""

"""What formats share: files and folders, parts, materials, textures, units, the way to a scene."""

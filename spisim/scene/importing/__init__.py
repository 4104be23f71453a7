"""Scenes of other programs to scenes of spisim: meshes, glTF, COLLADA, USD, URDF, SDFormat."""

from spisim.scene.importing.convert import FORMATS, Import, Options, import_scene

__all__ = ["FORMATS", "Import", "Options", "import_scene"]

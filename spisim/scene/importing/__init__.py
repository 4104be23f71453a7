"""Scenes of other programs to scenes of spisim: glTF, OBJ, STL, PLY, COLLADA, Mitsuba, Gazebo."""

from spisim.scene.importing.convert import FORMATS, Import, Options, import_scene

__all__ = ["FORMATS", "Import", "Options", "import_scene"]

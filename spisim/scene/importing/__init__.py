"""Scenes of other programs to scenes of spisim: glTF, OBJ, STL, PLY, COLLADA, Mitsuba, Gazebo."""

from spisim.scene.importing.convert import FORMATS, Import, Options, import_scene
from spisim.scene.importing.units import TO_Z_UP, UNITS

__all__ = ["FORMATS", "TO_Z_UP", "UNITS", "Import", "Options", "import_scene"]

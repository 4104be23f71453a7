"""Scenes to files of other programs: GLB for Blender, SDFormat for Gazebo."""

from spisim.scene.exporting.export import FORMATS, export_scene

__all__ = ["FORMATS", "export_scene"]

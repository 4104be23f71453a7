"""URDF: robots of ROS."""

from spisim_formats.format import SceneFormat, lazily

FORMAT = SceneFormat("URDF", {".urdf": lazily("spisim_formats.urdf.reading:read_urdf")})

"""Results for programs that know nothing of this one: depth images, clouds, poses, ROS 2."""

from .export import EXPORTS, USUAL, Export, check_export, export_format, write_export
from .poses import Placed, read_poses
from .shot import Shot
from .shots import Place, frames_in, shots_of

__all__ = [
    "EXPORTS",
    "USUAL",
    "Export",
    "Place",
    "Placed",
    "Shot",
    "check_export",
    "export_format",
    "frames_in",
    "read_poses",
    "shots_of",
    "write_export",
]

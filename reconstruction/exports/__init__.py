"""Exports for other programs: depth images, point clouds, poses."""

from .export import DEFAULT_EXPORT, EXPORTS, Export, check_export, export_format, write_export
from .poses import TimestampedPose, read_poses
from .shot import Shot
from .shots import PoseSource, frames_in, shots_of

__all__ = [
    "DEFAULT_EXPORT",
    "EXPORTS",
    "Export",
    "PoseSource",
    "Shot",
    "TimestampedPose",
    "check_export",
    "export_format",
    "frames_in",
    "read_poses",
    "shots_of",
    "write_export",
]

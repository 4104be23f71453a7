"""MCAP recording of ROS 2 messages: clouds, images, ranges, frames of reference and diagnostics.

For `ros2 bag play`, Foxglove and other readers of MCAP.
"""

from collections.abc import Iterable
from pathlib import Path

from reconstruction.base.errors import InputError
from reconstruction.exports import Export, Shot

from .mcap_file import McapFile, libraries


def write_mcap(shots: Iterable[Shot], path: Path) -> None:
    """Write a file; raises InputError if there is no shot or a library is missing."""
    file = McapFile(path)
    try:
        rig, begun = None, False
        for shot in shots:
            given = None if shot.spots is None else shot.spots.detector_positions_m
            file.write_frame(shot, shot.stamp_ns, begins=not begun or given is not rig)
            rig, begun = given, True
        if not begun:
            raise InputError("there is nothing to export")
    finally:
        file.close()


EXPORT = Export("MCAP of ROS 2 messages", write_mcap, ".mcap", libraries)

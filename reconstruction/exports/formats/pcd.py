"""Point clouds of the Point Cloud Library, binary PCD 0.7, one file per frame.

Clouds are organised, (H, W) points in the optical frame, nan without depth, with the image as
intensity. VIEWPOINT is the pose, if known.
"""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ...base.files import mark
from ..export import KIND, Export
from ..pictures import POINT, organised, require_depths
from ..poses import quaternion_of
from ..shot import Shot


def write_pcd(shots: Iterable[Shot], folder: Path) -> None:
    """Write ``000000.pcd`` and so on into a folder; raises InputError without any depth map."""
    number, depth_maps = 0, 0
    for number, shot in enumerate(shots, 1):
        (folder / f"{number - 1:06d}.pcd").write_bytes(pcd(shot))
        depth_maps += shot.depth_m is not None
    require_depths(depth_maps, number)


def pcd(shot: Shot) -> bytes:
    """Bytes of a file."""
    height, width = shot.shape
    pose = np.eye(4) if shot.pose is None else shot.pose
    x, y, z, w = quaternion_of(pose[:3, :3])
    viewpoint = " ".join(f"{number:.9g}" for number in (*pose[:3, 3], w, x, y, z))
    header = (
        f"# .PCD v0.7 - Point Cloud Data file format; {mark(KIND)}\n"
        f"VERSION 0.7\nFIELDS {' '.join(POINT.names or ())}\nSIZE 4 4 4 4\nTYPE F F F F\n"
        f"COUNT 1 1 1 1\nWIDTH {width}\nHEIGHT {height}\nVIEWPOINT {viewpoint}\n"
        f"POINTS {height * width}\nDATA binary\n"
    )
    return header.encode() + organised(shot).tobytes()


EXPORT = Export("point clouds of PCL, one PCD file for each frame", write_pcd)

"""Images with poses for NeRF and its successors: ``transforms.json``.

Cameras have x right, y up, z backwards (OpenGL); pixels count from the image's corner, so that the
centre of the first is (0.5, 0.5). Depth images are as in `rgbd`, and fields have the names of both
nerfstudio and instant-ngp. Cf. B. Mildenhall et al., "NeRF", ECCV 2020.
"""

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from reconstruction.base.errors import InputError
from reconstruction.base.files import mark
from reconstruction.base.text import json_line
from reconstruction.exports.export import KIND, Export
from reconstruction.exports.pictures import colour_png, depth_png
from reconstruction.exports.shot import Shot

OPTICAL_FROM_CAMERA = np.diag([1.0, -1, -1, 1])
"""From x right, y up, z backwards to x right, y down, z forward."""


def write_nerf(shots: Iterable[Shot], folder: Path) -> None:
    """Write images, available depth images, and ``transforms.json`` into a folder.

    Raises InputError for a shot without a pose.
    """
    for name in ("images", "depth"):
        (folder / name).mkdir(parents=True)
    intrinsics: dict[str, Any] = {}
    frames: list[dict[str, Any]] = []
    for number, shot in enumerate(shots):
        if shot.pose is None:
            raise InputError(
                f"frame {number} has no pose, which transforms.json needs: add --poses FILE, or "
                "export a simulated capture with spisim export"
            )
        if not intrinsics:
            intrinsics = camera(shot)
        elif intrinsics != camera(shot):
            raise InputError(f"frame {number} has another camera than the first")
        name = f"{number:06d}.png"
        frame: dict[str, Any] = {"file_path": f"images/{name}"}
        (folder / "images" / name).write_bytes(colour_png(shot.image))
        if shot.depth_m is not None:
            (folder / "depth" / name).write_bytes(depth_png(shot.depth_m, shot.shape))
            frame |= {"depth_file_path": f"depth/{name}", "depth_path": f"depth/{name}"}
        frame["transform_matrix"] = (shot.pose @ OPTICAL_FROM_CAMERA).tolist()
        frames.append(frame)
    if not frames:
        raise InputError("there is nothing to export")
    report = {**intrinsics, "frames": frames, "made": mark(KIND)}
    (folder / "transforms.json").write_text(json_line(report) + "\n", encoding="ascii")


def camera(shot: Shot) -> dict[str, Any]:
    """Camera model that all frames share."""
    (height, width), pinhole = shot.shape, shot.intrinsics
    return {
        "camera_model": "OPENCV",
        "w": width,
        "h": height,
        "fl_x": pinhole.fx,
        "fl_y": pinhole.fy,
        "cx": pinhole.cx + 0.5,
        "cy": pinhole.cy + 0.5,
        "camera_angle_x": 2 * math.atan(shot.complete_optics.tan_half_width),
        "camera_angle_y": 2 * math.atan(shot.complete_optics.tan_half_height),
        "k1": 0.0,
        "k2": 0.0,
        "p1": 0.0,
        "p2": 0.0,
        "integer_depth_scale": 0.001,
    }


EXPORT = Export("images with poses and transforms.json, for NeRF and splats", write_nerf)

"""Poses and views of a flight, shared by the tests of its memory."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from reconstruction.capture import Optics, Poses
from reconstruction.capture.motion import PoseAt
from reconstruction.depth import pixel_rays
from streams import film

SHAPE = (64, 64)
OPTICS = Optics(tan_half_width=0.3, tan_half_height=0.3)
FRAME_S = 1 / 117


def pose(number=0, position_m=(0, 0, 0), turn_rad=(0, 0, 0), variance_m2=0.0, variance_rad2=0.0):
    """Pose of a numbered frame; without errors unless they are given."""
    axes = Rotation.from_rotvec(turn_rad).as_matrix()
    return PoseAt(number * FRAME_S, np.array(position_m, float), axes, variance_m2, variance_rad2)


def towards(*pixels):
    """Unit vectors (N, 3) of rows and columns."""
    rays = np.array([pixel_rays(OPTICS, SHAPE)[row, column] for row, column in pixels])
    return rays / np.linalg.norm(rays, axis=1, keepdims=True)


def ranges(directions, depth_m):
    """Ranges of surfaces at some depths along unit vectors."""
    return np.asarray(depth_m) / directions[:, 2]


def flight(capture, frames, position_m=None, time_s=None, missing=()):
    """A recording of so many frames with poses, some of which may be missing."""
    recorded = film(capture, frames)
    poses = Poses(
        FRAME_S * (1 + np.arange(frames)) if time_s is None else np.asarray(time_s, float),
        np.zeros((frames, 3)) if position_m is None else np.array(position_m, float),
        np.tile([0.0, 0, 0, 1], (frames, 1)),
        np.full((frames, 6, 6), np.nan),
    )
    for name in ("position_m", "orientation"):
        getattr(poses, name)[list(missing)] = np.nan
    return replace(recorded, poses=poses)

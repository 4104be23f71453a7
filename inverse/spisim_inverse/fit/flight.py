"""Frames of a flight as recordings of a drone at rest, each in the pose that it states."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from reconstruction import Capture
from reconstruction.base.errors import InputError
from reconstruction.capture.motion import PoseAt, pose_at
from spisim.scene import Scene
from spisim.simulation.flight.motion import scene_at, things_move

FRAMES = 6
"""Frames of a flight that are fitted."""


class Frame(NamedTuple):
    """A frame by itself: its recording, its scene, and the error of its pose along each axis."""

    number: int
    capture: Capture
    scene: Scene
    pose_sigma: tuple[float, float]


def frames_of(capture: Capture, scene: Scene, count: int = FRAMES) -> list[Frame]:
    """Views of a recording: all frames of a drone at rest as one, some of those of a flight.

    The drone moves little during a frame: it is taken to be at rest in the pose of its middle.

    Parameters
    ----------
    capture
        A recording, with poses if it is a flight.
    scene
        Where it was made; poses are in its coordinates.
    count
        Maximum number of frames of a flight, evenly spread over those with a pose.

    Raises
    ------
    InputError
        If no frame of a flight has a pose, or if anything but the drone moves.
    """
    if capture.poses is None:
        return [Frame(0, capture, scene, (0.0, 0.0))]
    if things_move(scene) or scene.precipitation:
        raise InputError(f"scene {scene.name} moves: a fit needs one in which the drone alone does")
    plans = len(capture.setup.plans)
    posed = np.flatnonzero(capture.poses.known[::plans]) * plans
    if not posed.size:
        raise InputError(
            "poses: no frame has one; a flight is fitted by frames whose pose is known"
        )
    chosen = posed[np.unique(np.linspace(0, posed.size - 1, min(count, posed.size)).astype(int))]
    return [_frame(capture, scene, number) for number in chosen.tolist()]


def _frame(capture: Capture, scene: Scene, number: int) -> Frame:
    one = capture.frame(number)
    pose = pose_at(one.poses)
    assert pose is not None
    alone = replace(
        capture, buckets=one.buckets, spots=one.spots, pattern_taps=one.pattern_taps, poses=None,
        following_plans=(), truth=None,
    )  # fmt: skip
    return Frame(number, alone, _seen_from(scene, pose), _sigma(pose))


def _seen_from(scene: Scene, pose: PoseAt) -> Scene:
    own = np.eye(4)
    own[:3, :3], own[:3, 3] = pose.axes, pose.position_m
    return scene_at(scene, 0.0, own)


def _sigma(pose: PoseAt) -> tuple[float, float]:
    return float(np.sqrt(pose.variance_m2)), float(np.sqrt(pose.variance_rad2))

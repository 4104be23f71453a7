"""Captures, frame by frame, as shots."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import InputError, naming
from ..capture import CaptureFile, open_capture
from ..chosen_methods import Methods
from ..reconstructor import Reconstructor
from .poses import TimestampedPose
from .results import is_result, shot_of_result
from .shot import Shot

PoseSource = Callable[[CaptureFile | None, int], TimestampedPose | None]
"""Time and pose of a frame of a capture, or of a result; None if unknown."""

UNKNOWN_PERIOD_S = 1.0
"""Period of frames without known times."""


def frames_in(captures: Sequence[Path]) -> int:
    """Number of frames in captures and results; raises InputError for other files."""
    frames = 0
    for path in captures:
        if is_result(path):
            frames += 1
            continue
        with open_capture(path) as capture:
            frames += capture.frames
    return frames


def shots_of(
    captures: Sequence[Path],
    pose_source: PoseSource = lambda capture, frame: None,
    methods: Mapping[str, Methods] | None = None,
    weather: str | float | None = None,
) -> Iterator[Shot]:
    """Reconstruct all frames of captures.

    Raises InputError, which names the capture that cannot be reconstructed.

    Parameters
    ----------
    captures : sequence of Path
        Captures, or results, which are taken as they are, a second apart.
    pose_source : callable
        Time and pose by capture, None for a result, and frame number. Without a time, a frame has
        that of its middle, counted from the creation of its capture (or from 1970); captures do not
        overlap.
    methods : mapping, optional
        Methods of each station, as for a `Reconstructor`.
    weather : str or float, optional
        Stated weather, as for a `Reconstructor`.
    """
    next_ns = 0
    for path in captures:
        if is_result(path):
            if weather is not None:
                raise InputError(f"{path} is a result; a stated weather needs captures")
            source_pose = pose_source(None, 0)
            stamp_ns = next_ns + round(1e9 * UNKNOWN_PERIOD_S) // 2
            if source_pose is not None and source_pose.time_s is not None:
                stamp_ns = round(1e9 * source_pose.time_s)
            shot = shot_of_result(path, stamp_ns, methods or {})
            yield replace(shot, pose=None if source_pose is None else source_pose.pose)
            next_ns = stamp_ns + round(1e9 * UNKNOWN_PERIOD_S) // 2
            continue
        with open_capture(path) as capture, naming(path):
            reconstruct = Reconstructor(
                capture.setup, **dict[str, Any](methods or {}), weather=weather
            )
            begun_ns = max(_created_ns(capture), next_ns)
            period_ns = round(1e9 * _period_s(capture))
            for number in range(capture.frames):
                source_pose = pose_source(capture, number)
                stamp_ns = begun_ns + number * period_ns + period_ns // 2
                if source_pose is not None and source_pose.time_s is not None:
                    stamp_ns = round(1e9 * source_pose.time_s)
                result = reconstruct(capture.frame(number))
                pose = None if source_pose is None else source_pose.pose
                yield Shot.of(result, capture.setup, stamp_ns, pose)
                next_ns = stamp_ns + period_ns // 2


def _period_s(capture: CaptureFile) -> float:
    setup = capture.setup
    period_s = setup.buckets.pattern_period_s * setup.plan.exposures
    return period_s if np.isfinite(period_s) and period_s > 0 else UNKNOWN_PERIOD_S


def _created_ns(capture: CaptureFile) -> int:
    with suppress(ValueError, OverflowError):
        created = datetime.fromisoformat(capture.provenance.created)
        if created.tzinfo is None:
            created = created.replace(tzinfo=UTC)
        return max(0, round(1e9 * created.timestamp()))
    return 0

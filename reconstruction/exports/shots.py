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
from .poses import Placed
from .results import is_result, shot_of_result
from .shot import Shot

Place = Callable[[CaptureFile | None, int], Placed | None]
"""When and where a frame of a capture, or a result, was taken; None: not known."""

UNKNOWN_PERIOD_S = 1.0
"""Between frames of which nobody knows when they were recorded."""


def frames_in(captures: Sequence[Path]) -> int:
    """How many frames captures and results have altogether; InputError for what is neither."""
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
    position: Place = lambda capture, frame: None,
    methods: Mapping[str, Methods] | None = None,
    weather: str | float | None = None,
) -> Iterator[Shot]:
    """Reconstruct all frames of captures, by methods and with the weather of a `Reconstructor`.

    Results are taken as they are, a second apart.

    Times are those of ``position``, or else of the middle of each frame, counted from when its
    capture was made (from 1970 where it does not tell); no capture begins before the last one ends.
    Raises InputError, naming the capture, for what cannot be reconstructed.
    """
    next_ns = 0
    for path in captures:
        if is_result(path):
            if weather is not None:
                raise InputError(f"{path} holds a result; a stated weather goes with captures")
            placed = position(None, 0)
            stamp_ns = next_ns + round(1e9 * UNKNOWN_PERIOD_S) // 2
            if placed is not None and placed.time_s is not None:
                stamp_ns = round(1e9 * placed.time_s)
            shot = shot_of_result(path, stamp_ns, methods or {})
            yield replace(shot, pose=None if placed is None else placed.pose)
            next_ns = stamp_ns + round(1e9 * UNKNOWN_PERIOD_S) // 2
            continue
        with open_capture(path) as capture, naming(path):
            chosen = dict[str, Any](methods or {}, weather=weather)
            reconstruct = Reconstructor(capture.setup, **chosen)
            begun_ns = max(_created_ns(capture), next_ns)
            period_ns = round(1e9 * _period_s(capture))
            for number in range(capture.frames):
                placed = position(capture, number)
                stamp_ns = begun_ns + number * period_ns + period_ns // 2
                if placed is not None and placed.time_s is not None:
                    stamp_ns = round(1e9 * placed.time_s)
                result = reconstruct(capture.frame(number))
                pose = None if placed is None else placed.pose
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

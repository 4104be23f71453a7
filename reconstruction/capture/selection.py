"""Reduce a capture to fewer patterns."""

from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ..base.errors import InputError
from ..operators import ordered_rows
from .buckets import Buckets
from .charge import PatternTaps
from .model import Capture

Part = TypeVar("Part", Buckets, PatternTaps)


def first_patterns(capture: Capture, patterns: int, order: str | None = None) -> Capture:
    """Keep the exposures of the first patterns of each frame, in a named order.

    Raises InputError if the capture has fewer patterns, or the order is unknown.

    Parameters
    ----------
    capture : Capture
        The whole recording.
    patterns : int
        Number of pattern indices to keep per frame.
    order : str, optional
        Order of the patterns; the default is that of their basis.
    """
    plans = capture.setup.plans
    max_patterns = min(plan.sampled for plan in plans)
    if not 1 <= patterns <= max_patterns:
        raise InputError(f"patterns = {patterns}; allowed in this capture: 1..{max_patterns}")
    ordered = ordered_rows(capture.plan.patterns, order)
    selected = [
        np.isin(plan.index, ordered[np.isin(ordered, plan.index)][:patterns]) for plan in plans
    ]
    if len({exposures.sum() for exposures in selected}) > 1:
        raise InputError(
            f"patterns = {patterns}: frames expose these patterns different numbers of times"
        )
    indices = [np.flatnonzero(exposures) for exposures in selected]
    kept = np.array([indices[frame % len(plans)] for frame in range(capture.frames)])
    taps = capture.pattern_taps
    plan, *following_plans = (each.only(some) for each, some in zip(plans, selected, strict=True))
    return replace(
        capture,
        pattern_taps=None if taps is None else _some(taps, kept, "taps"),
        plan=plan,
        following_plans=tuple(following_plans),
        buckets=_some(capture.buckets, kept, "counts"),
    )


def _some(part: Part, kept: NDArray[np.intp], readings: str) -> Part:
    """A part with the readings (F, K) of each frame."""
    frames = np.arange(len(kept))[:, None]
    names = (readings, "saturated")
    return replace(part, **{name: getattr(part, name)[frames, kept] for name in names})

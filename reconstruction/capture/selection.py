"""Fewer patterns of a capture, as if only they had been shown."""

from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Mask
from ..base.errors import InputError
from ..operators import PatternPlan, ordered_rows
from .buckets import Buckets
from .model import Capture
from .pattern_taps import PatternTaps

Part = TypeVar("Part", Buckets, PatternTaps)


def first_patterns(capture: Capture, patterns: int, order: str | None = None) -> Capture:
    """Keep the exposures of the first ``patterns`` indices of each frame in a named order.

    Without a name, in the usual order of the patterns' basis.

    Raises InputError if the capture has fewer indices or the order is unknown.
    """
    plans = capture.setup.plans
    fewest = min(plan.sampled for plan in plans)
    if not 1 <= patterns <= fewest:
        raise InputError(f"patterns = {patterns}: this capture has 1..{fewest} to choose from")
    ordered = ordered_rows(capture.plan.patterns, order)
    displayed = [_first(plan, ordered, patterns) for plan in plans]
    if len({exposures.sum() for exposures in displayed}) > 1:
        raise InputError(
            f"patterns = {patterns}: frames show these with different numbers of exposures"
        )
    indices = [np.flatnonzero(exposures) for exposures in displayed]
    retained = np.array([indices[frame % len(plans)] for frame in range(capture.frames)])
    taps = capture.pattern_taps
    plan, *following_plans = (each.only(some) for each, some in zip(plans, displayed, strict=True))
    return replace(
        capture,
        pattern_taps=None if taps is None else _some(taps, retained, "taps"),
        plan=plan,
        following_plans=tuple(following_plans),
        buckets=_some(capture.buckets, retained, "counts"),
    )


def _first(plan: PatternPlan, ordered: NDArray[np.int64], patterns: int) -> Mask:
    """Exposures (M,) of the first patterns of a plan."""
    return np.isin(plan.index, ordered[np.isin(ordered, plan.index)][:patterns])


def _some(part: Part, retained: NDArray[np.intp], readings: str) -> Part:
    """A part with some readings (F, K) of each frame."""
    frames = np.arange(len(retained))[:, None]
    names = (readings, "saturated")
    return replace(part, **{name: getattr(part, name)[frames, retained] for name in names})

"""Fewer patterns of a capture, as if only they had been shown."""

from dataclasses import replace
from typing import TypeVar

import numpy as np

from ..arrays import Mask
from ..errors import InputError
from ..operators import ordered_rows
from .buckets import Buckets
from .model import Capture
from .pattern_taps import PatternTaps

Part = TypeVar("Part", Buckets, PatternTaps)


def first_patterns(capture: Capture, patterns: int, order: str | None = None) -> Capture:
    """Keep the exposures of the first ``patterns`` of the plan's indices in a named order.

    Without a name, in the usual order of the patterns' basis.

    Raises InputError if the capture has fewer indices or the order is unknown.
    """
    plan = capture.plan
    if not 1 <= patterns <= plan.sampled:
        raise InputError(
            f"patterns = {patterns}: this capture has 1..{plan.sampled} to choose from"
        )
    ordered = ordered_rows(plan.patterns, order)
    kept = ordered[np.isin(ordered, plan.index)][:patterns]
    exposures = np.isin(plan.index, kept)
    taps = capture.pattern_taps
    return replace(
        capture,
        pattern_taps=None if taps is None else _some(taps, exposures, "taps"),
        plan=plan.only(exposures),
        buckets=_some(capture.buckets, exposures, "counts"),
    )


def _some(part: Part, exposures: Mask, readings: str) -> Part:
    names = (readings, "saturated")
    return replace(part, **{name: getattr(part, name)[:, exposures] for name in names})

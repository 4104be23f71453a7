"""Fewer patterns of a capture, as if only they had been shown."""

from dataclasses import replace

import numpy as np

from ..errors import InputError
from ..operators import ORDERS
from .model import Capture


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
    ordered = ORDERS[order or plan.patterns.usual_order](plan.patterns)
    kept = ordered[np.isin(ordered, plan.index)][:patterns]
    exposures = np.isin(plan.index, kept)
    pattern_taps = capture.pattern_taps
    if pattern_taps is not None:
        pattern_taps = replace(
            pattern_taps,
            taps=pattern_taps.taps[:, exposures],
            saturated=pattern_taps.saturated[:, exposures],
        )
    return replace(
        capture,
        pattern_taps=pattern_taps,
        plan=plan.only(exposures),
        buckets=replace(
            capture.buckets,
            counts=capture.buckets.counts[:, exposures],
            saturated=capture.buckets.saturated[:, exposures],
        ),
    )

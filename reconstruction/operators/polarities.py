"""Polarities and sequence in which the rows of a plan are displayed."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Exposures = tuple[NDArray[np.int32], NDArray[np.int8]]
"""Row index and polarity (M,) of every exposure, as in `PatternPlan`."""


def _single_ended(rows: NDArray[np.int64], dc_row: int | None) -> Exposures:
    dark = [] if dc_row is None else [dc_row]
    return _exposures(np.append(rows, dark), np.append(np.ones(len(rows)), -np.ones(len(dark))))


def _exposures(index: NDArray[np.int64], sign: NDArray[Any]) -> Exposures:
    return index.astype(np.int32), sign.astype(np.int8)


POLARITIES: dict[str, Callable[[NDArray[np.int64], int | None], Exposures]] = {
    "differential": lambda rows, _: _exposures(np.repeat(rows, 2), np.tile([1, -1], len(rows))),
    "single-ended": _single_ended,
    "signed": lambda rows, _: _exposures(rows, np.zeros(len(rows))),
    "negative-first": lambda rows, _: _exposures(np.repeat(rows, 2), np.tile([-1, 1], len(rows))),
    "halves": lambda rows, _: _exposures(np.tile(rows, 2), np.repeat([1, -1], len(rows))),
}
"""Functions from rows (K,) and the ``dc_row`` of their basis to exposures, by name.

differential: each row twice, +1 then -1 (M = 2K); negative-first: -1 then +1; halves: all +1, then
all -1; single-ended: +1 only, then a dark exposure if there is a DC row (M = K + 1); signed: one
signed value per row (M = K).
"""

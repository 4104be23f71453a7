"""In which polarities the rows of a plan are shown, and in which sequence."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Exposures = tuple[NDArray[np.int32], NDArray[np.int8]]
"""Row number and polarity (M,) of every exposure, as in `PatternPlan`."""


def _differential(rows: NDArray[np.int64], _level: int | None) -> Exposures:
    return _exposures(np.repeat(rows, 2), np.tile([1, -1], len(rows)))


def _negative_first(rows: NDArray[np.int64], _level: int | None) -> Exposures:
    return _exposures(np.repeat(rows, 2), np.tile([-1, 1], len(rows)))


def _halves(rows: NDArray[np.int64], _level: int | None) -> Exposures:
    return _exposures(np.tile(rows, 2), np.repeat([1, -1], len(rows)))


def _single_ended(rows: NDArray[np.int64], level: int | None) -> Exposures:
    dark = [] if level is None else [level]
    return _exposures(np.append(rows, dark), np.append(np.ones(len(rows)), -np.ones(len(dark))))


def _signed(rows: NDArray[np.int64], _level: int | None) -> Exposures:
    return _exposures(rows, np.zeros(len(rows)))


def _exposures(index: NDArray[np.int64], sign: NDArray[Any]) -> Exposures:
    return index.astype(np.int32), sign.astype(np.int8)


POLARITIES: dict[str, Callable[[NDArray[np.int64], int | None], Exposures]] = {
    "differential": _differential,
    "single-ended": _single_ended,
    "signed": _signed,
    "negative-first": _negative_first,
    "halves": _halves,
}
"""Exposures of rows (K,) of a basis with this ``level``, by name.

differential: each row twice, +1 then -1 (M = 2K); negative-first: -1 then +1; halves: all +1, then
all -1; single-ended: +1 only, and where there is a level a dark exposure in the end (M = K + 1);
signed: one signed value per row (M = K).
"""

"""Throughput: factors on the light of patterns, relative to the mean pattern."""

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Floats
from ..base.errors import InputError

MIN_FACTOR, MAX_FACTOR = 1e-3, 100.0
"""No pattern passes less or more light than this, relative to the mean."""
MIN_MEDIAN, MAX_MEDIAN = 0.1, 10.0
"""Limits of the median: beyond, the unit is mistaken."""


def checked_factors(values: ArrayLike, rows: int, name: str) -> Floats:
    """Relative throughputs (rows,), nan where unknown.

    Raises
    ------
    InputError
        For another number of values, for values that are no positive numbers near 1, and for
        percentages or counts in place of factors.
    """
    factors = np.asarray(values)
    if factors.dtype.kind not in "iuf" or factors.shape != (rows,):
        raise InputError(
            f"{name} has shape {factors.shape} and type {factors.dtype}, expected a number for "
            f"each of the {rows} rows of the basis"
        )
    factors = factors.astype(np.float64)
    known = ~np.isnan(factors)
    if not known.any():
        raise InputError(f"{name} holds no number: leave it out where nothing is known")
    bad = np.flatnonzero(known & ~(np.isfinite(factors) & (factors > 0)))
    if bad.size:
        raise InputError(f"{name} of row {bad[0]} is {factors[bad[0]]:g}, must be positive")
    median = float(np.median(factors[known]))
    if not MIN_MEDIAN <= median <= MAX_MEDIAN:
        hint = "; are these per cent?" if 10 < median <= 1000 else ""
        raise InputError(
            f"{name} has the median {median:g}, expected about 1: factors relative to the mean "
            f"pattern{hint}"
        )
    outside = np.flatnonzero(known & ((factors < MIN_FACTOR) | (factors > MAX_FACTOR)))
    if outside.size:
        raise InputError(
            f"{name} of row {outside[0]} is {factors[outside[0]]:g}; allowed: {MIN_FACTOR:g} to "
            f"{MAX_FACTOR:g}, relative to the mean pattern"
        )
    return factors

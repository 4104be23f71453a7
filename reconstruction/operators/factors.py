"""Throughput: factors on the light of patterns, relative to the mean pattern."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import Floats
from ..base.errors import InputError
from .basis import Basis

if TYPE_CHECKING:
    from .plan import PatternPlan

MIN_FACTOR, MAX_FACTOR = 1e-3, 100.0
"""No pattern passes less or more light than this, relative to the mean."""
MIN_DRAWN = 0.05
"""Minimum drawn factor."""
MIN_MEDIAN, MAX_MEDIAN = 0.1, 10.0
"""Limits of the median: beyond, the unit is mistaken."""


def edge_fractions(basis: Basis, rows: NDArray[np.int32]) -> Floats:
    """Fraction (K,) of neighbouring pixels whose values differ, half the mean step, by row."""
    fractions = []
    for row in rows:
        pattern = basis.row(int(row))
        steps = [np.abs(np.diff(pattern, axis=axis)).ravel() for axis in (0, 1)]
        fractions.append(np.concatenate(steps).mean() / 2 if pattern.size > 1 else 0.0)
    return np.array(fractions)


def with_throughput(
    plan: "PatternPlan",
    factors: Sequence[float] | None = None,
    *,
    edges: float = 0.0,
    spread: float = 0.0,
    seed: int = 0,
) -> "PatternPlan":
    """Plan whose patterns pass different fractions of their light, with the mean 1.

    Parameters
    ----------
    plan
        Plan of K distinct patterns.
    factors
        Factors (K,) in the order of exposure; drawn by the others if None.
    edges
        Fraction that a pattern loses of which all neighbouring pixels differ.
    spread
        Standard deviation of a further normal factor, drawn for each row of the basis.
    seed
        Of these factors.

    Raises
    ------
    InputError
        For another number of factors, and as `checked_factors`.
    """
    basis, rows = plan.patterns, plan.distinct
    if factors is None:
        by_chance = 1 + spread * np.random.default_rng(seed).standard_normal(basis.rows)[rows]
        lost = edges * edge_fractions(basis, rows) if edges else 0.0
        drawn = np.maximum((1 - lost) * by_chance, MIN_DRAWN)
    else:
        drawn = _listed(factors, rows.size)
    throughput = np.full(basis.rows, np.nan)
    throughput[rows] = drawn / drawn.mean()
    return replace(plan, throughput=throughput)


def _listed(factors: Sequence[float], patterns: int) -> Floats:
    if len(factors) != patterns:
        raise InputError(
            f"throughput lists {len(factors)} patterns; the plan displays {patterns}, one factor "
            "for each pattern and its complement"
        )
    checked = checked_factors(np.array(factors), patterns, "throughput")
    if np.isnan(checked).any():
        raise InputError("throughput holds nan; state a factor for each pattern")
    return checked


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

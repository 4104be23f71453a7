"""Plans whose patterns pass different fractions of their light."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import InputError
from .basis import Basis
from .factors import checked_factors
from .plan import PatternPlan

MIN_DRAWN = 0.05
"""Minimum drawn factor."""


def edge_fractions(basis: Basis, rows: NDArray[np.int32]) -> Floats:
    """Fraction (K,) of neighbouring pixels whose values differ, half the mean step, by row."""
    fractions = []
    for row in rows:
        pattern = basis.row(int(row))
        steps = [np.abs(np.diff(pattern, axis=axis)).ravel() for axis in (0, 1)]
        fractions.append(np.concatenate(steps).mean() / 2 if pattern.size > 1 else 0.0)
    return np.array(fractions)


def with_throughput(
    plan: PatternPlan,
    factors: Sequence[float] | None = None,
    *,
    edges: float = 0.0,
    spread: float = 0.0,
    seed: int = 0,
) -> PatternPlan:
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

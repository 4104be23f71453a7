"""Pursuits that draw their atoms by the evidence for each, all of one frame in lockstep."""

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Floats


def pursue_randomly(
    gram: Floats, correlation: NDArray[np.inexact], *, ridge: float, odds: float, draws: Floats
) -> NDArray[np.inexact]:
    """Coefficients (F, n) of F pursuits of one frame, from uniform ``draws`` (F, max. atoms).

    Measurements have noise of variance 1. An atom is present with probability P, where ``odds`` is
    P / (1 - P), and then has a coefficient of variance 1 / ``ridge``. ``gram`` (n, n) and
    ``correlation`` (n,) are as for `batch_omp`. With c the correlation of an atom with the residual
    and p the independent part of its energy, it makes the measurements

        odds exp(|c|^2 / 2 (p + ridge)) / sqrt(1 + p / ridge)

    times as likely; for complex ones all but the odds is squared. Each step takes an atom, or ends
    the pursuit, with chances proportional to this and 1; coefficients then minimise |y - Phi u|^2 +
    ridge |u|^2: they are posterior means.
    """
    pursuits, maximum = draws.shape
    every = np.arange(pursuits)
    parts = 1.0 if np.iscomplexobj(correlation) else 0.5
    left = np.tile(correlation, (pursuits, 1))
    power = np.tile(np.diag(gram), (pursuits, 1))
    log_odds = np.full(power.shape, np.log(odds))
    columns = np.zeros((maximum, *power.shape))
    pivots = np.ones((maximum, pursuits))
    fractions = np.zeros((maximum, pursuits), correlation.dtype)
    chosen = np.zeros((maximum, pursuits), np.intp)
    going = np.ones(pursuits, dtype=bool)
    taken = 0
    for draw in draws.T:
        explained = np.abs(left) ** 2 / (power + ridge) - np.log1p(power / ridge)
        atom = drawn(log_odds + parts * explained, draw)
        going = going & (atom >= 0)
        if not going.any():
            break
        row = columns[:taken, every, atom] / pivots[:taken]
        new = gram[atom] - np.einsum("sf,sfa->fa", row, columns[:taken])
        new[~going] = 0
        pivots[taken] = new[every, atom] + ridge
        fractions[taken] = np.where(going, left[every, atom], 0) / pivots[taken]
        left -= fractions[taken][:, None] * new
        power = np.maximum(power - new**2 / pivots[taken][:, None], 0)
        log_odds[every[going], atom[going]] = -np.inf
        columns[taken], chosen[taken] = new, atom
        taken += 1
    result = np.zeros_like(left)
    for step in reversed(range(taken)):
        following = (columns[step] * result).sum(axis=1) / pivots[step]
        result[every, chosen[step]] += fractions[step] - following
    return result


def drawn(log_weights: Floats, draws: Floats) -> NDArray[np.intp]:
    """Index (F,) drawn by weights (F, n) and uniform ``draws`` (F,); -1 by a weight of 1."""
    highest = np.maximum(log_weights.max(axis=1), 0)
    sums = np.exp(log_weights - highest[:, None]).cumsum(axis=1)
    at = draws * (sums[:, -1] + np.exp(-highest))
    index = (sums <= at[:, None]).sum(axis=1)
    return np.where(index < sums.shape[1], index, -1)

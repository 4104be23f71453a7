"""Posterior of the ranges and of the fog they share.

Extinction and backscattering are common to the spots and integrated out: the extinction over the
nodes of the tables, the backscattering over a grid on which the modes' parabolas are summed.
"""

import math
from dataclasses import dataclass

import numpy as np

from ...base.arrays import Floats
from ..ranges import MIN_SIGNAL, Alternative
from .fog_state import FogState
from .modes import Modes

GRID = np.geomspace(1e-6, 0.1, 96)
"""Initial grid of backscattering, 1 / (m sr), refined where it is likely."""
FINE = 33
NEGLIGIBLE = 1e-4
"""Fraction of the total below which a mode is dropped."""
SPREAD = 3.0
"""Modes whose ranges touch within so many standard deviations are merged."""


@dataclass(frozen=True)
class SpotPosterior:
    """Posterior of one range: its alternatives, likeliest first.

    ``target`` is the probability of any target. Of the likeliest mode: ``strength`` of the target's
    signal in standard deviations, ``signal`` in electrons, ``misfit`` chi squared, ``noise_m`` the
    range's sigma if the fog were known, ``node`` and ``backscatter`` the fog. Targets weaker than
    ``needed`` are indistinguishable from fog. With ``on_edge`` two targets at once explain the
    readings and one does not; ``echoes`` counts simultaneous resolved alternatives. ``uneven`` is
    the probability that the fog is not the same for all spots, and even along their beams.
    """

    alternatives: tuple[Alternative, ...] = ()
    target: float = 0.0
    strength: float = 0.0
    needed: float = MIN_SIGNAL
    signal: float = 0.0
    misfit: float = np.inf
    noise_m: float = np.inf
    node: int = 0
    backscatter: float = 0.0
    on_edge: bool = False
    echoes: int = 1
    uneven: float = 0.0


@dataclass(frozen=True)
class Posterior:
    """Posterior of the ranges and of the fog, and the logarithm of the evidence of its model."""

    spots: tuple[SpotPosterior, ...]
    fog: FogState
    log_evidence: float = 0.0


def posterior(modes: Modes, prior: FogState, spots: int) -> Posterior:
    """Posterior of the modes of so many spots, for a prior of the fog."""
    if not modes.spot.size:
        return Posterior((SpotPosterior(),) * spots, prior)
    modes, ranks = _ranked(modes)
    weight, by_mode, _ = _weighted(modes, ranks, prior, beta := GRID)
    for _ in range(2):
        likely = np.flatnonzero(weight.sum(axis=0) > 1e-5)
        low, high = beta[max(likely[0] - 1, 0)], beta[min(likely[-1] + 1, len(beta) - 1)]
        beta = np.linspace(low, high, FINE)
        weight, by_mode, log_evidence = _weighted(modes, ranks, prior, beta)
    total = by_mode.sum(axis=1)
    moved = modes.range_m[:, None] + modes.drift[:, None] * (beta - modes.backscatter[:, None])
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = (by_mode * moved).sum(axis=1) / total
        drift_variance = (by_mode * (moved - mean[:, None]) ** 2).sum(axis=1) / total
    found = np.stack([mean, modes.variance_m2 + drift_variance, total], axis=1)
    seen = np.flatnonzero(np.isfinite(modes.range_m) & (total > NEGLIGIBLE))

    def of(spot: int) -> SpotPosterior:
        here = seen[modes.spot[seen] == spot]
        if not here.size:
            return SpotPosterior()
        best = here[total[here].argmax()]
        rows = found[here].tolist()
        return SpotPosterior(
            alternatives=joined(rows),
            target=sum(weight for _, _, weight in rows),
            strength=float(modes.strength[best]),
            signal=float(modes.signal[best]),
            misfit=float(modes.misfit[best]),
            noise_m=float(np.sqrt(modes.variance_m2[best])),
            node=int(modes.node[best]),
            backscatter=float(modes.backscatter[best]),
        )

    fog = prior.update(weight, beta)
    return Posterior(tuple(map(of, range(spots))), fog, log_evidence)


def _ranked(modes: Modes) -> tuple[Modes, list[tuple[slice, slice]]]:
    """Modes ordered such that the first ones of all pairs of spot and extinction come first.

    Also returns, for all first modes, all second ones and so on, their rows and those of the same
    pairs among the first ones, which begin with the pairs of the most modes.
    """
    modes = modes.only(np.lexsort((modes.node, modes.spot)))
    count = np.bincount(modes.spot * (modes.node.max() + 1) + modes.node)
    rank = np.arange(modes.spot.size) - np.repeat(np.cumsum(count) - count, count)
    ends = np.cumsum(np.bincount(rank)).tolist()
    ranks = [(slice(a, b), slice(b - a)) for a, b in zip([0, *ends], ends, strict=False)]
    return modes.only(np.lexsort((-np.repeat(count, count), rank))), ranks


def _weighted(
    modes: Modes, ranks: list[tuple[slice, slice]], prior: FogState, beta: Floats
) -> tuple[Floats, Floats, float]:
    """Weights (K, B) of fogs on a grid (B,), and of each mode (C, B), which sum to one per spot.

    Also returns the logarithm of the evidence.
    """
    offset = beta - modes.backscatter[:, None]
    log = offset * (-modes.curvature[:, None] / 2)
    log += modes.slope[:, None]
    log *= offset
    log += modes.log_weight[:, None]
    peak = log[ranks[0][0]].copy()
    for rows, pairs in ranks[1:]:
        np.maximum(peak[pairs], log[rows], out=peak[pairs])
    summed = np.zeros_like(peak)
    for rows, pairs in ranks:
        relative = np.maximum(log[rows] - peak[pairs], -700)  # exp is slow at underflow
        summed[pairs] += np.exp(relative, out=log[rows])
    # Every usable spot has modes at every extinction.
    spot, node = modes.spot[ranks[0][0]], modes.node[ranks[0][0]]
    evidence = (peak + np.log(summed))[np.lexsort((node, spot))]
    shared = evidence.reshape(-1, prior.probability.size, beta.size).sum(axis=0)
    fog = prior.log_density(beta) + shared
    weight = np.exp(fog - fog.max())
    whole = weight.sum()
    weight /= whole
    scale = weight[node] / summed
    for rows, pairs in ranks:
        log[rows] *= scale[pairs]
    return weight, log, float(fog.max() + np.log(whole))


def joined(modes: list[list[float]]) -> tuple[Alternative, ...]:
    """Merge modes, each of mean, variance and weight, that touch; likeliest first."""
    whole = sum(weight for _, _, weight in modes)
    groups: list[list[list[float]]] = []
    reach = -np.inf
    for mode in sorted(modes):
        if mode[2] > NEGLIGIBLE**2 * whole:
            spread = SPREAD * math.sqrt(mode[1])
            if mode[0] - spread > reach:
                groups.append([])
            groups[-1].append(mode)
            reach = max(reach, mode[0] + spread)
    merged = sorted((_merged(group, whole) for group in groups), key=lambda each: -each.weight)
    return tuple(each for each in merged if each.weight > NEGLIGIBLE)


def _merged(modes: list[list[float]], whole: float) -> Alternative:
    total = sum(weight for _, _, weight in modes)
    centre = sum(weight * mean for mean, _, weight in modes) / total
    around = sum(weight * (variance + (mean - centre) ** 2) for mean, variance, weight in modes)
    return Alternative(centre, math.sqrt(around / total), total / whole)

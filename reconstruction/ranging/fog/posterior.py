"""Posterior of the ranges and of the fog they share.

Extinction and backscattering are common to the spots and integrated out: the extinction over the
nodes of the tables, the backscattering over a grid on which the modes' parabolas are summed.
"""

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
    readings and one does not; ``echoes`` counts simultaneous resolved alternatives.
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


@dataclass(frozen=True)
class Posterior:
    """Posterior of the ranges and of the fog."""

    spots: tuple[SpotPosterior, ...]
    fog: FogState


def posterior(modes: Modes, prior: FogState, spots: int) -> Posterior:
    """Posterior of the modes of so many spots, for a prior of the fog."""
    if not modes.spot.size:
        return Posterior((SpotPosterior(),) * spots, prior)
    modes = modes.only(np.lexsort((modes.node, modes.spot)))
    beta = GRID
    weight, by_mode = _weighted(modes, prior, beta)
    for _ in range(2):
        likely = np.flatnonzero(weight.sum(axis=0) > 1e-5)
        low, high = beta[max(likely[0] - 1, 0)], beta[min(likely[-1] + 1, len(beta) - 1)]
        beta = np.linspace(low, high, FINE)
        weight, by_mode = _weighted(modes, prior, beta)
    total = by_mode.sum(axis=1)
    moved = modes.range_m[:, None] + modes.drift[:, None] * (beta - modes.backscatter[:, None])
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = (by_mode * moved).sum(axis=1) / total
        drift_variance = (by_mode * (moved - mean[:, None]) ** 2).sum(axis=1) / total
    variance = modes.variance_m2 + drift_variance
    seen = np.isfinite(modes.range_m) & (total > NEGLIGIBLE)

    def of(spot: int) -> SpotPosterior:
        here = np.flatnonzero(seen & (modes.spot == spot))
        if not here.size:
            return SpotPosterior()
        best = here[np.argmax(total[here])]
        return SpotPosterior(
            alternatives=joined(mean[here], variance[here], total[here]),
            target=float(total[here].sum()),
            strength=float(modes.strength[best]),
            signal=float(modes.signal[best]),
            misfit=float(modes.misfit[best]),
            noise_m=float(np.sqrt(modes.variance_m2[best])),
            node=int(modes.node[best]),
            backscatter=float(modes.backscatter[best]),
        )

    return Posterior(spots=tuple(of(spot) for spot in range(spots)), fog=prior.update(weight, beta))


def _weighted(modes: Modes, prior: FogState, beta: Floats) -> tuple[Floats, Floats]:
    """Weights (K, B) of fogs on a grid (B,), and of each mode (C, B), which sum to one per spot."""
    offset = beta - modes.backscatter[:, None]
    log = modes.log_weight[:, None] + modes.slope[:, None] * offset
    log -= modes.curvature[:, None] * offset**2 / 2
    fog = prior.log_density(beta)
    # Every usable spot has modes at every extinction, in this order.
    changes = np.diff(modes.node, prepend=-1) != 0
    starts, group = np.flatnonzero(changes), np.cumsum(changes) - 1
    peak = np.maximum.reduceat(log, starts, axis=0)
    relative = np.exp(log - peak[group])
    summed = np.add.reduceat(relative, starts, axis=0)
    evidence = peak + np.log(summed)
    fog = fog + evidence.reshape(-1, *fog.shape).sum(axis=0)
    weight = np.exp(fog - fog.max())
    weight /= weight.sum()
    return weight, relative / summed[group] * weight[modes.node]


def joined(mean: Floats, variance: Floats, weight: Floats) -> tuple[Alternative, ...]:
    """Merge modes that touch, likeliest first."""
    seen = np.flatnonzero(weight > NEGLIGIBLE**2 * weight.sum())
    order = seen[np.argsort(mean[seen])]
    mean, variance, weight = mean[order], variance[order], weight[order]
    sigma = SPREAD * np.sqrt(variance)
    max_reach = np.maximum.accumulate(mean + sigma)
    starts = np.concatenate([[True], (mean - sigma)[1:] > max_reach[:-1]])
    group = np.cumsum(starts) - 1
    total = np.bincount(group, weight)
    centre = np.bincount(group, weight * mean) / total
    around = np.bincount(group, weight * (variance + (mean - centre[group]) ** 2)) / total
    fraction = total / weight.sum()
    return tuple(
        Alternative(float(centre[k]), float(np.sqrt(around[k])), float(fraction[k]))
        for k in np.argsort(-fraction)
        if fraction[k] > NEGLIGIBLE
    )

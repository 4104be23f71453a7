"""Where the first surface on a spot's ray is: everything that the readings do not exclude.

A ranging method states possible ranges and the probability that there is no target. Without a
target, a surface may still be where the detector is blind, too dark, or against the lens; and the
brightness of the image limits how near or far any surface is: a pixel of B electrons shows
reflectance B / U(x) at x, where U is what a white surface would return. All that is one posterior
over cells of the range, so that nothing on the way to the corridor drops an alternative.
"""

from dataclasses import dataclass

import numpy as np

from ..base.arrays import Floats
from .fog.answer import MIN_PROBABILITY
from .ranges import RANGED, Ranges

STEP = 1.105
"""Ratio of successive edges."""
EDGES_M = 40.0 * STEP ** np.arange(-67.0, 1.0)
"""Edges (K,) of the cells, from 5 cm to the maximum range."""
EDGES_M.setflags(write=False)
LOG_EDGES = np.log(EDGES_M)
COVERED = 0.4
"""Prior probability of something against the lens where nothing at all returns,"""
OPEN = 0.35
"""and of nothing within the maximum range: a covered lens and an open sky look alike, and neither
is called free. The rest is uniform in ln range."""
MISSED = 0.05
"""Probability that a surface within reach returns nothing: black, or a mirror that looks away."""
USUAL_REACH_M = 15.0
"""Range up to which surfaces usually return something; histograms end with their gate."""
SATURATING_M = 2.0
"""Range up to which a surface may saturate a detector."""
TOO_CLOSE_M = 0.3
"""Range up to which a path may not be longer than from laser to detector."""
ALONE = 0.1
"""Factor of what a ray misses though it sees there, while others have a target. What it is blind
to, a floor or a slanted wall, remains."""
SURE = 0.05
"""Probability of no target below which a spot has one."""
MIN_LOG_SIGMA = 0.02
HALEY = 1.702
"""Slope of the logistic distribution that is normal within 0.01 (D. C. Haley, 1952)."""


@dataclass(frozen=True, eq=False)
class FirstSurfaces:
    """Posterior of the first surface on the rays of some spots.

    ``mass`` (spots, K + 1) are probabilities of the cells between `EDGES_M`: the first is nearer
    than all of these, the last beyond.
    """

    mass: Floats

    @property
    def beyond(self) -> Floats:
        """Probability (spots, K) that the first surface is beyond each of `EDGES_M`."""
        return np.asarray(1 - np.cumsum(self.mass[:, :-1], axis=1))

    def quantiles_m(self, levels: Floats) -> Floats:
        """Ranges (L, spots) at some levels from 0 to 1, middles of cells; infinite beyond all."""
        middles = np.append(EDGES_M / np.sqrt(STEP), np.inf)
        before = np.cumsum(self.mass, axis=1)
        cell = (before[None] < levels[:, None, None]).sum(axis=-1)
        return np.asarray(middles[np.minimum(cell, middles.size - 1)])


def first_surfaces(
    ranges: Ranges, blind_m: Floats, reach_m: float = USUAL_REACH_M, image: Floats | None = None
) -> FirstSurfaces:
    """Posterior of the first surfaces of a frame.

    Parameters
    ----------
    ranges
        Ranges of the spots, with all their alternatives.
    blind_m : array, (spots,)
        Range below which the detectors do not see their spots; nan if unknown, as if it were 0.
    reach_m
        Range beyond which no target is looked for.
    image : array, (spots, K + 1)
        Likelihood of the cells by the brightness of the image at the spots; see `image_level`.
    """
    unseen = np.zeros((len(ranges.status), EDGES_M.size + 1))
    possible = np.array([_of_alternatives(ranges, spot) for spot in range(len(ranges.status))])
    nothing = np.where(possible.any(axis=1), _without_target(ranges), 1.0)
    alone = ALONE if (nothing < SURE).any() else 1.0
    for spot, status in enumerate(ranges.status):
        missed = np.where((blind_m[spot] < EDGES_M) & (reach_m > EDGES_M), MISSED, 1.0)
        if status == "saturated":
            missed = np.where(EDGES_M < SATURATING_M, 1.0, 0.0)
        elif status == "too close":
            missed = np.where(EDGES_M < TOO_CLOSE_M, 1.0, 0.0)
        unseen[spot] = nothing[spot] * _unseen(missed, alone, status in ("saturated", "too close"))
    mass = (1 - nothing)[:, None] * possible + unseen
    if image is not None:
        mass = mass * image
    return FirstSurfaces(mass / mass.sum(axis=1, keepdims=True))


def _without_target(ranges: Ranges) -> Floats:
    """Probability (spots,) that the readings show no target."""
    stated = ranges.nothing
    lost = np.array(
        [
            0.0 if status in RANGED or (some and status not in ("saturated", "weak")) else 1.0
            for status, some in zip(ranges.status, ranges.alternatives, strict=True)
        ]
    )
    measured = np.isfinite(stated) & ~np.isin(ranges.status, ("saturated", "weak"))
    return np.where(measured, stated, lost)


def _of_alternatives(ranges: Ranges, spot: int) -> Floats:
    """Probabilities (K + 1,) of the cells by all possible ranges of a spot."""
    some = ranges.alternatives[spot] or ((ranges.range_m[spot], ranges.sigma_m[spot], 1.0),)
    if ranges.status[spot] == "ok" and some[0][2] < MIN_PROBABILITY:
        some = (min(some),)  # simultaneous echoes, all of them surfaces
    range_m, sigma_m, weight = np.array(some, dtype=np.float64).T
    usable = np.isfinite(range_m) & (range_m > 0) & (weight > 0)
    if not usable.any():
        return np.zeros(EDGES_M.size + 1)
    range_m, sigma_m, weight = range_m[usable], sigma_m[usable], weight[usable]
    log_sigma = np.fmax(sigma_m / range_m, MIN_LOG_SIGMA)
    away = (LOG_EDGES - np.log(range_m)[:, None]) / log_sigma[:, None]
    below = 0.5 + 0.5 * np.tanh(HALEY / 2 * away)
    cells = np.diff(below, prepend=0, append=1, axis=1)
    return np.asarray(weight @ cells / weight.sum())


def _unseen(missed: Floats, alone: float, returned: bool) -> Floats:
    """Probabilities (K + 1,) of the cells where nothing is seen but for what ``missed`` allows.

    If something ``returned``, it is not beyond the maximum range.
    """
    within = missed * (1 - COVERED - OPEN) / EDGES_M.size
    prior = np.concatenate([[COVERED if alone == 1 else 0.0], within[1:], [OPEN]])
    prior = np.where(np.append(missed, 1.0) < 1, alone * prior, prior)
    if returned:
        prior[-1] = 0
    return np.asarray(prior / prior.sum())

"""How far ahead the corridor of flight is free: the probability at every distance, and obstacles.

The errors of a depth map's pixels are far from independent: an object is too near or too far as a
whole. An ensemble of maps takes them as fully correlated: each member is off by the same number of
sigmas in every pixel, and has nothing where that is likelier than its own level. The nearest
obstacles of the members, each uncertain by ``sigma``, make up the distribution of the true one; a
fraction of all maps, ``outlier``, tells nothing of the corridor. Where errors are independent, the
ensemble is too wide; `CorridorPrior.scale` makes up for that on average.
"""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import InputError
from .method import MAX_RANGE_M, DepthEstimate

CORRIDOR_M = 0.6
"""Width and height of the corridor along the optical axis in which a drone flies."""
OBSTACLE_M2 = 0.01
"""Cross-section of what counts as an obstacle: that of a hand's breadth squared."""
DISTANCES_M = np.geomspace(0.2, MAX_RANGE_M, 54)
"""Distances up to which the probability that the corridor is free is stated; steps of 10.5 %."""
DISTANCES_M.setflags(write=False)
MIN_FREE = 0.65
"""The nearest obstacle is where that probability falls below this, unless the user says else."""
NEAREST_M = 0.4
"""Of maps that tell nothing, the obstacle is anywhere from here to REACH_M, uniform in ln d."""
ERRORS = np.array([NormalDist().inv_cdf((n + 0.5) / 11) for n in range(11)])
"""Of the members of the ensemble, in sigmas."""
LEVELS = (np.arange(6) + 0.5) / 6
"""Probabilities of nothing from which on members have nothing in a pixel."""
FEW_PIXELS = 64
"""Nearest pixels of which an obstacle mostly consists; where it does not, all are looked at."""
LOG_DISTANCES = np.log(DISTANCES_M)
ANYWHERE = np.clip(np.log(MAX_RANGE_M / DISTANCES_M) / np.log(MAX_RANGE_M / NEAREST_M), 0, 1)
"""Probability that an obstacle of a map that tells nothing is behind each distance."""
HALEY = 1.702
"""A logistic distribution of this slope is normal within 0.01 (D. C. Haley, 1952)."""
FITTED = Path(__file__).with_name("corridor_priors.json")


@dataclass(frozen=True)
class CorridorPrior:
    """What an ensemble takes for granted of a map's errors, fitted by `tools/corridor_priors.py`.

    ``bias``: of ln depth of obstacles, true less estimated. ``scale``: factor of the map's sigma.
    ``sigma``: of ln depth of an obstacle, beyond that. ``outlier``: fraction of the maps that tell
    nothing of the corridor. ``map_sigma``: of ln depth, of maps that tell none.
    """

    bias: float
    scale: float
    sigma: float
    outlier: float
    map_sigma: float


@cache
def corridor_prior(name: str) -> CorridorPrior:
    """The constants that are fitted to maps ``learned``, or to ``others``."""
    return CorridorPrior(**json.loads(FITTED.read_text())[name]["prior"])


class Corridor:
    """What lies ahead, CORRIDOR_M wide and high, along the optical axis of pixels with ``rays``.

    Rays (H, W, 3) are those of `pixel_rays`.
    """

    def __init__(self, rays: Floats) -> None:
        self._slope = np.abs(rays[..., :2]).max(axis=-1)
        height, width = self._slope.shape
        across, down = (np.ptp(rays[..., k]) / max(n - 1, 1) for k, n in enumerate((width, height)))
        self._pixel = (across or down) * (down or across)  # at 1 m

    def nearest_m(self, depth_m: Floats) -> float:
        """Depth within reach of the nearest obstacle of a map without errors, nan without one.

        It is there from the depth on up to which the pixels (H, W) in the corridor make up
        OBSTACLE_M2 together, each as large as it is at its depth: wires count for little.
        """
        first = np.zeros(depth_m.size)
        return float(self._nearest_m(depth_m.reshape(1, -1), self._slope.ravel(), first, 1)[0])

    def stated(self, estimate: DepthEstimate) -> Floats | None:
        """What an estimate states of the corridor, else what its map does; None without depths."""
        if estimate.free is not None or not np.isfinite(estimate.depth_m).any():
            return estimate.free
        prior = corridor_prior("others")
        return self.free(estimate.depth_m, prior, estimate.sigma, estimate.no_return)

    def free(
        self,
        depth_m: Floats,
        prior: CorridorPrior,
        sigma: Floats | None = None,
        no_return: Floats | None = None,
    ) -> Floats:
        """Probability that the corridor is free up to each of `DISTANCES_M`, never rising.

        Of a map (H, W), nan where it tells no depth; ``sigma`` (H, W) is its standard deviation
        of ln depth, ``no_return`` (H, W) the probability that there is nothing within reach.
        """
        if sigma is None:
            sigma = np.full(depth_m.shape, prior.map_sigma)
        return free_of(self.ensemble_m(depth_m, prior.scale * sigma, no_return), prior)

    def ensemble_m(self, depth_m: Floats, sigma: Floats, no_return: Floats | None = None) -> Floats:
        """Nearest obstacles (N,) of maps that are off by `ERRORS` times ``sigma`` of ln depth.

        They have nothing in the pixels where that is likelier than `LEVELS`; nan without obstacle.
        """
        inside = self._slope * depth_m * np.exp(ERRORS[0] * sigma) <= CORRIDOR_M / 2
        depth_m, sigma, slope = depth_m[inside], sigma[inside], self._slope[inside]
        maps = depth_m * np.exp(ERRORS[:, None] * sigma)
        if no_return is None:
            return self._nearest_m(maps, slope, np.zeros(slope.size), 1)
        first = np.searchsorted(LEVELS, no_return[inside], side="right")
        return self._nearest_m(maps, slope, first, LEVELS.size)

    def _nearest_m(self, maps: Floats, slope: Floats, first: Floats, levels: int) -> Floats:
        """Of maps (E, n) of the same pixels at each of some levels, (E levels,).

        ``first`` (n,): level from which on a pixel is there.
        """
        inside = (maps <= MAX_RANGE_M) & (slope * maps <= CORRIDOR_M / 2)
        near_m = np.where(inside, maps, np.inf)
        for maximum in (FEW_PIXELS, slope.size):
            few = _nearest(near_m, maximum)
            sorted_m = np.take_along_axis(near_m, few, axis=1)
            area = self._pixel * np.where(np.isfinite(sorted_m), sorted_m, 0) ** 2
            there = first[few][:, None] <= np.arange(levels)[:, None]
            count = (np.cumsum(area[:, None] * there, axis=-1) < OBSTACLE_M2).sum(axis=-1)
            if (count < few.shape[1]).all():
                break
        result = np.append(sorted_m, np.full((len(maps), 1), np.nan), axis=1)
        return np.take_along_axis(result, count, axis=1).ravel()


def _nearest(depth_m: Floats, maximum: int) -> NDArray[np.intp]:
    """The nearest pixels of each map (E, n), in their order: (E, most)."""
    if maximum >= depth_m.shape[1]:
        return np.argsort(depth_m, axis=1)
    few = np.argpartition(depth_m, maximum, axis=1)[:, :maximum]
    return np.take_along_axis(few, np.argsort(np.take_along_axis(depth_m, few, axis=1)), axis=1)


def free_of(ensemble_m: Floats, prior: CorridorPrior) -> Floats:
    """Probability (..., K) that nothing is nearer than `DISTANCES_M`; ensembles are (..., N)."""
    log_m = np.log(np.where(np.isnan(ensemble_m), np.inf, ensemble_m)) + prior.bias
    away = (log_m[..., None, :] - LOG_DISTANCES[:, None]) * (HALEY / 2 / prior.sigma)
    behind = 0.5 + 0.5 * np.tanh(away).mean(axis=-1)
    return np.asarray((1 - prior.outlier) * behind + prior.outlier * ANYWHERE)


def nearest_obstacle_m(free: Floats, min_free: float = MIN_FREE) -> float:
    """Distance from which on ``free`` (see `Corridor.free`) is below ``min_free``, else nan.

    Interpolated in ln d; DISTANCES_M[0] where even that far is not free. Raises InputError unless
    0 < min_free < 1.
    """
    check_min_free(min_free)
    below = free < min_free
    if not below.any():
        return float("nan")
    first = int(np.argmax(below))
    if first == 0:
        return float(DISTANCES_M[0])
    logs, (high, low) = np.log(DISTANCES_M[first - 1 : first + 1]), free[first - 1 : first + 1]
    return float(np.exp(logs[0] + (logs[1] - logs[0]) * (high - min_free) / (high - low)))


def check_min_free(min_free: float) -> None:
    """Raises InputError unless it is a probability that obstacles can be told by."""
    if not 0 < min_free < 1:
        raise InputError(f"min_free = {min_free:g}: a probability above 0 and below 1 is needed")

"""Free flight corridor ahead: its probability at every distance, and the nearest obstacle.

The errors of a depth map's pixels are highly correlated: an object is too near or too far as a
whole. An ensemble of maps assumes full correlation: each member is off by the same number of sigmas
in every pixel, and lacks a pixel if no return is more probable there than the member's own level.
The nearest obstacles of the members, each uncertain by ``sigma``, form the distribution of the true
one; a fraction of all maps, ``outlier``, says nothing about the corridor. If errors are
independent, the ensemble is too wide, which `CorridorPrior.scale` corrects on average.
"""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import Floats
from ..base.errors import InputError
from ..ranging.first_surface import HALEY
from .method import MAX_RANGE_M

CORRIDOR_M = 0.6
"""Width and height of the corridor in which a drone flies, usually along the optical axis."""
FORWARD = np.array([0.0, 0.0, 1.0])
"""Optical axis."""
FORWARD.setflags(write=False)
OBSTACLE_M2 = 0.01
"""Cross-section of an obstacle: that of a hand's breadth squared."""
DISTANCES_M = np.geomspace(0.2, MAX_RANGE_M, 54)
"""Distances up to which the probability of a free corridor is stated; steps of 10.5 %."""
DISTANCES_M.setflags(write=False)
MIN_FREE = 0.65
"""Default probability below which the corridor counts as blocked."""
NEAREST_M = 0.4
"""For uninformative maps, obstacles are uniform in ln d from here to MAX_RANGE_M."""
ERRORS = np.array([NormalDist().inv_cdf((n + 0.5) / 11) for n in range(11)])
"""Errors of the ensemble members, in sigmas."""
LEVELS = (np.arange(6) + 0.5) / 6
"""Probabilities of no return at which members lose a pixel."""
FEW_PIXELS = 64
"""Number of nearest pixels that usually form an obstacle; if not, all are examined."""
LOG_DISTANCES = np.log(DISTANCES_M)
ANYWHERE = np.clip(np.log(MAX_RANGE_M / DISTANCES_M) / np.log(MAX_RANGE_M / NEAREST_M), 0, 1)
"""Probability that the obstacle of an uninformative map is beyond each distance."""
FITTED = Path(__file__).with_name("corridor_priors.json")


@dataclass(frozen=True)
class CorridorPrior:
    """Error model of an ensemble, fitted by `tools/corridor_priors.py`.

    ``bias``: of ln depth of obstacles, true minus estimated. ``scale``: factor of the map's sigma.
    ``sigma``: additional one of ln depth of an obstacle. ``outlier``: fraction of uninformative
    maps. ``map_sigma``: of ln depth, for maps that state none.
    """

    bias: float
    scale: float
    sigma: float
    outlier: float
    map_sigma: float


@cache
def corridor_prior(name: str) -> CorridorPrior:
    """Constants fitted to maps by ``learned``, or by ``others``."""
    return CorridorPrior(**json.loads(FITTED.read_text())[name]["prior"])


class Corridor:
    """Corridor CORRIDOR_M wide and high, for maps of `pixel_rays` (H, W, 3).

    ``direction`` (3,) is its unit vector, by default the optical axis; distances are along it.
    """

    def __init__(self, rays: Floats, direction: Floats = FORWARD) -> None:
        local = rays @ axes_along(direction)
        self._stretch = local[..., 2]
        with np.errstate(divide="ignore"):
            slope = np.abs(local[..., :2]).max(axis=-1) / self._stretch
        self._slope = np.where(self._stretch > 0, slope, np.inf)
        height, width = self._slope.shape
        across, down = (np.ptp(rays[..., k]) / max(n - 1, 1) for k, n in enumerate((width, height)))
        self._pixel = (across or down) * (down or across)  # at 1 m

    def nearest_m(self, depth_m: Floats) -> float:
        """Depth within the maximum range of the nearest obstacle of an exact map, nan without one.

        It is the depth up to which the pixels (H, W) in the corridor add up to OBSTACLE_M2, each
        with its area at its depth: wires count for little.
        """
        first = np.zeros(depth_m.size)
        depth_m = depth_m * self._stretch
        return float(self._nearest_m(depth_m.reshape(1, -1), self._slope.ravel(), first, 1)[0])

    def free(
        self,
        depth_m: Floats,
        prior: CorridorPrior,
        sigma: Floats | None = None,
        no_return: Floats | None = None,
    ) -> Floats:
        """Probability that the corridor is free up to each of `DISTANCES_M`, never increasing.

        Parameters
        ----------
        depth_m
            Depth map (H, W), nan without depth.
        prior
            Error model of the map.
        sigma
            Standard deviation (H, W) of ln depth, by default ``map_sigma`` of the prior.
        no_return
            Probability (H, W) that there is nothing within the maximum range.
        """
        if sigma is None:
            sigma = np.full(depth_m.shape, prior.map_sigma)
        return free_of(self.ensemble_m(depth_m, prior.scale * sigma, no_return), prior)

    def ensemble_m(self, depth_m: Floats, sigma: Floats, no_return: Floats | None = None) -> Floats:
        """Nearest obstacles (N,) of ensemble members, nan without; ``sigma`` is of ln depth."""
        depth_m = depth_m * self._stretch
        inside = self._slope * depth_m * np.exp(ERRORS[0] * sigma) <= CORRIDOR_M / 2
        depth_m, sigma, slope = depth_m[inside], sigma[inside], self._slope[inside]
        maps = depth_m * np.exp(ERRORS[:, None] * sigma)
        if no_return is None:
            return self._nearest_m(maps, slope, np.zeros(slope.size), 1)
        first = np.searchsorted(LEVELS, no_return[inside], side="right")
        return self._nearest_m(maps, slope, first, LEVELS.size)

    def _nearest_m(self, maps: Floats, slope: Floats, first: Floats, levels: int) -> Floats:
        """Nearest obstacles (E levels,) of maps (E, n) with pixels from level ``first`` (n,) on."""
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
    """Indices of the nearest pixels of each map (E, n), sorted: (E, maximum)."""
    if maximum >= depth_m.shape[1]:
        return np.argsort(depth_m, axis=1)
    few = np.argpartition(depth_m, maximum, axis=1)[:, :maximum]
    return np.take_along_axis(few, np.argsort(np.take_along_axis(depth_m, few, axis=1)), axis=1)


def unit_in_view(direction: ArrayLike, rays: Floats) -> Floats:
    """Unit vector of a direction (3,) within the view of rays (H, W, 3); InputError for others."""
    along = np.asarray(direction, dtype=np.float64)
    if along.shape != (3,) or not np.isfinite(along).all() or not along.any():
        raise InputError(
            f"direction = {along.tolist()}: three finite numbers are needed, not all zero"
        )
    along = along / np.linalg.norm(along)
    right, down = np.abs(rays[..., :2]).reshape(-1, 2).max(axis=0)
    x, y, z = along
    if not (z > 0 and abs(x) <= right * z and abs(y) <= down * z):
        raise InputError(
            f"direction = {along.round(3).tolist()}: out of view; x / z is at most {right:.3g} "
            f"and y / z at most {down:.3g}, with z > 0"
        )
    return along


def axes_along(direction: Floats) -> Floats:
    """Axes (3, 3), as columns, of a frame whose z is a unit vector: right, down, along it.

    Right is level in the optical frame, whose own axes belong to its z.
    """
    right = np.array([direction[2], 0.0, -direction[0]])
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(direction, right), direction], axis=1)


def free_of(ensemble_m: Floats, prior: CorridorPrior) -> Floats:
    """Probability (..., K) that nothing is nearer than `DISTANCES_M`, from ensembles (..., N)."""
    log_m = np.log(np.where(np.isnan(ensemble_m), np.inf, ensemble_m)) + prior.bias
    away = (log_m[..., None, :] - LOG_DISTANCES[:, None]) * (HALEY / 2 / prior.sigma)
    behind = 0.5 + 0.5 * np.tanh(away).mean(axis=-1)
    return np.asarray((1 - prior.outlier) * behind + prior.outlier * ANYWHERE)


def nearest_obstacle_m(free: Floats, min_free: float = MIN_FREE) -> float:
    """Distance of the nearest obstacle, from the probability of a free corridor.

    Parameters
    ----------
    free
        Probability (K,) by `Corridor.free`.
    min_free
        Probability below which the corridor counts as blocked.

    Returns
    -------
    float
        Distance in metres, interpolated in ln d; DISTANCES_M[0] if not even that is free, nan if
        all is.

    Raises
    ------
    InputError
        Unless 0 < min_free < 1.
    """
    check_min_free(min_free)
    below = ~(free >= min_free)  # not a number: not free
    if not below.any():
        return float("nan")
    first = int(np.argmax(below))
    if first == 0:
        return float(DISTANCES_M[0])
    logs, (high, low) = np.log(DISTANCES_M[first - 1 : first + 1]), free[first - 1 : first + 1]
    return float(np.exp(logs[0] + (logs[1] - logs[0]) * (high - min_free) / (high - low)))


def check_min_free(min_free: float) -> None:
    """Raise InputError unless 0 < min_free < 1."""
    if not 0 < min_free < 1:
        raise InputError(f"min_free = {min_free:g}: must lie between 0 and 1, exclusive")

"""Free corridors by all that is not excluded.

A depth map speaks for that part of the posterior of its spots with which it agrees. For the rest,
the map anchored on these other ranges does: the spots are taken to err together, each at the same
quantile of its posterior. A spot's own ray counts wherever it is within the corridor.

What a flight remembers counts like the spots: points that are seen in the corridor are in the way,
whatever the map makes of them between others.

Between the spots a thing may stand that no range has met and that an image of few patterns does not
tell from what is behind: no probability is higher than these leave it, by that part of the
corridor's cross-section at which nothing has looked. What ranges have met, now or earlier in a
flight, has been looked at as far as it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Floats, Mask
from ..ranging.first_surface import EDGES_M, HALEY, MIN_LOG_SIGMA, FirstSurfaces
from .agreement import agrees
from .kriging import BRIGHT, AnchoredImage, LogDepth, fitted_prior
from .method import DepthEstimate, FreeTowards
from .obstacle import (
    ANYWHERE,
    CORRIDOR_M,
    DISTANCES_M,
    LOG_DISTANCES,
    Corridor,
    axes_along,
    corridor_prior,
    unit_in_view,
)

LEVELS = (np.arange(16) + 0.5) / 16
"""Quantiles at which the posteriors are taken."""
ALIKE = 0.2
"""Difference of ln range below which two levels share a map."""
SURE = 0.05
"""Relative sigma of the ranges of a level."""
UNSEEN = 0.12
"""Probability of a thing between the rays, of those cells of the corridor at which none has looked.
An assumption on the safe side, not a fit: neither brightness nor contrast tell people and poles
from what a scene has behind."""
UNSEEN_FROM_M, UNSEEN_TO_M = 0.7, 1.4
"""Distances between which it grows: nearer, what is an obstacle fills more than the image's
resolution and the corridor most of the view."""
WRONG = 0.7
"""Probability that a remembered point before all others is wrong: on drawn flights most that stand
alone there were."""
CELLS = 6
"""Cells across the corridor, each of `OBSTACLE_M2`."""


@dataclass(frozen=True, eq=False)
class SpotsAhead:
    """A frame's spots, at ``pixel`` (S, 2) along unit ``directions`` (S, 3), and its image."""

    surfaces: FirstSurfaces
    directions: Floats
    pixel: Floats
    image: Floats

    @cached_property
    def levels_m(self) -> Floats:
        """Ranges (L, S) at `LEVELS`."""
        return self.surfaces.quantiles_m(LEVELS)

    @property
    def met_m(self) -> Floats:
        """Points (N, 3) that the spots have probably met; those that met nothing look nowhere."""
        middle_m = self.levels_m[LEVELS.size // 2]
        met = np.isfinite(middle_m)
        return np.asarray(self.directions[met] * middle_m[met, None])

    def agree(self, estimate: DepthEstimate) -> Mask:
        """At which levels (L,) a map agrees with the spots."""
        with np.errstate(divide="ignore"):
            return agrees(estimate, self.pixel, np.log(self.levels_m * self.directions[:, 2]))

    def anchored(self, range_m: Floats) -> LogDepth | None:
        """The map anchored on ranges (S,), infinite where there is none; None without any."""
        depth_m = np.where(np.isfinite(range_m), range_m * self.directions[:, 2], np.nan)
        return self._anchored_image.log_depth(depth_m, SURE * depth_m)

    @cached_property
    def _anchored_image(self) -> AnchoredImage:
        reference = float(np.percentile(self.image, BRIGHT))
        lit = self.image if reference > 0 else np.ones_like(self.image)
        return AnchoredImage(lit, reference if reference > 0 else 1.0, self.pixel, fitted_prior())

    def free(self, direction: Floats) -> Floats:
        """Probability (K,) that no spot meets anything within a corridor, up to `DISTANCES_M`."""
        local = self.directions @ axes_along(direction)
        ends = EDGES_M[:, None, None] * local
        inside = (np.abs(ends[..., :2]).max(axis=-1) <= CORRIDOR_M / 2) & (ends[..., 2] > 0)
        nearer = np.cumsum(np.where(inside.T, self.surfaces.mass[:, :-1], 0), axis=1)
        blocked = [
            np.interp(DISTANCES_M, EDGES_M * max(along, 1e-3), each)
            for along, each in zip(local[:, 2], nearer, strict=True)
        ]
        return np.maximum(1 - np.max(blocked, axis=0), 0.0)


class CorridorPosterior:
    """Free corridors of one map, in any direction."""

    def __init__(
        self, estimate: DepthEstimate, of_map: FreeTowards | None, spots: SpotsAhead, rays: Floats
    ) -> None:
        self._of_map, self._spots, self._rays = of_map, spots, rays
        agree = spots.agree(estimate) if of_map is not None else np.zeros(LEVELS.size, bool)
        self._agreed = float(agree.mean())
        self._looked_m, self._remembered = spots.met_m, (np.zeros((0, 3)), np.zeros(0))
        if estimate.points_m is not None:
            self._looked_m = np.concatenate([self._looked_m, estimate.points_m])
            if estimate.points_log_sigma is not None:
                seen = np.isfinite(estimate.points_log_sigma)
                self._remembered = estimate.points_m[seen], estimate.points_log_sigma[seen]
        self._others = tuple(_grouped(spots, ~agree))

    def __call__(self, direction: ArrayLike) -> Floats:
        """Probability (K,) that a corridor in this direction is free up to each of `DISTANCES_M`.

        InputError if it leads out of view.
        """
        total = self.of_all_seen(direction)
        return np.minimum.accumulate(
            np.minimum(total, unseen_free(self._looked_m, unit_in_view(direction, self._rays)))
        )

    def of_all_seen(self, direction: ArrayLike) -> Floats:
        """The same but for what may stand between the rays."""
        along = unit_in_view(direction, self._rays)
        own = ANYWHERE if self._of_map is None else self._of_map(direction)
        total = self._agreed * own
        corridor, prior = Corridor(self._rays, along), corridor_prior("others")
        for weight, log_depth in self._others:
            if log_depth is None:
                total = total + weight * own
            else:
                sigma = log_depth.sigma()
                total = total + weight * corridor.free(np.exp(log_depth.mean), prior, sigma)
        of_rays = np.minimum(self._spots.free(along), remembered_free(*self._remembered, along))
        return np.minimum.accumulate(np.minimum(total, of_rays))


def remembered_free(points_m: Floats, log_sigma: Floats, direction: Floats) -> Floats:
    """Probability (K,) that no remembered point is in the corridor, up to `DISTANCES_M`.

    Parameters
    ----------
    points_m : array, (N, 3)
        Points that are seen.
    log_sigma : array, (N,)
        Standard deviations of their ln depth.
    direction : array, (3,)
        Unit vector of the corridor.
    """
    local_m = points_m @ axes_along(direction)
    inside = (np.abs(local_m[:, :2]).max(axis=1) <= CORRIDOR_M / 2) & (local_m[:, 2] > 0)
    away = LOG_DISTANCES[:, None] - np.log(local_m[inside, 2])
    sigma = np.fmax(log_sigma[inside], MIN_LOG_SIGMA)
    nearer = (0.5 + 0.5 * np.tanh(HALEY / 2 * away / sigma)).sum(axis=1)
    return np.asarray(WRONG**nearer)


def unseen_free(looked_m: Floats, direction: Floats) -> Floats:
    """Probability (K,) that nothing stands where no range has looked, up to `DISTANCES_M`.

    Parameters
    ----------
    looked_m : array, (N, 3)
        Points that ranges have met.
    direction : array, (3,)
        Unit vector of the corridor.
    """
    across_m, down_m, along_m = (looked_m @ axes_along(direction)).T
    ahead = along_m > 0
    part = DISTANCES_M[:, None] / along_m[ahead]  # of the way to each point
    cells = [
        np.floor((position_m[ahead] * part / CORRIDOR_M + 0.5) * CELLS).astype(int)
        for position_m in (across_m, down_m)
    ]
    looked = np.zeros((DISTANCES_M.size, CELLS, CELLS), dtype=bool)
    row, column = cells
    inside = (part <= 1) & np.all([(each >= 0) & (each < CELLS) for each in cells], axis=0)
    distance, ray = np.nonzero(inside)
    looked[distance, row[distance, ray], column[distance, ray]] = True
    unseen = 1 - looked.mean(axis=(1, 2))
    grown = np.log(DISTANCES_M / UNSEEN_FROM_M) / np.log(UNSEEN_TO_M / UNSEEN_FROM_M)
    return np.asarray(1 - UNSEEN * unseen * np.clip(grown, 0, 1))


def _grouped(spots: SpotsAhead, chosen: Mask) -> Iterator[tuple[float, LogDepth | None]]:
    """Maps of some levels (L,), and the fraction of the posterior that each stands for."""
    levels_m = spots.levels_m[chosen]
    start = 0
    while start < len(levels_m):
        with np.errstate(invalid="ignore"):
            apart = np.log(levels_m[start:] / levels_m[start])
        alike = (np.where(np.isnan(apart), 0, apart) < ALIKE).all(axis=1)  # nan: both infinite
        count = int(alike.sum())
        yield count / LEVELS.size, spots.anchored(levels_m[start + count // 2])
        start += count

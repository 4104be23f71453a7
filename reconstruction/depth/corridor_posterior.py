"""Free corridors by all that is not excluded.

A depth map speaks for that part of the posterior of its spots with which it agrees. For the rest,
the map anchored on these other ranges does: the spots are taken to err together, each at the same
quantile of its posterior. A spot's own ray counts wherever it is within the corridor.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Floats, Mask
from ..ranging.first_surface import EDGES_M, FirstSurfaces
from .kriging import BRIGHT, AnchoredImage, LogDepth, fitted_prior
from .method import DepthEstimate, FreeTowards
from .obstacle import ANYWHERE, CORRIDOR_M, DISTANCES_M, Corridor, axes_along, corridor_prior
from .pixels import around, between

LEVELS = (np.arange(16) + 0.5) / 16
"""Quantiles at which the posteriors are taken."""
MIN_SIGMA = 0.15
"""Minimum sigma of ln depth at a spot, between the spot and its pixel."""
MAX_AWAY = 4.0
"""Deviation beyond which a single spot speaks no louder, as on an edge."""
AGREE = 2.0
"""Maximum rms deviation of the spots from a map that agrees with them, in its sigmas."""
ALIKE = 0.2
"""Difference of ln range below which two levels share a map."""
SURE = 0.05
"""Relative sigma of the ranges of a level."""


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

    def agree(self, estimate: DepthEstimate) -> Mask:
        """At which levels (L,) a map agrees with the spots; where none has a range, it does."""
        log_depth = np.log(np.where(np.isfinite(estimate.depth_m), estimate.depth_m, EDGES_M[-1]))
        sigma = np.zeros_like(log_depth) if estimate.sigma is None else estimate.sigma
        sigma = np.where(np.isfinite(sigma), sigma, 0.0)
        of_map, of_sigma = (between(each, self.pixel) for each in (around(log_depth), sigma))
        with np.errstate(divide="ignore", invalid="ignore"):
            log_levels = np.log(self.levels_m * self.directions[:, 2])
        away = np.abs(log_levels - of_map) / np.hypot(of_sigma, MIN_SIGMA)
        usable = np.isfinite(log_levels)
        squares = np.where(usable, np.minimum(away, MAX_AWAY) ** 2, 0).sum(axis=1)
        return squares <= AGREE**2 * usable.sum(axis=1)

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
        self._others = tuple(_grouped(spots, ~agree))

    def __call__(self, direction: ArrayLike) -> Floats:
        """Probability (K,) that a corridor in this direction is free up to each of `DISTANCES_M`.

        InputError if it leads out of view.
        """
        own = ANYWHERE if self._of_map is None else self._of_map(direction)
        along = np.asarray(direction, dtype=np.float64)
        along = along / np.linalg.norm(along)
        total = self._agreed * own
        corridor, prior = Corridor(self._rays, along), corridor_prior("others")
        for weight, log_depth in self._others:
            if log_depth is None:
                total = total + weight * own
            else:
                sigma = log_depth.sigma()
                total = total + weight * corridor.free(np.exp(log_depth.mean), prior, sigma)
        return np.minimum.accumulate(np.minimum(total, self._spots.free(along)))


def _grouped(spots: SpotsAhead, chosen: Mask) -> Iterator[tuple[float, LogDepth | None]]:
    """Maps of some levels (L,), and the fraction of the posterior that each stands for."""
    levels_m = spots.levels_m[chosen]
    if not len(levels_m):
        return
    with np.errstate(invalid="ignore"):
        apart = np.abs(np.diff(np.log(levels_m), axis=0))
    apart = np.where(np.isnan(apart), 0, apart).max(axis=1, initial=0)  # both infinite
    starts = np.flatnonzero(np.append(True, apart > ALIKE))
    for start, end in zip(starts, [*starts[1:], len(levels_m)], strict=True):
        yield (end - start) / LEVELS.size, spots.anchored(levels_m[start])

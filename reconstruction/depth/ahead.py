"""Corridors in any direction: what a frame's map and the remembered points say of them together."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Floats
from ..base.errors import InputError
from .memory.obstacles import LocalPoints, free_of_met, met_in_corridor
from .method import DepthEstimate, FreeTowards
from .obstacle import FORWARD, Corridor, CorridorPrior, corridor_prior


@dataclass(frozen=True, eq=False)
class Ahead:
    """A map with all its pixels (H, W), its error model, and remembered points.

    ``rays`` are those of `pixel_rays`; ``left`` (H, W) is the fraction of the map's standard
    deviation that remembered points leave, None without any: the surer a corridor's depths, the
    surer its obstacle.
    """

    rays: Floats
    depth_m: Floats
    sigma: Floats | None
    no_return: Floats | None
    prior: CorridorPrior
    left: Floats | None = None
    points: LocalPoints | None = None

    def free(self, direction: ArrayLike = FORWARD) -> Floats:
        """Probability (K,) that a corridor is free up to each of `DISTANCES_M`.

        Parameters
        ----------
        direction
            Of the corridor, (3,) of any length: x right, y down, z forward. The corridor is
            `CORRIDOR_M` wide and high about it.

        Returns
        -------
        ndarray
            Never increasing.

        Raises
        ------
        InputError
            If it leads out of view: nothing is known there.
        """
        along = np.asarray(direction, dtype=np.float64)
        if along.shape != (3,) or not np.isfinite(along).all() or not along.any():
            raise InputError(
                f"direction = {along.tolist()}: three finite numbers are needed, not all zero"
            )
        along = along / np.linalg.norm(along)
        self._require_in_view(along)
        corridor = Corridor(self.rays, along)
        prior = (
            self.prior
            if self.left is None
            else self.prior.surer(corridor.mean_inside(self.depth_m, self.left))
        )
        free = corridor.free(self.depth_m, prior, self.sigma, self.no_return)
        return (
            free if self.points is None else free * free_of_met(met_in_corridor(self.points, along))
        )

    def _require_in_view(self, along: Floats) -> None:
        right, down = np.abs(self.rays[..., :2]).reshape(-1, 2).max(axis=0)
        if not (
            along[2] > 0 and abs(along[0]) <= right * along[2] and abs(along[1]) <= down * along[2]
        ):
            raise InputError(
                f"direction = {along.round(3).tolist()}: out of view; x / z is at most {right:.3g} "
                f"and y / z at most {down:.3g}, with z > 0"
            )


def corridors_of(estimate: DepthEstimate, rays: Floats | None) -> FreeTowards | None:
    """Probability of free corridors in any direction; None if a map has no depths, or rays.

    A method that states none has its corridors from its map, with an error model for any method.
    """
    known = estimate.free_towards is not None
    if known or rays is None or not np.isfinite(estimate.depth_m).any():
        return estimate.free_towards
    prior = corridor_prior("others")
    return Ahead(rays, estimate.depth_m, estimate.sigma, estimate.no_return, prior).free


def free_of_estimate(estimate: DepthEstimate, towards: FreeTowards | None) -> Floats | None:
    """Probability that the corridor along the optical axis is free, as stated or of the map."""
    return estimate.free if estimate.free is not None or towards is None else towards(FORWARD)

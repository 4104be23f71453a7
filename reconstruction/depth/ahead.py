"""Corridors in any direction: what a frame's map says of them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Floats
from ..base.errors import InputError
from .method import DepthEstimate, FreeTowards
from .obstacle import FORWARD, Corridor, CorridorPrior, corridor_prior


@dataclass(frozen=True, eq=False)
class Ahead:
    """A map with all its pixels (H, W), those of `pixel_rays`, and its error model."""

    rays: Floats
    depth_m: Floats
    sigma: Floats | None
    no_return: Floats | None
    prior: CorridorPrior

    @classmethod
    def of(cls, estimate: DepthEstimate, rays: Floats, prior: str) -> "Ahead":
        """What a map says by the error model of this name; see `corridor_prior`."""
        return cls(
            rays, estimate.depth_m, estimate.sigma, estimate.no_return, corridor_prior(prior)
        )

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
        return corridor.free(self.depth_m, self.prior, self.sigma, self.no_return)

    def _require_in_view(self, along: Floats) -> None:
        right, down = np.abs(self.rays[..., :2]).reshape(-1, 2).max(axis=0)
        x, y, z = along
        if not (z > 0 and abs(x) <= right * z and abs(y) <= down * z):
            raise InputError(
                f"direction = {along.round(3).tolist()}: out of view; x / z is at most {right:.3g} "
                f"and y / z at most {down:.3g}, with z > 0"
            )


def corridors_of(estimate: DepthEstimate, rays: Floats | None) -> FreeTowards | None:
    """Probability of free corridors in any direction; None if a map has no depths, or rays.

    A method that states none has its corridors from its map, with an error model for any method.
    That along the optical axis is as stated.
    """
    towards = estimate.free_towards
    if towards is None and rays is not None and np.isfinite(estimate.depth_m).any():
        towards = Ahead.of(estimate, rays, "others").free
    if estimate.free is None:
        return towards
    ahead, others = estimate.free, towards

    def stated(direction: ArrayLike) -> Floats:
        forward = np.shape(direction) == (3,) and not np.any(np.asarray(direction)[:2])
        return others(direction) if others is not None and not forward else ahead

    return stated

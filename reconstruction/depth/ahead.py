"""Corridors in any direction: what a frame's map says of them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Floats
from ..base.errors import InputError
from .method import DepthEstimate, FreeTowards
from .obstacle import FORWARD, Corridor, CorridorPrior, corridor_prior, unit_in_view


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
        corridor = Corridor(self.rays, unit_in_view(direction, self.rays))
        return corridor.free(self.depth_m, self.prior, self.sigma, self.no_return)


@dataclass(frozen=True, eq=False)
class Stated:
    """Corridors of a method that states the probability along the optical axis.

    Those in other directions are by ``others``, if known.
    """

    ahead: Floats
    others: FreeTowards | None

    def __call__(self, direction: ArrayLike) -> Floats:
        """Probability (K,) of a direction (3,); InputError if nothing is known of it."""
        along = np.asarray(direction, dtype=np.float64)
        if along.shape == (3,) and along[2] > 0 and not along[:2].any():
            return self.ahead
        if self.others is None:
            raise InputError(f"direction = {along.tolist()}: only that along [0, 0, 1] is known")
        return self.others(direction)


def corridors_of(estimate: DepthEstimate, rays: Floats | None) -> FreeTowards | None:
    """Probability of free corridors in any direction; None if a map has no depths, or rays.

    A method that states none has its corridors from its map, with an error model for any method.
    That along the optical axis is as stated.
    """
    towards = estimate.free_towards
    if towards is None and rays is not None and np.isfinite(estimate.depth_m).any():
        towards = Ahead.of(estimate, rays, "others").free
    return towards if estimate.free is None else Stated(estimate.free, towards)

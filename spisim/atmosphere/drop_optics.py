"""What single drops and flakes do with the light that meets them.

They are many times larger than the wavelength, and half of their extinction is diffraction, which
goes on within 1.22 λ/D of its direction: 2 mrad for 1 mm at 1550 nm. A virtual pixel is wider than
that, and so is the field of any detector here: diffracted light is not lost. What is left is the
disc that a drop shows, Q = 1; its light is absorbed, or scattered into wide angles.
"""

from dataclasses import dataclass
from functools import cache
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.atmosphere.phase import Phase, henyey_greenstein
from spisim.atmosphere.rain_table import EDGES_MM, rain_table, solid_angle_weights

#: Diffraction of the smallest drops reaches so far.
FORWARD_DEG = 8.0


class Scatterer(Protocol):
    """Where the light goes that meets a disc of some diameter."""

    def albedo(self, diameter_mm: ArrayLike) -> Floats:
        """Share that is scattered, not absorbed."""

    def scattered_per_sr(self, cos: ArrayLike, diameter_mm: ArrayLike) -> Floats:
        """Share per steradian scattered by an angle of this cosine; the albedo over the sphere."""


class WaterDrops:
    """Spheres of water, by the size classes of `rain_table`.

    Water absorbs 1550 nm within 0.9 mm, so large drops send back little but what their surface
    reflects; at 905 nm they are clear. Linear in the logarithm of the diameter and in the angle;
    beyond the middles of the table's outer classes, 0.11 and 5.5 mm, their values hold. Light
    scattered by less than `FORWARD_DEG`, which neither comes back nor leaves the beam by much, is
    what the other angles leave of the albedo, and even.
    """

    def __init__(self, wavelength_nm: float) -> None:
        table = rain_table(wavelength_nm)
        scattered = table.extinction * table.albedo * (1 - table.diffracted)
        self._log_diameters = np.log(EDGES_MM[:-1] * EDGES_MM[1:]) / 2
        self._angles = np.radians(table.angles_deg)
        self._albedo = 1 - table.extinction * (1 - table.albedo)
        self._table = scattered[:, None] * table.phase
        weights, forward = solid_angle_weights(table.angles_deg), table.angles_deg <= FORWARD_DEG
        rest = self._albedo - self._table[:, ~forward] @ weights[~forward]
        self._table[:, forward] = rest[:, None] / weights[forward].sum()

    def albedo(self, diameter_mm: ArrayLike) -> Floats:
        """See `Scatterer`."""
        row, part = _place(np.log(diameter_mm), self._log_diameters)
        return np.asarray((1 - part) * self._albedo[row] + part * self._albedo[row + 1])

    def scattered_per_sr(self, cos: ArrayLike, diameter_mm: ArrayLike) -> Floats:
        """See `Scatterer`."""
        row, part = _place(np.log(diameter_mm), self._log_diameters)
        column, across = _place(np.arccos(np.clip(cos, -1, 1)), self._angles)

        def at(rows: NDArray[np.intp]) -> Floats:
            left, right = self._table[rows, column], self._table[rows, column + 1]
            return np.asarray((1 - across) * left + across * right)

        return np.asarray((1 - part) * at(row) + part * at(row + 1))


def _place(values: ArrayLike, nodes: Floats) -> tuple[NDArray[np.intp], Floats]:
    """Node below each value, and how far it is to the next; the ends hold."""
    at = np.asarray(values)
    below = np.clip(np.searchsorted(nodes, at, side="right") - 1, 0, len(nodes) - 2)
    return below, np.clip((at - nodes[below]) / (nodes[below + 1] - nodes[below]), 0, 1)


@cache
def water_drops(wavelength_nm: float = 1550.0) -> WaterDrops:
    """Drops of rain. InputError for a wavelength that rain is not tabulated at."""
    return WaterDrops(wavelength_nm)


@dataclass(frozen=True)
class Flakes:
    """Discs that scatter the share `fraction` of their light with one phase function, at any size.

    No measurement at 1550 nm stands behind it: ice absorbs three times as strongly as water, and
    flakes are rough and full of surfaces.
    """

    fraction: float
    phase: Phase

    def albedo(self, diameter_mm: ArrayLike) -> Floats:
        """See `Scatterer`."""
        return np.full(np.shape(diameter_mm), self.fraction)

    def scattered_per_sr(self, cos: ArrayLike, diameter_mm: ArrayLike) -> Floats:
        """See `Scatterer`."""
        shape = np.broadcast_shapes(np.shape(cos), np.shape(diameter_mm))
        return np.broadcast_to(self.fraction * self.phase.density(cos), shape)


def flakes(albedo: float, g: float) -> Flakes:
    """Flakes with a Henyey-Greenstein phase function.

    Raises InputError unless 0 ≤ albedo ≤ 1 and -1 < g < 1.
    """
    if not 0 <= albedo <= 1:
        raise InputError(f"albedo should lie between 0 and 1; found {albedo}")
    return Flakes(albedo, henyey_greenstein(g))

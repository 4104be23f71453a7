"""Scattering by single raindrops and snowflakes.

They are much larger than the wavelength, so half of their extinction is diffraction into a cone of
1.22 λ/D: 2 mrad for 1 mm at 1550 nm. Every virtual pixel and detector here is wider, so diffracted
light is not lost. What remains is the geometric disc, Q = 1: its light is absorbed, or scattered at
wide angles.
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

#: Angle up to which the smallest drops diffract.
FORWARD_DEG = 8.0


class Scatterer(Protocol):
    """Scattering of the light on a disc of some diameter."""

    def albedo(self, diameter_mm: ArrayLike) -> Floats:
        """Fraction that is scattered, not absorbed."""

    def scattered_per_sr(self, cos: ArrayLike, diameter_mm: ArrayLike) -> Floats:
        """Fraction scattered per steradian at this cosine; integrates to the albedo."""


class WaterDrops:
    """Water spheres, by the size classes of `rain_table`.

    Water absorbs 1550 nm within 0.9 mm, so large drops return little but surface reflection; at
    905 nm they are clear. Values are linear in the logarithm of the diameter and in the angle, and
    constant beyond the middles of the outer classes, 0.11 and 5.5 mm. Below `FORWARD_DEG`, where
    light neither returns nor leaves the beam, the rest of the albedo is spread uniformly.
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
        row, part = _bracket(np.log(diameter_mm), self._log_diameters)
        return np.asarray((1 - part) * self._albedo[row] + part * self._albedo[row + 1])

    def scattered_per_sr(self, cos: ArrayLike, diameter_mm: ArrayLike) -> Floats:
        """See `Scatterer`."""
        row, part = _bracket(np.log(diameter_mm), self._log_diameters)
        column, across = _bracket(np.arccos(np.clip(cos, -1, 1)), self._angles)

        def at(rows: NDArray[np.intp]) -> Floats:
            left, right = self._table[rows, column], self._table[rows, column + 1]
            return np.asarray((1 - across) * left + across * right)

        return np.asarray((1 - part) * at(row) + part * at(row + 1))


def _bracket(values: ArrayLike, nodes: Floats) -> tuple[NDArray[np.intp], Floats]:
    """Index of the node below each value, and the fraction to the next, clipped at the ends."""
    at = np.asarray(values)
    below = np.clip(np.searchsorted(nodes, at, side="right") - 1, 0, len(nodes) - 2)
    return below, np.clip((at - nodes[below]) / (nodes[below + 1] - nodes[below]), 0, 1)


@cache
def water_drops(wavelength_nm: float = 1550.0) -> WaterDrops:
    """Raindrops; InputError for a wavelength that rain is not tabulated at."""
    return WaterDrops(wavelength_nm)


@dataclass(frozen=True)
class Flakes:
    """Discs of any size with albedo `fraction` and one phase function.

    Assumed, not measured at 1550 nm: ice absorbs three times as strongly as water, and flakes are
    rough and full of surfaces.
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
    """Flakes with a Henyey-Greenstein phase; InputError unless 0 ≤ albedo ≤ 1, -1 < g < 1."""
    if not 0 <= albedo <= 1:
        raise InputError(f"albedo should lie between 0 and 1; found {albedo}")
    return Flakes(albedo, henyey_greenstein(g))

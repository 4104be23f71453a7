"""What single drops and flakes do with the light that meets them.

They are many times larger than the wavelength, and half of their extinction is diffraction, which
goes on within 1.22 λ/D of its direction: 2 mrad for 1 mm at 1550 nm. A virtual pixel is wider than
that, and so is the field of any detector here: diffracted light is not lost. What is left is the
disc that a drop shows, Q = 1; its light is absorbed, or scattered into wide angles.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reconstruction.errors import InputError
from spisim.atmosphere.drop_table import ANGLES, FINE_DEG, TABLE
from spisim.atmosphere.phase import Phase, henyey_greenstein

Floats = NDArray[np.float64]


class Scatterer(Protocol):
    """Where the light goes that meets a disc of some diameter."""

    def albedo(self, diameter_mm: ArrayLike) -> Floats:
        """Share that is scattered, not absorbed."""
        ...

    def scattered_per_sr(self, cos: ArrayLike, diameter_mm: ArrayLike) -> Floats:
        """Share per steradian scattered by an angle of this cosine; the albedo over the sphere."""
        ...


class WaterDrops:
    """Spheres of water at 1550 nm, from a table of Mie theory (see `drop_table`).

    Water absorbs within 0.9 mm, so large drops send back little but what their surface reflects.
    Linear in the logarithm of the diameter; beyond the table, 0.1 to 8 mm, its ends hold.
    """

    def __init__(self) -> None:
        with np.load(TABLE) as table:
            self._log_diameters = np.log(table["diameters_mm"])
            angles = table["angles_from_back_rad"]
            self._table = table["scattered_per_sr"].astype(np.float64)
        ring = 2 * np.pi * self._table * np.sin(angles)
        self._albedo = np.trapezoid(ring, angles, axis=1)

    def albedo(self, diameter_mm: ArrayLike) -> Floats:
        """See `Scatterer`."""
        row, part = self._row(diameter_mm)
        return np.asarray((1 - part) * self._albedo[row] + part * self._albedo[row + 1])

    def scattered_per_sr(self, cos: ArrayLike, diameter_mm: ArrayLike) -> Floats:
        """See `Scatterer`."""
        row, part = self._row(diameter_mm)
        from_back_deg = np.degrees(np.arccos(np.clip(np.negative(cos), -1, 1)))
        place = np.arcsinh(from_back_deg / FINE_DEG) / np.arcsinh(180 / FINE_DEG) * (ANGLES - 1)
        column = np.clip(place.astype(np.intp), 0, ANGLES - 2)
        across = place - column

        def at(rows: NDArray[np.intp]) -> Floats:
            left, right = self._table[rows, column], self._table[rows, column + 1]
            return np.asarray((1 - across) * left + across * right)

        return np.asarray((1 - part) * at(row) + part * at(row + 1))

    def _row(self, diameter_mm: ArrayLike) -> tuple[NDArray[np.intp], Floats]:
        """Row below each diameter, and how far it is to the next."""
        logs = self._log_diameters
        place = (np.log(diameter_mm) - logs[0]) / (logs[1] - logs[0])
        row = np.clip(place.astype(np.intp), 0, len(logs) - 2)
        return row, np.clip(place - row, 0, 1)


@cache
def water_drops() -> WaterDrops:
    """The table, read once."""
    return WaterDrops()


@dataclass(frozen=True)
class Flakes:
    """Discs that scatter the share `share` of their light with one phase function, at any size.

    No measurement at 1550 nm stands behind it: ice absorbs three times as strongly as water, and
    flakes are rough and full of surfaces.
    """

    share: float
    phase: Phase

    def albedo(self, diameter_mm: ArrayLike) -> Floats:
        """See `Scatterer`."""
        return np.full(np.shape(diameter_mm), self.share)

    def scattered_per_sr(self, cos: ArrayLike, diameter_mm: ArrayLike) -> Floats:
        """See `Scatterer`."""
        shape = np.broadcast_shapes(np.shape(cos), np.shape(diameter_mm))
        return np.broadcast_to(self.share * self.phase.density(cos), shape)


def flakes(albedo: float, g: float) -> Flakes:
    """Flakes with a Henyey-Greenstein phase function.

    Raises InputError unless 0 ≤ albedo ≤ 1 and -1 < g < 1.
    """
    if not 0 <= albedo <= 1:
        raise InputError(f"albedo should lie between 0 and 1; found {albedo}")
    return Flakes(albedo, henyey_greenstein(g))

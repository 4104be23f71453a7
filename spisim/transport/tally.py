"""What the light paths are summed into: images, phasors, histograms, cubes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy.constants import c

from spisim.transport.accumulator import Accumulator
from spisim.transport.views import Floats
from spisim.transport.walk import Contribution

#: Parts that the light can be split into, by how often it was scattered in fog.
ORDERS = ("unscattered", "single", "multiple")


class Tally(Protocol):
    """Sums contributions over one launch."""

    def add(self, light: Contribution) -> None:
        """Take one contribution per lane."""
        ...

    def read(self) -> Mapping[str, Floats]:
        """Named sums, per unit detector area."""
        ...


class ImageTally:
    """Transport per cell: `image` (cells,)."""

    def __init__(self, cells: int) -> None:
        self._sum = Accumulator(cells)

    def add(self, light: Contribution) -> None:
        """See `Tally`."""
        self._sum.add(light.value, light.cell, light.active)

    def read(self) -> Mapping[str, Floats]:
        """See `Tally`."""
        return {"image": self._sum.read()}


class OrderTally:
    """Transport per cell and order of scattering: `orders` (3, cells)."""

    def __init__(self, cells: int) -> None:
        self._cells = cells
        self._sum = Accumulator(len(ORDERS) * cells)

    def add(self, light: Contribution) -> None:
        """See `Tally`."""
        order = dr.minimum(light.scatterings, len(ORDERS) - 1)
        self._sum.add(light.value, order * self._cells + light.cell, light.active)

    def read(self) -> Mapping[str, Floats]:
        """See `Tally`."""
        return {"orders": self._sum.read().reshape(len(ORDERS), self._cells)}


class PhasorTally:
    """Σ value · exp(2πi f L / c) per frequency and cell: `phasors` (F, 2, cells), real and imag."""

    def __init__(self, cells: int, frequencies_hz: Sequence[float]) -> None:
        self._cells = cells
        self._wave_numbers = [
            dr.opaque(mi.Float, 2 * np.pi * frequency / c) for frequency in frequencies_hz
        ]
        self._sum = Accumulator(2 * len(frequencies_hz) * cells)

    def add(self, light: Contribution) -> None:
        """See `Tally`."""
        for number, wave_number in enumerate(self._wave_numbers):
            sine, cosine = dr.sincos(wave_number * light.length_m)
            row = 2 * number * self._cells + light.cell
            self._sum.add(light.value * cosine, row, light.active)
            self._sum.add(light.value * sine, row + self._cells, light.active)

    def read(self) -> Mapping[str, Floats]:
        """See `Tally`."""
        return {"phasors": self._sum.read().reshape(len(self._wave_numbers), 2, self._cells)}


@dataclass(frozen=True)
class PathLengthBins:
    """`count` bins; bin k is centred on the optical path length k · `width_m`."""

    count: int
    width_m: float

    @property
    def centres_m(self) -> Floats:
        """Path lengths (bins,)."""
        return np.arange(self.count, dtype=np.float64) * self.width_m


class HistogramTally:
    """Transport per cell and path length: `histogram` (cells, bins).

    A contribution is shared between its two neighbouring bins so that its path length is kept
    exactly; what is longer than the last bin is counted there.
    """

    def __init__(self, cells: int, bins: PathLengthBins) -> None:
        self._cells, self._bins = cells, bins
        self._sum = Accumulator(cells * bins.count)

    def add(self, light: Contribution) -> None:
        """See `Tally`."""
        count = self._bins.count
        place = dr.minimum(light.length_m / self._bins.width_m, count - 1)
        low = dr.minimum(mi.UInt32(place), count - 2)
        upper = place - mi.Float(low)
        cell = light.cell * count + low
        self._sum.add(light.value * (1 - upper), cell, light.active)
        self._sum.add(light.value * upper, cell + 1, light.active)

    def read(self) -> Mapping[str, Floats]:
        """See `Tally`."""
        return {"histogram": self._sum.read().reshape(self._cells, self._bins.count)}

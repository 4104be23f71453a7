"""Tallies that sum the light of paths: images, phasors, histograms, cubes."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol, Self

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy.constants import c

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.transport.engine.accumulator import Accumulator, Check
from spisim.transport.jit import Bool, Float, UInt
from spisim.transport.scores import NO_SCORES, Scores

#: Parts that the light can be split into, by the number of scatterings in fog.
ORDERS = ("unscattered", "single", "multiple")


class Contribution(NamedTuple):
    """Light between the two ends, as one vertex contributes it."""

    value: Float
    cell: UInt
    length_m: Float  # whole optical path
    scatterings: UInt  # in fog, along the whole path
    active: Bool
    replica: UInt  # index of the replica that it belongs to
    scores: Scores = NO_SCORES


Deposit = Callable[[Contribution], None]


def carries_light(value: Float) -> Bool:
    """Lanes with light, nan included, so that it is counted in the end."""
    return ~(value <= 0)


class Sums(NamedTuple):
    """Sums of one launch: those of each of its independent replicas, in turn."""

    values: Iterable[Mapping[str, Floats]]
    dropped: int = 0  # contributions that were not finite and are left out


class Tally(Protocol):
    """Sums the contributions of one launch; its cells are those of all replicas in turn."""

    def add(self, light: Contribution) -> None:
        """Add one contribution per lane."""

    def read(self, part: int, parts: int) -> Mapping[str, Floats]:
        """Named sums (cells, ...), per unit detector area, of one of so many parts of the cells."""


#: From the number of cells to a tally of them.
MakeTally = Callable[[int], Tally]


class ImageTally:
    """Transport per cell: `image` (cells,)."""

    def __init__(self, cells: int) -> None:
        self._sum = Accumulator(cells)

    def add(self, light: Contribution) -> None:
        self._sum.add(light.value, light.cell, light.active)

    def read(self, part: int, parts: int) -> Mapping[str, Floats]:
        return {"image": self._sum.read(part, parts)}


class PhasorTally:
    """Σ value · exp(2πi f L / c) per cell and frequency: `phasors` (cells, F, 2), real and imag."""

    def __init__(self, cells: int, frequencies_hz: Sequence[float]) -> None:
        self._wave_numbers = [
            dr.opaque(mi.Float, 2 * np.pi * frequency / c) for frequency in frequencies_hz
        ]
        self._sum = Accumulator(2 * len(frequencies_hz) * cells)

    def add(self, light: Contribution) -> None:
        for number, wave_number in enumerate(self._wave_numbers):
            sine, cosine = dr.sincos(wave_number * light.length_m)
            index = 2 * (light.cell * len(self._wave_numbers) + number)
            self._sum.add(light.value * cosine, index, light.active)
            self._sum.add(light.value * sine, index + 1, light.active)

    def read(self, part: int, parts: int) -> Mapping[str, Floats]:
        return {"phasors": self._sum.read(part, parts).reshape(-1, len(self._wave_numbers), 2)}


@dataclass(frozen=True)
class PathLengthBins:
    """Bins of the optical path length, fine near by and coarser beyond.

    Parameters
    ----------
    near
        Number of equal bins; bin k is centred on k · `width_m`. At least 2.
    width_m
        Width of the equal bins, m.
    far_m
        Centres of the bins beyond, m, ascending with any spacing.

    Raises
    ------
    InputError
        If there are fewer than two bins, or the width is not positive.
    """

    near: int
    width_m: float
    far_m: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not 0 < self.width_m < np.inf:
            raise InputError(f"width_m {self.width_m:g}: a bin's width must be positive and finite")
        if self.near < 2:
            raise InputError(f"near {self.near}: at least 2 path-length bins are required")

    @classmethod
    def up_to(cls, longest_m: float, width_m: float) -> Self:
        """Bins for path lengths from 0 to `longest_m`."""
        return cls(round(longest_m / width_m) + 1 if width_m > 0 else 0, width_m)

    @property
    def count(self) -> int:
        """Number of bins."""
        return self.near + len(self.far_m)

    @property
    def centres_m(self) -> Floats:
        """Path lengths (bins,), m."""
        return np.append(np.arange(self.near) * self.width_m, self.far_m)


class HistogramTally:
    """Transport per cell and path length: `histogram` (cells, bins).

    A contribution is split between its two neighbouring bins so that its mean path length is exact.
    Light beyond the last bin is counted in the last bin.
    """

    def __init__(self, cells: int, bins: PathLengthBins) -> None:
        self._bins = bins
        self._count = dr.opaque(mi.UInt32, bins.count)  # opaque: one kernel for any number
        self._sum = Accumulator(cells * bins.count)
        if bins.far_m:
            starts = np.append((bins.near - 1) * bins.width_m, bins.far_m)
            size = 1 << len(bins.far_m).bit_length()  # longer than needed: padded with infinity
            self._starts = mi.Float(np.pad(np.float32(starts), (0, size), constant_values=np.inf))
            self._last = dr.opaque(mi.UInt32, len(bins.far_m) - 1)
            self._size = size

    def add(self, light: Contribution) -> None:
        near = self._bins.near
        bin_ = dr.minimum(light.length_m / self._bins.width_m, near - 1)
        low = dr.minimum(mi.UInt32(bin_), near - 2)
        upper = bin_ - mi.Float(low)
        if self._bins.far_m:
            beyond = light.active & (light.length_m > (near - 1) * self._bins.width_m)
            between, fraction = self._far(light.length_m, beyond)
            low, upper = dr.select(beyond, between, low), dr.select(beyond, fraction, upper)
        cell = light.cell * self._count + low
        self._sum.add(light.value * (1 - upper), cell, light.active)
        self._sum.add(light.value * upper, cell + 1, light.active)

    def _far(self, length_m: Float, active: Bool) -> tuple[UInt, Float]:
        """The bin below a path length beyond the near ones, and the fraction to the next bin."""
        above = dr.binary_search(
            0, self._size, lambda bin_: dr.gather(mi.Float, self._starts, bin_, active) <= length_m
        )
        low = dr.minimum(mi.UInt32(above) - 1, self._last)
        start = dr.gather(mi.Float, self._starts, low, active)
        stop = dr.gather(mi.Float, self._starts, low + 1, active)
        return low + (self._bins.near - 1), dr.minimum((length_m - start) / (stop - start), 1)

    def read(self, part: int, parts: int) -> Mapping[str, Floats]:
        return {"histogram": self._sum.read(part, parts).reshape(-1, self._bins.count)}


class OrderTally:
    """Another tally split by how often the light was scattered in fog.

    Each of its sums is followed by `<name>_orders` (3, cells, ...), its parts in the order of
    `ORDERS`.
    """

    def __init__(self, cells: int, make: MakeTally) -> None:
        self._cells = cells
        self._parts = make(len(ORDERS) * cells)

    def add(self, light: Contribution) -> None:
        order = dr.minimum(light.scatterings, len(ORDERS) - 1)
        self._parts.add(light._replace(cell=order * self._cells + light.cell))

    def read(self, part: int, parts: int) -> Mapping[str, Floats]:
        orders = range(len(ORDERS))
        read = [self._parts.read(order * parts + part, len(ORDERS) * parts) for order in orders]
        split = {name: np.stack([each[name] for each in read]) for name in read[0]}
        whole = {name: values.sum(axis=0) for name, values in split.items()}
        return whole | {f"{name}_orders": values for name, values in split.items()}


class Tallies:
    """All tallies of one launch, behind a check of what can be summed."""

    def __init__(
        self, cells: int, kinds: Sequence[MakeTally], replicas: int = 1, *, weighted: bool = False
    ) -> None:
        self._cells, self._replicas, self._weighted = cells, replicas, weighted
        self._tallies = [kind(replicas * cells) for kind in kinds]
        self._check = Check(replicas * cells)

    def add(self, light: Contribution) -> None:
        cell = light.cell + light.replica * self._cells
        passed = self._check.passed(light.value, light.length_m, cell, light.active)
        for tally in self._tallies:
            tally.add(light._replace(cell=cell, active=passed))

    def read(self, area_m2: float) -> Sums:
        """Sums over detectors of this area; InputError if a sum is too large to be exact."""
        dropped = self._check.read(weighted=self._weighted)
        return Sums(self._values(area_m2), dropped)

    def _values(self, area_m2: float) -> Iterator[Mapping[str, Floats]]:
        """Sums of each replica, one at a time: histograms of many detectors are large."""
        for replica in range(self._replicas):
            sums = (tally.read(replica, self._replicas) for tally in self._tallies)
            values = {name: value for one in sums for name, value in one.items()}
            for value in values.values():
                value *= area_m2
            yield values

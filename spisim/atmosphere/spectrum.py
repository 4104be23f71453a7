"""Measured spectra of droplets and drops, from files, and what their counts leave unsure.

A CSV file names its columns, with units, in its first line. Two columns are a spectrum: diameters
of the classes (``diameter_um`` or ``diameter_mm``), and ``counts``, a number per volume of air in
each class (``number_per_cm3``, ``number_per_m3``) or one over the width of the class as well
(``number_per_cm3_um``, ``number_per_m3_mm``). A disdrometer's file has a line for each drop:
``time_s``, ``diameter_mm``, ``fall_speed_m_s`` and ``measuring_area_mm2``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.base.config.files import read_columns
from spisim.base.config.reading import read_text

DIAMETERS = {"diameter_um": 1.0, "diameter_mm": 1e3}  # in µm
#: Numbers per cm³ of air, and whether a column holds them over the width of its class.
NUMBERS = {
    "counts": (math.nan, False),
    "number_per_cm3": (1.0, False),
    "number_per_m3": (1e-6, False),
    "number_per_cm3_um": (1.0, True),
    "number_per_m3_mm": (1e-9, True),
}
DROPS = ("time_s", "diameter_mm", "fall_speed_m_s", "measuring_area_mm2")
#: Largest diameters, in µm, that a spectrum of droplets, and of drops, may end with.
DROPLETS_UM, DROPS_UM = (0.05, 600.0), (200.0, 1e4)
#: Clouds hold up to 5 g/m³ of water, the densest smoke some tens.
MAX_WATER_G_PER_M3 = 100.0
#: Classes into which single drops are counted, per factor of 10 of diameter.
CLASSES_PER_DECADE = 20
#: By how much the outer classes reach beyond the outer drops.
EDGE = 1.001
MM3_PER_CM3 = 1e3


@dataclass(frozen=True)
class SpectrumSizes:
    """Numbers of droplets in classes of diameter.

    Parameters
    ----------
    edges_um : tuple of float
        Diameters between the classes (classes + 1).
    numbers : tuple of float
        In each class, per cm³ of air if ``absolute``.
    counts : tuple of float, optional
        How many were counted, for the uncertainty; None if the file does not tell.
    absolute : bool
        Whether the numbers are per cm³.
    """

    edges_um: tuple[float, ...]
    numbers: tuple[float, ...]
    counts: tuple[float, ...] | None = None
    absolute: bool = False

    @property
    def diameters_um(self) -> Floats:
        """Middles of the classes (classes,), geometric."""
        edges = np.array(self.edges_um)
        return np.sqrt(edges[:-1] * edges[1:])

    @property
    def number_per_cm3(self) -> float | None:
        """Of all droplets; None if it is not known."""
        return math.fsum(self.numbers) if self.absolute else None

    @property
    def sigma(self) -> Floats | None:
        """Poisson's sigma of the numbers (classes,); None if it is not known."""
        if self.counts is None:
            return None
        return np.array(self.numbers) / np.sqrt(np.maximum(self.counts, 1.0))

    def density(self, radius_um: Floats) -> Floats:
        """Fraction of droplets per µm of radius, constant within a class; its integral is 1."""
        edges = np.array(self.edges_um) / 2
        height = np.array(self.numbers) / (math.fsum(self.numbers) * np.diff(edges))
        index = np.searchsorted(edges, radius_um, side="right") - 1
        inside = (index >= 0) & (index < height.size)
        return np.where(inside, height[np.clip(index, 0, height.size - 1)], 0.0)

    def moment(self, power: float) -> float:
        """Mean of radius^power, µm^power."""
        edges = np.array(self.edges_um) / 2
        means = np.diff(edges ** (power + 1)) / ((power + 1) * np.diff(edges))
        return float(np.average(means, weights=self.numbers))

    def radius_range_um(self) -> tuple[float, float]:
        """Radii that hold all droplets."""
        held = np.flatnonzero(self.numbers)
        return self.edges_um[held[0]] / 2, self.edges_um[held[-1] + 1] / 2


def read_droplets(path: Path, sampled_cm3: float | None = None) -> SpectrumSizes:
    """Spectrum of fog droplets or smoke particles from a file.

    Parameters
    ----------
    path : Path
        CSV file whose first line names the columns.
    sampled_cm3 : float, optional
        Air in which the droplets were counted. With it, counts give numbers and numbers give
        counts; without it, a spectrum of numbers has no uncertainty, and counts have no number.

    Raises
    ------
    InputError
        For another file, negative numbers, diameters out of order, and units that are wrong by
        10³.
    """
    spectrum = _read_spectrum(path, sampled_cm3, DROPLETS_UM)
    _check_water(path, spectrum)
    return spectrum


def read_drops(path: Path) -> SpectrumSizes:
    """Spectrum of raindrops, from a spectrum or the single drops of a disdrometer.

    InputError as `read_droplets`, and for single drops without speed or area.
    """
    names = _names(path)
    if not set(DROPS) <= set(names):
        spectrum = _read_spectrum(path, None, DROPS_UM)
    else:
        columns = dict(zip(names, read_columns(path).T, strict=True))
        spectrum = _of_single_drops(path, *(columns[name] for name in DROPS))
    _check_water(path, spectrum)
    return spectrum


def _names(path: Path) -> list[str]:
    read_columns(path)  # says what else is wrong with it
    first = read_text(path, "a spectrum in CSV").partition("\n")[0]
    return [name.strip() for name in first.split(",")]


def _read_spectrum(
    path: Path, sampled_cm3: float | None, largest_um: tuple[float, float]
) -> SpectrumSizes:
    names = _names(path)
    if len(names) != 2 or names[0] not in DIAMETERS or names[1] not in NUMBERS:
        raise InputError(
            f"spectrum {path.name!r}: its first line should name two columns, "
            f"{' or '.join(DIAMETERS)}, and one of {', '.join(NUMBERS)}; or it is a disdrometer's, "
            f"with {', '.join(DROPS)}"
        )
    diameter, given = read_columns(path).T
    _check_columns(path, diameter, given, names)
    diameter_um = DIAMETERS[names[0]] * diameter
    _check_unit(path, diameter_um, names[0], largest_um)
    edges_um = _edges(diameter_um)
    per_cm3, is_density = NUMBERS[names[1]]
    numbers = given * (np.diff(edges_um) if is_density else 1.0)
    if names[1] == "counts":
        counts, numbers = given, given / (sampled_cm3 or 1.0)
        return _sizes(edges_um, numbers, counts, absolute=sampled_cm3 is not None)
    numbers = numbers * per_cm3
    return _sizes(edges_um, numbers, None if sampled_cm3 is None else numbers * sampled_cm3)


def _sizes(
    edges_um: Floats, numbers: Floats, counts: Floats | None, *, absolute: bool = True
) -> SpectrumSizes:
    counted = None if counts is None else tuple(counts.tolist())
    return SpectrumSizes(tuple(edges_um.tolist()), tuple(numbers.tolist()), counted, absolute)


def _edges(diameter_um: Floats) -> Floats:
    """Between neighbours, at their geometric mean; the outer classes are symmetric."""
    inner = np.sqrt(diameter_um[:-1] * diameter_um[1:])
    first, last = diameter_um[0] ** 2 / inner[0], diameter_um[-1] ** 2 / inner[-1]
    return np.concatenate([[first], inner, [last]])


def _of_single_drops(
    path: Path, time_s: Floats, diameter_mm: Floats, speed_m_s: Floats, area_mm2: Floats
) -> SpectrumSizes:
    for name, values in zip(DROPS[1:], (diameter_mm, speed_m_s, area_mm2), strict=True):
        if not (values > 0).all():
            line = int(np.argmin(values > 0))
            raise InputError(
                f"drops {path.name!r}: {name} of drop {line + 1} should be greater than 0; found "
                f"{values[line]:g}"
            )
    duration_s = float(np.ptp(time_s))
    if duration_s <= 0:
        raise InputError(f"drops {path.name!r}: time_s should span more than a moment")
    _check_unit(path, np.sort(1e3 * diameter_mm), "diameter_mm", DROPS_UM)
    low, high = np.log10([1e3 * diameter_mm.min() / EDGE, 1e3 * diameter_mm.max() * EDGE])
    classes = max(int(np.ceil((high - low) * CLASSES_PER_DECADE)), 1)
    edges_um = np.logspace(low, high, classes + 1)
    # Each drop stands for the air that fell through its area in the time, mm³.
    per_cm3 = MM3_PER_CM3 / (area_mm2 * 1e3 * speed_m_s * duration_s)
    numbers = np.histogram(1e3 * diameter_mm, edges_um, weights=per_cm3)[0]
    squares = np.histogram(1e3 * diameter_mm, edges_um, weights=per_cm3**2)[0]
    counts = np.divide(numbers**2, squares, out=np.zeros(classes), where=squares > 0)
    return _sizes(edges_um, numbers, counts)


def _check_columns(path: Path, diameter: Floats, given: Floats, names: list[str]) -> None:
    if diameter.size < 2:
        raise InputError(f"spectrum {path.name!r} should have two classes or more")
    if not (np.isfinite(diameter).all() and np.isfinite(given).all()):
        raise InputError(f"spectrum {path.name!r} has values that are not finite")
    falls = np.flatnonzero(np.diff(diameter) <= 0)
    if diameter[0] <= 0 or falls.size:
        at = int(falls[0]) + 1 if falls.size else 0
        before = f" after {diameter[at - 1]:g}" if at else ""
        raise InputError(
            f"spectrum {path.name!r}: {names[0]} should rise from class to class, from above 0; "
            f"class {at + 1} has {diameter[at]:g}{before}"
        )
    if (given < 0).any():
        at = int(np.argmax(given < 0))
        raise InputError(
            f"spectrum {path.name!r}: {names[1]} of class {at + 1} ({names[0]} {diameter[at]:g}) "
            f"should be 0 or more; found {given[at]:g}"
        )
    if not given.any():
        raise InputError(f"spectrum {path.name!r}: {names[1]} is 0 in all classes")


def _check_unit(
    path: Path, diameter_um: Floats, name: str, largest_um: tuple[float, float]
) -> None:
    largest = diameter_um[-1] / DIAMETERS[name]
    low, high = (limit / DIAMETERS[name] for limit in largest_um)
    if low <= largest <= high:
        return
    factor = "a thousandth" if largest < low else "a thousand times"
    raise InputError(
        f"spectrum {path.name!r}: its largest {name} is {largest:g}, allowed: {low:g} to {high:g}; "
        f"is its unit {factor} what the column's name says (mistaken by 10³)?"
    )


def _check_water(path: Path, spectrum: SpectrumSizes) -> None:
    if spectrum.number_per_cm3 is None:
        return
    volume_um3 = 4 / 3 * math.pi * spectrum.moment(3)
    water = spectrum.number_per_cm3 * volume_um3 * 1e-6  # 1 µm³ per cm³ is 1e-6 g per m³
    if water > MAX_WATER_G_PER_M3:
        raise InputError(
            f"spectrum {path.name!r} holds {water:.3g} g of liquid in a m³ of air, allowed: up to "
            f"{MAX_WATER_G_PER_M3:g}; are its numbers per litre or per m³ of air, or its diameters "
            "in another unit (mistaken by 10³)?"
        )

"""Scattering by raindrops of each size, with geometric part and diffraction separated.

A drop's extinction is twice its cross section (C. F. Bohren & D. R. Huffman 1983, section 4.4): the
light it meets, and light it diffracts into a cone of 1.22 λ/D, 1.9 mrad for 1 mm.
"""

from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.atmosphere.indices import refractive_index
from spisim.atmosphere.mie import scatter

PATH = Path(__file__).with_name("rain.npz")
WAVELENGTHS_NM = (550, 850, 905, 940, 1460, 1550)
EDGES_MM = np.geomspace(0.1, 6.0, 25)  # diameters between classes
DROPS = 96  # of each class
#: Scattering below this angle, in excess of its surroundings, counts as diffracted. The Airy disc
#: of drops from 0.1 mm on lies within it.
CONE_DEG = 1.5
#: The glory is averaged over this angle: for clear spheres it is a spike of hundredths of a degree,
#: which drops flattened by their fall do not have.
GLORY_DEG = 0.4
#: Maximum distance from a tabulated wavelength; water's absorption changes by up to 60 % over it.
NEAR_NM = 50.0
PROPERTIES = ("extinction", "albedo", "g", "diffracted", "phase")
ANGLES_DEG = np.concatenate(
    [
        [0],
        np.geomspace(CONE_DEG, 8, 20)[:-1],
        np.arange(8, 176.01, 0.5),
        180 - np.geomspace(0.02, 4, 40)[:-1][::-1],
        [180],
    ]
)


@dataclass(frozen=True, eq=False)
class RainTable:
    """Efficiencies and phase functions, 1/sr, of the size classes (classes,) at one wavelength."""

    angles_deg: Floats
    extinction: Floats  # over the geometric cross section
    albedo: Floats
    g: Floats  # mean cosine, diffraction included
    diffracted: Floats  # fraction of scattered light
    phase: Floats  # (classes, angles), of the rest


def rain_table(wavelength_nm: float) -> RainTable:
    """Table of the nearest of `WAVELENGTHS_NM`; InputError if none is within 50 nm."""
    nearest_nm = min(WAVELENGTHS_NM, key=lambda available: abs(available - wavelength_nm))
    if not abs(nearest_nm - wavelength_nm) <= NEAR_NM:
        available = ", ".join(map(str, WAVELENGTHS_NM))
        raise InputError(
            f"rain is tabulated at {available} nm, each within {NEAR_NM:g} nm; found "
            f"wavelength_nm {wavelength_nm:g}"
        )
    return _read()[nearest_nm]


@cache
def _read() -> dict[float, RainTable]:
    with np.load(PATH) as file:
        arrays = dict(file)
    return {
        float(wavelength): RainTable(
            arrays["angles_deg"], *(arrays[name][i].astype(float) for name in PROPERTIES)
        )
        for i, wavelength in enumerate(arrays["wavelengths_nm"])
    }


def compute(wavelength_nm: float, first: int = 0, last: int | None = None) -> RainTable:
    """Mie theory of the classes from `first` to before `last`."""
    pairs = list(pairwise(EDGES_MM))[first:last]
    rows = [_drops(low, high, wavelength_nm) for low, high in pairs]
    return RainTable(ANGLES_DEG, *map(np.array, zip(*rows, strict=True)))


def _drops(
    low_mm: float, high_mm: float, wavelength_nm: float
) -> tuple[float, float, float, float, Floats]:
    """One class: drops at equal logarithmic steps, weighted by cross section."""
    edges = np.geomspace(low_mm, high_mm, DROPS + 1)
    radii_um = 500 * np.sqrt(edges[:-1] * edges[1:])
    area_m2 = float(np.pi * (radii_um**2).sum()) * 1e-12
    index = refractive_index("water", wavelength_nm)
    sums = scatter(radii_um, np.ones(DROPS), index, wavelength_nm, ANGLES_DEG)
    phase = sums.per_steradian_m2 / sums.scattering_m2
    near = np.searchsorted(ANGLES_DEG, 2 * CONE_DEG)
    phase[0] = phase[1 : near + 1].mean()  # the plateau under the peak
    weights, back = solid_angle_weights(ANGLES_DEG), ANGLES_DEG >= 180 - GLORY_DEG
    phase[back] = np.average(phase[back], weights=weights[back])
    integral = weights @ phase
    return (
        sums.extinction_m2 / area_m2,
        sums.scattering_m2 / sums.extinction_m2,
        sums.forward_m2 / sums.scattering_m2,
        1 - float(integral),
        phase / integral,
    )


def solid_angle_weights(angles_deg: Floats) -> Floats:
    """Weights that integrate over the sphere what is linear between these angles."""
    angles = np.radians(angles_deg)
    left, right = angles[:-1], angles[1:]
    step = right - left
    # ∫ sin θ times the falling and the rising half of each hat
    falling = np.cos(left) - (np.sin(right) - np.sin(left)) / step
    rising = (np.sin(right) - np.sin(left)) / step - np.cos(right)
    weights = np.zeros_like(angles)
    weights[:-1] += falling
    weights[1:] += rising
    return 2 * np.pi * weights

"""What rain drops of each size do to light: geometry and diffraction, told apart.

A drop takes twice its cross section out of a beam (C. F. Bohren & D. R. Huffman 1983, section 4.4):
once by meeting the light, once by diffracting it into a cone of 1.22 λ/D, 1.9 mrad for 1 mm.
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
EDGES_MM = np.geomspace(0.1, 6.0, 25)  # diameters; each class holds what lies between two
DROPS = 96  # of each class
#: What is scattered by less than this, beyond what its surroundings have, counts as diffracted.
#: From 0.1 mm on, a drop's Airy disc lies within it.
CONE_DEG = 1.5
#: The glory is averaged over so much around straight back: that of clear spheres is a spike of
#: hundredths of a degree, which drops, flattened as they fall, do not have.
GLORY_DEG = 0.4
#: How far from a tabulated wavelength its table may be used; water's absorption changes by up to
#: 60 % over that.
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
    """Efficiencies and phase functions of the size classes (classes,) at one wavelength.

    `diffracted` is the share of what is scattered; `phase` (classes, angles), 1/sr, is of the rest.
    """

    angles_deg: Floats
    extinction: Floats  # over the geometric cross section
    albedo: Floats
    g: Floats  # mean cosine of all that is scattered, diffraction included
    diffracted: Floats
    phase: Floats


def rain_table(wavelength_nm: float) -> RainTable:
    """Of the nearest of `WAVELENGTHS_NM`; InputError where none is within 50 nm."""
    nearest_nm = min(WAVELENGTHS_NM, key=lambda available: abs(available - wavelength_nm))
    if not abs(nearest_nm - wavelength_nm) <= NEAR_NM:
        available = ", ".join(map(str, WAVELENGTHS_NM))
        raise InputError(
            f"rain is tabulated at {available} nm, each for up to {NEAR_NM:g} nm more or "
            f"less; found wavelength_nm {wavelength_nm:g}"
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
    """Mie theory for the classes from `first` to before `last`."""
    pairs = list(pairwise(EDGES_MM))[first:last]
    rows = [_drops(low, high, wavelength_nm) for low, high in pairs]
    return RainTable(ANGLES_DEG, *map(np.array, zip(*rows, strict=True)))


def _drops(
    low_mm: float, high_mm: float, wavelength_nm: float
) -> tuple[float, float, float, float, Floats]:
    """One class: drops at equal steps of the logarithm, each as its cross section weighs."""
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
    retained = weights @ phase
    return (
        sums.extinction_m2 / area_m2,
        sums.scattering_m2 / sums.extinction_m2,
        sums.forward_m2 / sums.scattering_m2,
        1 - float(retained),
        phase / retained,
    )


def solid_angle_weights(angles_deg: Floats) -> Floats:
    """Weights that integrate over the sphere what is linear in the angle between these angles."""
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

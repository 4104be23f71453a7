"""Metals that Mitsuba knows by name: published refractive indices in the near infrared.

Values from https://refractiveindex.info, linearly interpolated between its rows. They are for
clean, smooth films or bulk; tarnished metals and alloys reflect less.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

#: Wavelengths of the indices.
WAVELENGTHS_NM = (850, 905, 940, 1460, 1550)


@dataclass(frozen=True)
class Metal:
    """Real and imaginary part of the index at `WAVELENGTHS_NM`, and their source."""

    eta: tuple[float, float, float, float, float]
    k: tuple[float, float, float, float, float]
    source: str


NOBLE = "Johnson & Christy (1972), Phys. Rev. B 6, 4370"
TRANSITION = "Johnson & Christy (1974), Phys. Rev. B 9, 5056"
SUBMILLIMETRE = "Ordal et al. (1988), Applied Optics 27, 1203"
ALKALI = "Inagaki et al. (1976), Phys. Rev. B 13, 2305"

#: Metals by Mitsuba's names.
METALS: Mapping[str, Metal] = MappingProxyType({
    "Ag": Metal((0.04, 0.04, 0.04, 0.1362, 0.1445), (5.965, 6.408, 6.667, 10.64, 11.37),
                f"silver, {NOBLE}"),
    "Al": Metal((2.588, 2.052, 1.674, 1.48, 1.579), (8.169, 8.257, 8.608, 14.68, 15.66),
                "aluminium, Rakić (1995), Applied Optics 34, 4755"),
    "Au": Metal((0.1641, 0.1771, 0.1961, 0.4701, 0.5241), (5.319, 5.76, 6.021, 10.04, 10.74),
                f"gold, {NOBLE}"),
    "Be": Metal((3.376, 3.332, 3.302, 2.854, 2.793), (3.479, 3.601, 3.686, 5.41, 5.758),
                "beryllium, Rakić et al. (1998), Applied Optics 37, 5271"),
    "Cr": Metal((3.241, 3.316, 3.357, 3.681, 3.668), (3.496, 3.527, 3.546, 3.985, 4.18),
                f"chromium, {TRANSITION}"),
    "Cu": Metal((0.2763, 0.3028, 0.3104, 0.6494, 0.7158), (5.42, 5.86, 6.109, 9.958, 10.66),
                f"copper, {NOBLE}"),
    "Hg": Metal((3.138, 3.419, 3.591, 5.761, 6.088), (6.395, 6.626, 6.751, 8.118, 8.313),
                "mercury, Inagaki et al. (1981), Phys. Rev. B 23, 5246"),
    "K": Metal((0.04045, 0.04006, 0.04004, 0.06201, 0.06733), (2.525, 2.702, 2.814, 4.537, 4.818),
               "potassium, Smith (1969), Phys. Rev. 183, 634"),
    "Li": Metal((0.2087, 0.2196, 0.2263, 0.402, 0.436), (4.253, 4.536, 4.732, 7.404, 7.87),
                f"lithium, {ALKALI}"),
    "Mo": Metal((3.375, 3.007, 2.83, 1.678, 1.609), (3.343, 3.485, 3.666, 6.988, 7.554),
                f"molybdenum, {SUBMILLIMETRE}"),
    "Na": Metal((0.04599, 0.04898, 0.05078, 0.1054, 0.117), (3.73, 3.971, 4.156, 6.612, 7.02),
                f"sodium, {ALKALI}"),
    "Nb": Metal((1.92, 1.823, 1.74, 1.374, 1.435), (4.06, 4.343, 4.55, 8.0, 8.6),
                "niobium, Golovashkin et al. (1969), Sov. Phys. JETP 29, 27"),
    "Ni": Metal((2.317, 2.411, 2.442, 3.016, 3.09), (5.076, 5.275, 5.397, 7.352, 7.717),
                f"nickel, {TRANSITION}"),
    "Rh": Metal((2.871, 3.081, 3.21, 3.64, 3.63), (7.105, 7.401, 7.566, 9.815, 10.3),
                "rhodium, Weaver et al. (1977), Phys. Rev. B 15, 4115"),
    "Ta": Metal((1.06, 1.018, 1.004, 0.8412, 0.8599), (3.856, 4.245, 4.483, 7.85, 8.431),
                f"tantalum, {SUBMILLIMETRE}"),
    "V": Metal((3.144, 3.095, 3.026, 2.68, 2.734), (3.287, 3.363, 3.423, 5.538, 6.019),
               f"vanadium, {TRANSITION}"),
    "W": Metal((3.395, 3.163, 3.08, 3.067, 2.706), (2.861, 3.074, 3.187, 4.466, 4.711),
               "tungsten, Weaver et al. (1975), Phys. Rev. B 12, 1293"),
})  # fmt: skip


def metal(name: str) -> Metal | None:
    """Return the metal of a Mitsuba name, from whichever table (`Ni_palik`) the name is."""
    return METALS.get(name.removesuffix("_palik"))

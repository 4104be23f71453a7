"""Size distributions of fog droplets and smoke particles, and named kinds.

Radii are in µm. Distributions are normalised: visibility or water content gives the number.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import TypeAlias

import numpy as np
from scipy.special import gammaincinv, ndtri

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError, nearest
from spisim.atmosphere.indices import refractive_index
from spisim.atmosphere.spectrum import SpectrumSizes

#: Fractions of the geometric cross section below and above the integrated radii. Small particles
#: scatter as r⁶, hence the long upper tail.
CUT_BELOW, CUT_ABOVE = 1e-6, 1e-9
#: Maximum radius: larger drops are drizzle, which these distributions do not describe.
MAX_RADIUS_UM = 300.0
WATER_G_PER_CM3 = 0.997  # at 25 °C


def _check(name: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise InputError(f"{name} should lie between {low:g} and {high:g}; found {value:g}")


def _check_tail(sizes: GammaSizes | LogNormalSizes) -> None:
    largest = sizes.radius_range_um()[1]
    if not largest <= MAX_RADIUS_UM:
        raise InputError(
            f"droplet sizes reach a radius of {largest:.3g} µm before their cross section "
            f"converges; allowed: up to {MAX_RADIUS_UM:g} µm"
        )


@dataclass(frozen=True)
class GammaSizes:
    """Modified gamma distribution n(r) ∝ r^α exp(-b r^γ) (Deirmendjian 1969).

    b follows from the mode radius, r^γ = α / (b γ).

    Parameters
    ----------
    alpha, gamma : float
        Exponents α, 0.1 to 50, and γ, 0.2 to 10.
    mode_radius_um : float
        Most frequent radius, 0.001 to 100 µm; InputError for other values.
    """

    alpha: float
    gamma: float
    mode_radius_um: float

    def __post_init__(self) -> None:
        _check("alpha", self.alpha, 0.1, 50)
        _check("gamma", self.gamma, 0.2, 10)
        _check("mode_radius_um", self.mode_radius_um, 0.001, 100)
        _check_tail(self)

    @property
    def b(self) -> float:
        """Coefficient of the exponential, µm^-γ."""
        return self.alpha / (self.gamma * self.mode_radius_um**self.gamma)

    def density(self, radius_um: Floats) -> Floats:
        """Fraction of particles per µm of radius; its integral is 1."""
        shape = (self.alpha + 1) / self.gamma
        log_norm = math.log(self.gamma) + shape * math.log(self.b) - math.lgamma(shape)
        log_density = log_norm + self.alpha * np.log(radius_um) - self.b * radius_um**self.gamma
        return np.asarray(np.exp(log_density))

    def moment(self, power: float) -> float:
        """Mean of radius^power, µm^power."""
        shapes = (self.alpha + 1 + power) / self.gamma, (self.alpha + 1) / self.gamma
        return math.exp(
            math.lgamma(shapes[0]) - math.lgamma(shapes[1]) - power / self.gamma * math.log(self.b)
        )

    def radius_range_um(self) -> tuple[float, float]:
        """Radii that hold all but a negligible part of the cross section."""
        shape = (self.alpha + 3) / self.gamma
        low, high = gammaincinv(shape, (CUT_BELOW, 1 - CUT_ABOVE))
        return (low / self.b) ** (1 / self.gamma), (high / self.b) ** (1 / self.gamma)


@dataclass(frozen=True)
class LogNormalSizes:
    """Log-normal distribution.

    Parameters
    ----------
    median_diameter_um : float
        Median, 0.002 to 200 µm.
    sigma_g : float
        Geometric standard deviation, 1.05 to 2.5; InputError for other values.
    """

    median_diameter_um: float
    sigma_g: float

    def __post_init__(self) -> None:
        _check("median_diameter_um", self.median_diameter_um, 0.002, 200)
        _check("sigma_g", self.sigma_g, 1.05, 2.5)
        _check_tail(self)

    @classmethod
    def of_volume(cls, median_diameter_um: float, sigma_g: float) -> LogNormalSizes:
        """Sizes by the median diameter of the volume, as laser diffraction states it."""
        return cls(median_diameter_um * math.exp(-3 * math.log(sigma_g) ** 2), sigma_g)

    @property
    def _log_centre(self) -> float:
        return math.log(self.median_diameter_um / 2)

    @property
    def _log_width(self) -> float:
        return math.log(self.sigma_g)

    def density(self, radius_um: Floats) -> Floats:
        """Fraction of particles per µm of radius; its integral is 1."""
        score = (np.log(radius_um) - self._log_centre) / self._log_width
        bell = np.exp(-(score**2) / 2) / (self._log_width * math.sqrt(2 * math.pi))
        return np.asarray(bell / radius_um)

    def moment(self, power: float) -> float:
        """Mean of radius^power, µm^power."""
        return math.exp(power * self._log_centre + (power * self._log_width) ** 2 / 2)

    def radius_range_um(self) -> tuple[float, float]:
        """Radii that hold all but a negligible part of the cross section."""
        centre = self._log_centre + 2 * self._log_width**2
        low, high = centre + self._log_width * ndtri((CUT_BELOW, 1 - CUT_ABOVE))
        return math.exp(low), math.exp(high)


Sizes: TypeAlias = GammaSizes | LogNormalSizes | SpectrumSizes


@dataclass(frozen=True)
class Particles:
    """Spheres of some sizes, of a material with a known refractive index, or of an `index`.

    The index n - ik holds at every wavelength; InputError if it is implausible.
    """

    sizes: Sizes
    index: complex | None = None
    material: str = "water"

    def __post_init__(self) -> None:
        if self.index is not None:
            _check("n", self.index.real, 1.0001, 4)
            _check("k", -self.index.imag, 0, 4)

    def index_at(self, wavelength_nm: float) -> complex:
        """Refractive index n - ik."""
        if self.index is not None:
            return self.index
        return refractive_index(self.material, wavelength_nm)

    @property
    def are_water(self) -> bool:
        """Whether they are water droplets."""
        return self.index is None and self.material == "water"

    @cached_property
    def volume_m3(self) -> float:
        """Mean volume of a particle."""
        return 4 / 3 * math.pi * self.sizes.moment(3) * 1e-18


#: Fog and haze. Advection and radiation fogs: E. P. Shettle & R. W. Fenn, AFGL-TR-79-0214 (1979);
#: Chu & Hogg, Bell Syst. Tech. J. 47, 723 (1968); haze L (continental), M (maritime) and H (high
#: altitude): D. Deirmendjian, Electromagnetic Scattering on Spherical Polydispersions (1969).
FOGS: Mapping[str, Particles] = MappingProxyType(
    {
        "heavy-advection": Particles(GammaSizes(3, 1, 10)),
        "moderate-advection": Particles(GammaSizes(3, 1, 8)),
        "heavy-radiation": Particles(GammaSizes(6, 1, 4)),
        "moderate-radiation": Particles(GammaSizes(6, 1, 2)),
        "chu-hogg": Particles(GammaSizes(2, 0.5, 1)),
        "haze-l": Particles(GammaSizes(2, 0.5, 0.07)),
        "haze-m": Particles(GammaSizes(1, 0.5, 0.05)),
        "haze-h": Particles(GammaSizes(2, 1, 0.1)),
    }
)

#: Width to which coagulation drives any dense smoke (K. W. Lee, J. Colloid Interface Sci. 92, 315
#: (1983)). Condensation alone can leave it narrower: one record of a fog machine has 1.19.
COAGULATED_SIGMA_G = 1.32
#: Smokes. The volume medians of fog machine, hazer and flare, and the hazer's width, are by laser
#: diffraction (Malvern Spraytec) in the tunnel of IRNAS, "Fog particle size and FSO link
#: attenuation" (2016). Other sizes, and indices that are given as numbers, are assumed, typical
#: values, the same at every wavelength; measured ones vary by a factor of two and more.
SMOKES: Mapping[str, Particles] = MappingProxyType(
    {
        "biomass": Particles(LogNormalSizes(0.15, 1.6), 1.55 - 0.02j),
        "soot": Particles(LogNormalSizes(0.10, 1.8), 1.75 - 0.44j),
        "flare": Particles(LogNormalSizes.of_volume(0.5219, 1.6), 1.5 - 1e-3j),
        "fog-machine": Particles(
            LogNormalSizes.of_volume(0.8524, COAGULATED_SIGMA_G), material="fog-fluid"
        ),
        "hazer": Particles(LogNormalSizes.of_volume(1.161, 2.47), material="fog-fluid"),
    }
)

KINDS: Mapping[str, Particles] = MappingProxyType({**FOGS, **SMOKES})

_FORMER_MEDIANS_UM = {"glycol": 1.0, "glycol-fine": 0.6}


def named_particles(kind: str) -> Particles:
    """Particles of a kind in `KINDS`; InputError for another, with what replaces a former one."""
    if kind in _FORMER_MEDIANS_UM:
        raise InputError(
            f"kind {kind!r} of smoke had assumed sizes and is no more: use 'fog-machine' or "
            "'hazer', measured ones, or droplets: {median_diameter_um: "
            f"{_FORMER_MEDIANS_UM[kind]:g}, sigma_g: 1.5, n: 1.43, k: 1e-4}} for what it was"
        )
    if kind not in KINDS:
        raise InputError(f"kind {kind!r} of fog or smoke: {nearest(kind, KINDS)}")
    return KINDS[kind]

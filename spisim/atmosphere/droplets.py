"""Sizes of fog droplets and smoke particles, and the kinds that have a name.

Radii are in µm. A distribution says how sizes share the particles, not how many there are: that
follows from visibility or water content.
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
from reconstruction.base.errors import InputError
from spisim.atmosphere.indices import refractive_index

#: Shares of the geometric cross section that are left out below and above the radii integrated.
#: Small particles scatter as r⁶, hence the long tail.
CUT_BELOW, CUT_ABOVE = 1e-6, 1e-9
#: Larger than this is drizzle, and the size distribution has no business here.
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
    """n(r) ∝ r^α exp(-b r^γ), the modified gamma distribution (Deirmendjian 1969).

    b follows from the most frequent radius, r^γ = α / (b γ). Raises InputError for parameters
    outside their ranges.
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
        """Share of particles per µm of radius; its integral is 1."""
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
        """Radii between which all but a negligible part of the cross section lies."""
        shape = (self.alpha + 3) / self.gamma
        low, high = gammaincinv(shape, (CUT_BELOW, 1 - CUT_ABOVE))
        return (low / self.b) ** (1 / self.gamma), (high / self.b) ** (1 / self.gamma)


@dataclass(frozen=True)
class LogNormalSizes:
    """Log-normal: half the particles are smaller than the median, 68 % within a factor sigma_g.

    Raises InputError for parameters outside their ranges.
    """

    median_diameter_um: float
    sigma_g: float

    def __post_init__(self) -> None:
        _check("median_diameter_um", self.median_diameter_um, 0.002, 200)
        _check("sigma_g", self.sigma_g, 1.05, 2.5)
        _check_tail(self)

    @property
    def _log_centre(self) -> float:
        return math.log(self.median_diameter_um / 2)

    @property
    def _log_width(self) -> float:
        return math.log(self.sigma_g)

    def density(self, radius_um: Floats) -> Floats:
        """Share of particles per µm of radius; its integral is 1."""
        position = (np.log(radius_um) - self._log_centre) / self._log_width
        bell = np.exp(-(position**2) / 2) / (self._log_width * math.sqrt(2 * math.pi))
        return np.asarray(bell / radius_um)

    def moment(self, power: float) -> float:
        """Mean of radius^power, µm^power."""
        return math.exp(power * self._log_centre + (power * self._log_width) ** 2 / 2)

    def radius_range_um(self) -> tuple[float, float]:
        """Radii between which all but a negligible part of the cross section lies."""
        centre = self._log_centre + 2 * self._log_width**2
        low, high = centre + self._log_width * ndtri((CUT_BELOW, 1 - CUT_ABOVE))
        return math.exp(low), math.exp(high)


Sizes: TypeAlias = GammaSizes | LogNormalSizes


@dataclass(frozen=True)
class Particles:
    """Spheres of these sizes, of water where `index` (n - ik, at every wavelength) is None.

    Raises InputError for a refractive index that no such matter has.
    """

    sizes: Sizes
    index: complex | None = None

    def __post_init__(self) -> None:
        if self.index is not None:
            _check("n", self.index.real, 1.0001, 4)
            _check("k", -self.index.imag, 0, 4)

    def index_at(self, wavelength_nm: float) -> complex:
        """Refractive index n - ik."""
        if self.index is not None:
            return self.index
        return refractive_index("water", wavelength_nm)

    @property
    def are_water(self) -> bool:
        """Whether they are droplets of water."""
        return self.index is None

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

#: Smokes. Sizes and indices are assumed, typical values; measured ones spread by a factor of two
#: and more. Indices are taken as the same at 550 nm and 1550 nm.
SMOKES: Mapping[str, Particles] = MappingProxyType(
    {
        "biomass": Particles(LogNormalSizes(0.15, 1.6), 1.55 - 0.02j),
        "soot": Particles(LogNormalSizes(0.10, 1.8), 1.75 - 0.44j),
        "glycol-fine": Particles(LogNormalSizes(0.6, 1.5), 1.43 - 1e-4j),
        "glycol": Particles(LogNormalSizes(1.0, 1.5), 1.43 - 1e-4j),
    }
)

KINDS: Mapping[str, Particles] = MappingProxyType({**FOGS, **SMOKES})

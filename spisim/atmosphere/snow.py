"""Snow as a medium, from measured attenuation."""

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from reconstruction.base.errors import InputError, nearest
from spisim.atmosphere.indices import check_wavelength, refractive_index
from spisim.atmosphere.medium import DB_PER_NEPER, Atmosphere, check_rate
from spisim.atmosphere.phase import henyey_greenstein
from spisim.atmosphere.visibility import VISUAL_NM, visibility

#: Not measured at 1550 nm. Ice absorbs three times as much as water there, and flakes are as large
#: as drops: an albedo of 0.65 to 0.85 (0.75 if half of the light on a flake is absorbed) and a g of
#: 0.85 to 0.92 are plausible.
SNOW_G = 0.88
HALF_ABSORBED_AT_NM = 1550.0
MELTWATER_KG_PER_M3 = 1000.0


class SnowLaw(NamedTuple):
    """γ = a S^exponent in dB/km, a = per_nm · λ + offset; S in mm/h, λ in nm."""

    per_nm: float
    offset: float
    exponent: float

    def extinction_per_m(self, rate_mm_per_h: float, wavelength_nm: float) -> float:
        """Extinction, 1/m."""
        decibels = (self.per_nm * wavelength_nm + self.offset) * rate_mm_per_h**self.exponent
        return decibels / (1e3 * DB_PER_NEPER)


#: Recommendation ITU-R P.1817-1. For one rate, visibilities spread by a factor of 3 to 10 (R. M.
#: Rasmussen et al., J. Appl. Meteorol. 38, 1542 (1999)).
SNOWS: Mapping[str, SnowLaw] = MappingProxyType(
    {"wet": SnowLaw(1.023e-4, 3.7855466, 0.72), "dry": SnowLaw(5.42e-5, 5.4958776, 1.38)}
)


def snow(
    rate_mm_per_h: float,
    kind: str = "wet",
    *,
    wavelength_nm: float = 1550.0,
    albedo: float | None = None,
    g: float = SNOW_G,
) -> Atmosphere:
    """Snow of a rate by the ITU's attenuation law, with assumed scattering.

    Half of the light is diffracted, half falls on the flakes (see `flake_albedo`), unless an albedo
    is given. The water is that of Gunn & Marshall's flakes, which the law does not involve.

    Parameters
    ----------
    rate_mm_per_h : float
        As water, above 0, at most 20.
    kind : str
        "wet" or "dry".
    wavelength_nm : float
        400 to 1700 nm.
    albedo, g : float
        Scattered fraction and mean cosine.

    Raises
    ------
    InputError
        For other values.
    """
    check_rate("snow", rate_mm_per_h)
    if kind not in SNOWS:
        raise InputError(f"kind {kind!r} of snow: {nearest(kind, SNOWS)}")
    check_wavelength(wavelength_nm)
    if albedo is None:
        albedo = (1 + flake_albedo(wavelength_nm)) / 2
    if not (math.isfinite(albedo) and 0 <= albedo <= 1):
        raise InputError(f"albedo should lie between 0 and 1; found {albedo}")
    law = SNOWS[kind]
    intercept, slope = melted_sizes(rate_mm_per_h)
    return Atmosphere(
        law.extinction_per_m(rate_mm_per_h, wavelength_nm),
        albedo,
        henyey_greenstein(g),
        f"{kind} snow, {rate_mm_per_h:g} mm/h",
        visibility(law.extinction_per_m(rate_mm_per_h, VISUAL_NM)),
        water_g_per_m3=1e-6 * MELTWATER_KG_PER_M3 * math.pi * intercept / slope**4,
    )


def melted_sizes(rate_mm_per_h: float) -> tuple[float, float]:
    """N0 (m⁻³ mm⁻¹) and Λ (mm⁻¹) of melted flakes, N(D) = N0 exp(-Λ D); the rate is of water.

    K. L. S. Gunn & J. S. Marshall, J. Meteorol. 15, 452 (1958).
    """
    return 3800.0 * rate_mm_per_h**-0.87, 2.55 * rate_mm_per_h**-0.48


def flake_albedo(wavelength_nm: float) -> float:
    """Scattered fraction of the light on flakes: half at 1550 nm, assumed, after 0.2 mm of ice."""
    here, there = (
        refractive_index("ice", nm).imag / nm for nm in (HALF_ABSORBED_AT_NM, wavelength_nm)
    )
    return float(0.5 ** (there / here))

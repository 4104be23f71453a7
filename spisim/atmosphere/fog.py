"""Fog from its visibility.

Visibility is a property of the eye's wavelengths: it fixes the extinction at 550 nm, and the
droplets fix how much more or less there is at 1550 nm. The droplet size distributions are the four
of Shettle & Fenn (AFGL-TR-79-0214, 1979); ratio, albedo and asymmetry are Mie results for water
(Segelstein 1981). A change of visibility scales the number of droplets, not their sizes, so albedo
and asymmetry stay.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from reconstruction.errors import InputError, nearest
from spisim.atmosphere.phase import HenyeyGreenstein, Isotropic, Phase

# Contrast of a black object against the horizon at which it counts as just visible.
CONTRAST_THRESHOLDS: Mapping[str, float] = MappingProxyType({"koschmieder": 0.02, "mor": 0.05})


@dataclass(frozen=True)
class FogKind:
    """Optical properties of one droplet size distribution at 1550 nm."""

    extinction_ratio: float  # extinction at 1550 nm over that at 550 nm
    albedo: float
    g: float  # mean cosine of the scattering angle


FOGS: Mapping[str, FogKind] = MappingProxyType(
    {
        "heavy-advection": FogKind(1.0293, 0.98104, 0.8678),
        "moderate-advection": FogKind(1.0344, 0.98450, 0.8616),
        "heavy-radiation": FogKind(1.0657, 0.99374, 0.8214),
        "moderate-radiation": FogKind(1.1416, 0.99716, 0.7825),
    }
)


@dataclass(frozen=True)
class Atmosphere:
    """A medium at 1550 nm."""

    extinction_per_m: float  # 0: clear air
    albedo: float
    phase: Phase
    kind: str
    visibility_m: float | None = None

    @property
    def g(self) -> float:
        """Asymmetry: the mean cosine of the scattering angle."""
        return self.phase.g

    @property
    def scattering_per_m(self) -> float:
        """Scattering coefficient, extinction times albedo."""
        return self.extinction_per_m * self.albedo

    @property
    def absorption_per_m(self) -> float:
        """Absorption coefficient, extinction less scattering."""
        return self.extinction_per_m * (1.0 - self.albedo)


CLEAR = Atmosphere(extinction_per_m=0.0, albedo=1.0, phase=Isotropic(), kind="clear")


def extinction_at_550nm(visibility_m: float, definition: str = "koschmieder") -> float:
    """Extinction coefficient at 550 nm, 1/m, of air with this visibility.

    `definition` is "koschmieder" (2 % contrast, 3.912/V) or "mor" (the meteorological optical
    range of the WMO, 5 % contrast, 2.996/V); taking one for the other is an error of 31 %.
    Raises InputError for an unknown definition or a visibility that is not positive and finite.
    """
    if definition not in CONTRAST_THRESHOLDS:
        raise InputError(
            f"definition {definition!r} of visibility: {nearest(definition, CONTRAST_THRESHOLDS)}"
        )
    if not (math.isfinite(visibility_m) and visibility_m > 0):
        raise InputError(f"visibility_m should be greater than 0 and finite; found {visibility_m}")
    return -math.log(CONTRAST_THRESHOLDS[definition]) / visibility_m


def fog(visibility_m: float, kind: str, definition: str = "koschmieder") -> Atmosphere:
    """Fog of a kind in `FOGS` with a visibility in metres at 550 nm, Henyey-Greenstein scattering.

    Raises InputError for an unknown kind or definition and for a visibility that is not positive.
    """
    if kind not in FOGS:
        raise InputError(f"fog kind {kind!r}: {nearest(kind, FOGS)}")
    droplets = FOGS[kind]
    extinction = extinction_at_550nm(visibility_m, definition) * droplets.extinction_ratio
    phase = HenyeyGreenstein(droplets.g)
    return Atmosphere(extinction, droplets.albedo, phase, kind, visibility_m)


def explicit(extinction_per_m: float, albedo: float, phase: Phase) -> Atmosphere:
    """A medium given by its coefficients and phase function at 1550 nm.

    Raises InputError unless extinction ≥ 0 and finite, and 0 ≤ albedo ≤ 1.
    """
    if not (math.isfinite(extinction_per_m) and extinction_per_m >= 0):
        raise InputError(
            f"extinction_per_m should be 0 or more and finite; found {extinction_per_m}"
        )
    if not 0 <= albedo <= 1:
        raise InputError(f"albedo should lie between 0 and 1; found {albedo}")
    return Atmosphere(extinction_per_m, albedo, phase, kind="explicit")

"""Media at one wavelength, and mixtures of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from reconstruction.base.errors import InputError
from spisim.atmosphere.phase import Blend, Isotropic, Phase
from spisim.atmosphere.uncertainty import Uncertainty
from spisim.atmosphere.visibility import extinction_at_550nm, visibility

DB_PER_NEPER = 10 / math.log(10)


@dataclass(frozen=True)
class Atmosphere:
    """A medium at the instrument's wavelength.

    `visibility_m` and `water_g_per_m3` are None if unknown. `warnings` names properties that are
    unnatural or outside the range of the model.
    """

    extinction_per_m: float  # 0: clear air
    albedo: float
    phase: Phase
    kind: str
    visibility_m: float | None = None
    definition: str = "koschmieder"  # of the visibility
    water_g_per_m3: float | None = None
    warnings: tuple[str, ...] = ()
    parts: tuple[Atmosphere, ...] = ()  # of a mixture
    uncertainty: Uncertainty | None = field(default=None, compare=False)  # of a measured spectrum

    @property
    def g(self) -> float:
        """Asymmetry: mean cosine of the scattering angle."""
        return self.phase.g

    @property
    def backscatter_per_sr(self) -> float:
        """Phase function at 180°, 1/sr."""
        return float(self.phase.density(-1.0))

    @property
    def scattering_per_m(self) -> float:
        """Scattering coefficient, extinction times albedo."""
        return self.extinction_per_m * self.albedo

    @property
    def absorption_per_m(self) -> float:
        """Absorption coefficient, extinction less scattering."""
        return self.extinction_per_m * (1.0 - self.albedo)

    def summary(self) -> dict[str, Any]:
        """The medium in plain numbers."""
        return {
            "kind": self.kind,
            "extinction_per_m": self.extinction_per_m,
            "extinction_db_per_km": 1e3 * DB_PER_NEPER * self.extinction_per_m,
            "albedo": self.albedo,
            "g": self.g,
            "backscatter_per_sr": self.backscatter_per_sr,
            "visibility_m": self.visibility_m,
            "visibility_definition": self.definition,
            "water_g_per_m3": self.water_g_per_m3,
            **({} if self.uncertainty is None else self.uncertainty.summary()),
        }


#: Maximum rates, mm/h of water, that last for minutes.
MAX_RATE_MM_PER_H: Mapping[str, float] = MappingProxyType({"rain": 300.0, "snow": 20.0})
#: Ten times that of milk: a mean free path of 0.1 mm.
MAX_EXTINCTION_PER_M = 1e4

CLEAR = Atmosphere(
    extinction_per_m=0.0, albedo=1.0, phase=Isotropic(), kind="clear", water_g_per_m3=0.0
)


def check_rate(kind: str, rate_mm_per_h: float) -> None:
    """InputError unless a rate of "rain" or "snow" is above 0 and at most the maximum."""
    max_rate = MAX_RATE_MM_PER_H[kind]
    if not 0 < rate_mm_per_h <= max_rate:
        raise InputError(
            f"rate_mm_per_h of {kind} should be greater than 0 and at most {max_rate:g}; found "
            f"{rate_mm_per_h:g}"
        )


def explicit(extinction_per_m: float, albedo: float, phase: Phase) -> Atmosphere:
    """A medium given by coefficients and phase function at the instrument's wavelength.

    Raises
    ------
    InputError
        Unless 0 ≤ extinction ≤ `MAX_EXTINCTION_PER_M`, and 0 ≤ albedo ≤ 1.
    """
    if not 0 <= extinction_per_m <= MAX_EXTINCTION_PER_M:
        raise InputError(
            f"extinction_per_m should be 0 to {MAX_EXTINCTION_PER_M:g}; found {extinction_per_m}"
        )
    if not 0 <= albedo <= 1:
        raise InputError(f"albedo should lie between 0 and 1; found {albedo}")
    return Atmosphere(extinction_per_m, albedo, phase, kind="explicit")


def combine(media: Sequence[Atmosphere]) -> Atmosphere:
    """Mixture of media in the same air.

    Extinction, scattering and water add up; phase functions are weighted by scattering. Visibility
    follows Koschmieder's definition if all media have one.

    Parameters
    ----------
    media : sequence of Atmosphere
        `CLEAR` results from none, and a single medium is returned as it is.
    """
    parts = tuple(medium for medium in media if medium.extinction_per_m > 0)
    if not parts:
        return CLEAR
    if len(parts) == 1:
        return parts[0]
    extinction = math.fsum(part.extinction_per_m for part in parts)
    scattering = math.fsum(part.scattering_per_m for part in parts)
    fractions = tuple(
        (part.scattering_per_m / scattering, part.phase)
        for part in parts
        if part.scattering_per_m > 0
    )
    return Atmosphere(
        extinction,
        scattering / extinction,
        Blend(fractions) if fractions else Isotropic(),
        " + ".join(part.kind for part in parts),
        _visibility(parts),
        water_g_per_m3=_water(parts),
        warnings=tuple(warning for part in parts for warning in part.warnings),
        parts=parts,
    )


def _visibility(parts: Sequence[Atmosphere]) -> float | None:
    total = 0.0
    for part in parts:
        if part.visibility_m is None:
            return None
        total += extinction_at_550nm(part.visibility_m, part.definition)
    return visibility(total)


def _water(parts: Sequence[Atmosphere]) -> float | None:
    available = [part.water_g_per_m3 for part in parts if part.water_g_per_m3 is not None]
    return math.fsum(available) if len(available) == len(parts) else None

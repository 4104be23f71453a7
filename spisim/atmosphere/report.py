"""Weather in figures and tables: extinction, albedo, scattering and water."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

from spisim.atmosphere.empirical import all_extinctions
from spisim.atmosphere.fog import agreed_visibility, fog
from spisim.atmosphere.medium import Atmosphere, combine
from spisim.atmosphere.rain import rain
from spisim.atmosphere.snow import snow

DEFAULT_FOG, DEFAULT_SMOKE = "moderate-radiation", "fog-machine"
#: Distance of the target for the two-way transmission of unscattered light.
RANGE_M = 10.0
ROWS = {
    "extinction, 1/m": "extinction_per_m",
    "extinction, dB/km": "extinction_db_per_km",
    "albedo": "albedo",
    "g": "g",
    "p(180°), 1/sr": "backscatter_per_sr",
    "visibility, m": "visibility_m",
    "water, g/m³": "water_g_per_m3",
    f"passes {RANGE_M:g} m and back": "two_way_transmission",
}
#: Width at which five columns of wavelengths fit 80 characters.
DIGITS = 9


class ReportTable(NamedTuple):
    """Rows of text under column titles, and a note below them."""

    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str | None = None
    dim: bool = True  # the note explains, and holds no result
    digits: int = 11  # minimum width of a number


@dataclass(frozen=True)
class WeatherMix:
    """Fog, smoke (visibilities in metres), rain and snow (mm/h of water) in the same air."""

    fog_visibility: float | None = None
    fog_kind: str = DEFAULT_FOG
    definition: str = "koschmieder"
    rain: float | None = None
    snow: float | None = None
    snow_kind: str = "wet"
    smoke: float | None = None
    smoke_kind: str = DEFAULT_SMOKE

    def media(self, wavelength_nm: float) -> list[Atmosphere]:
        """The media present, at a wavelength."""
        amounts: dict[Callable[..., Atmosphere], float | None] = {
            partial(fog, kind=self.fog_kind, definition=self.definition): self.fog_visibility,
            partial(fog, kind=self.smoke_kind, definition=self.definition): self.smoke,
            rain: self.rain,
            partial(snow, kind=self.snow_kind): self.snow,
        }
        return [
            make(amount, wavelength_nm=wavelength_nm)
            for make, amount in amounts.items()
            if amount is not None
        ]

    def together(self, wavelength_nm: float) -> Atmosphere:
        """All media as one."""
        return combine(self.media(wavelength_nm))

    def report(self, wavelength_nm: float) -> dict[str, Any]:
        """Figures of the mixture and of each medium, as plain numbers."""
        media = self.media(wavelength_nm)
        together = combine(media)
        empirical = partial(_empirical, wavelength_nm=wavelength_nm)
        return {
            "wavelength_nm": wavelength_nm,
            **medium_figures(together),
            "media": [medium_figures(medium) for medium in media],
            "empirical": empirical(self.fog_visibility, self.definition),
            "empirical_smoke": empirical(self.smoke, "koschmieder", medium="smoke"),
            "rain_with_diffraction": _with_diffraction(self.rain, wavelength_nm),
            "warnings": together.warnings,
        }


def fog_visibility(
    visibility_m: float | None, water_g_per_m3: float | None, kind: str | None, definition: str
) -> float | None:
    """Visibility of the fog in metres; None if neither visibility nor water is given."""
    if visibility_m is None and water_g_per_m3 is None:
        return None
    return agreed_visibility(visibility_m, water_g_per_m3, kind or DEFAULT_FOG, definition)


def medium_figures(medium: Atmosphere) -> dict[str, Any]:
    """Summary of a medium with its two-way transmission over `RANGE_M`."""
    transmission = math.exp(-2 * RANGE_M * medium.extinction_per_m)
    return medium.summary() | {"two_way_transmission": transmission}


def weather_tables(report: Mapping[str, Any]) -> list[ReportTable]:
    """The table of `WeatherMix.report`, with notes as tables without rows."""
    columns = report["media"] + ([report] if len(report["media"]) > 1 else [])
    titles = [*(column["kind"] for column in report["media"]), "together"][: len(columns)]
    rows = [[title, *(short(column[key]) for column in columns)] for title, key in ROWS.items()]
    notes = []
    if whole := report["rain_with_diffraction"]:
        notes.append(
            "Light diffracted by raindrops, by about a milliradian, counts as unscattered here; a "
            f"narrow link loses it: {whole['extinction_per_m']:.4g} 1/m, "
            f"{whole['extinction_db_per_km']:.3g} dB/km"
        )
    for medium, key in (("fog", "empirical"), ("smoke", "empirical_smoke")):
        if report[key]:
            others = ", ".join(f"{name} {value:.4f}" for name, value in report[key].items())
            notes.append(f"Empirical models valid at this visibility of {medium}, 1/m: {others}")
    first = f"at {report['wavelength_nm']:g} nm"
    return [ReportTable([first, *titles], rows, "\n".join(notes) or None, digits=DIGITS)]


def short(value: float | None) -> str:
    """Four digits, or a dash."""
    return "–" if value is None else f"{value:.4g}"


def typical_weather(wavelength_nm: float) -> dict[str, Atmosphere]:
    """Fogs, hazes, smokes, rain and snow by name."""
    return {
        "heavy advection fog, 50 m": fog(50, "heavy-advection", wavelength_nm=wavelength_nm),
        "moderate radiation fog, 50 m": fog(50, "moderate-radiation", wavelength_nm=wavelength_nm),
        "haze M, 1 km": fog(1000, "haze-m", wavelength_nm=wavelength_nm),
        "haze L, 1 km": fog(1000, "haze-l", wavelength_nm=wavelength_nm),
        "fog machine, 20 m": fog(20, DEFAULT_SMOKE, wavelength_nm=wavelength_nm),
        "soot, 20 m": fog(20, "soot", wavelength_nm=wavelength_nm),
        "biomass smoke, 20 m": fog(20, "biomass", wavelength_nm=wavelength_nm),
        "rain, 25 mm/h": rain(25, wavelength_nm=wavelength_nm),
        "wet snow, 2.5 mm/h": snow(2.5, wavelength_nm=wavelength_nm),
    }


def _empirical(
    visibility: float | None, definition: str, wavelength_nm: float, medium: str = "fog"
) -> dict[str, float]:
    """Extinction of fog or smoke by every valid empirical model."""
    if visibility is None:
        return {}
    return all_extinctions(visibility, definition, wavelength_nm, medium)


def _with_diffraction(rate_mm_per_h: float | None, wavelength_nm: float) -> dict[str, Any] | None:
    """Extinction by rain including diffraction, as for a narrow link."""
    if not rate_mm_per_h:
        return None
    whole = rain(rate_mm_per_h, wavelength_nm=wavelength_nm, diffraction="include").summary()
    return {name: whole[name] for name in ("extinction_per_m", "extinction_db_per_km")}

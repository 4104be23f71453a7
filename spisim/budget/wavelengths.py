"""Wavelengths compared: weather, sunlight, eye safety, and absorption by water and ice."""

from collections.abc import Callable, Mapping
from typing import Any

from reconstruction.base.errors import InputError, nearest
from spisim.atmosphere import Atmosphere, refractive_index
from spisim.atmosphere.report import (
    DIGITS,
    ROWS,
    ReportTable,
    medium_figures,
    short,
    typical_weather,
)
from spisim.budget.eye_safety import accessible_energy_j
from spisim.scene.sun import in_band_irradiance

#: Wavelengths of lidars and cameras that all tables cover.
WAVELENGTHS_NM = (850, 905, 940, 1460, 1550)
#: Width of the band that averages sunlight.
SUN_BAND_NM = 12.0
CONTINUOUS_S, PULSE_S = 100.0, 1e-8
RELATIVE = "extinction, 1550 nm = 1"
OF_WAVELENGTHS = {
    "sun, W/m²/nm at 100 klx": "sun_w_per_m2_nm_100klx",
    "class 1, mean power, W": "class_1_mean_w",
    "class 1, pulse of ns, J": "class_1_pulse_j",
    "k of water": "water_k",
    "k of ice": "ice_k",
}


def wavelength_figures(wavelength_nm: int) -> dict[str, float]:
    """Sunlight, class 1 limits and absorption at one of `WAVELENGTHS_NM`, else InputError."""
    if wavelength_nm not in WAVELENGTHS_NM:
        candidate = nearest(str(wavelength_nm), map(str, WAVELENGTHS_NM))
        raise InputError(f"wavelength_nm {wavelength_nm}: {candidate}")
    mean_w, pulse_j = class_1_limits(wavelength_nm)
    return {
        "sun_w_per_m2_nm_100klx": sun_w_per_m2_nm_100klx(wavelength_nm),
        "class_1_mean_w": mean_w,
        "class_1_pulse_j": pulse_j,
        "water_k": -refractive_index("water", wavelength_nm).imag,
        "ice_k": -refractive_index("ice", wavelength_nm).imag,
    }


def sun_w_per_m2_nm_100klx(wavelength_nm: float) -> float:
    """Daylight, W m⁻² nm⁻¹ per 100 klx, averaged over 12 nm around a wavelength.

    905, 940 and above all 1460 nm lie in bands of water vapour; a few nm away, or in drier air,
    there is up to twice as much.
    """
    half = SUN_BAND_NM / 2
    band = (wavelength_nm - half, wavelength_nm + half)
    return in_band_irradiance(100.0, band) / SUN_BAND_NM


def class_1_limits(wavelength_nm: float) -> tuple[float, float]:
    """Class 1 limits of continuous power (W) and of a single pulse of nanoseconds (J)."""
    mean_w = accessible_energy_j(CONTINUOUS_S, wavelength_nm) / CONTINUOUS_S
    return mean_w, accessible_energy_j(PULSE_S, wavelength_nm)


def compared(medium_at: Callable[[float], Atmosphere]) -> list[dict[str, Any]]:
    """Figures of the same weather at each of `WAVELENGTHS_NM`."""
    reference = medium_at(1550).extinction_per_m
    media = {wavelength_nm: medium_at(wavelength_nm) for wavelength_nm in WAVELENGTHS_NM}
    return [
        {
            "wavelength_nm": wavelength_nm,
            **medium_figures(medium),
            "over_1550_nm": medium.extinction_per_m / reference,
            **wavelength_figures(wavelength_nm),
        }
        for wavelength_nm, medium in media.items()
    ]


def compared_typical() -> list[dict[str, Any]]:
    """Figures of each of `WAVELENGTHS_NM`, with the extinction of typical weather over 1550 nm."""
    reference = typical_weather(1550)
    return [
        {
            "wavelength_nm": wavelength_nm,
            "over_1550_nm": {
                name: medium.extinction_per_m / reference[name].extinction_per_m
                for name, medium in typical_weather(wavelength_nm).items()
            },
            **wavelength_figures(wavelength_nm),
        }
        for wavelength_nm in WAVELENGTHS_NM
    ]


def compared_tables(rows: list[dict[str, Any]]) -> list[ReportTable]:
    """The table of `compared`: a column for each wavelength."""
    return [_side_by_side("wavelength", rows, ROWS | {RELATIVE: "over_1550_nm"} | OF_WAVELENGTHS)]


def typical_tables(rows: list[dict[str, Any]]) -> list[ReportTable]:
    """The tables of `compared_typical`: a column for each wavelength."""
    ratios = [row | row["over_1550_nm"] for row in rows]
    weathers = {name: name for name in rows[0]["over_1550_nm"]}
    return [
        _side_by_side(RELATIVE, ratios, weathers, digits=6),
        _side_by_side("wavelength", rows, OF_WAVELENGTHS),
    ]


def _side_by_side(
    first: str, rows: list[dict[str, Any]], keys: Mapping[str, str], digits: int = DIGITS
) -> ReportTable:
    columns = [first, *(f"{row['wavelength_nm']} nm" for row in rows)]
    lines = [[title, *(short(row[key]) for row in rows)] for title, key in keys.items()]
    return ReportTable(columns, lines, digits=digits)

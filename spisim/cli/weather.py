"""`spisim weather`: what hangs in the air, in numbers, with nothing rendered."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import typer

from reconstruction.base.errors import InputError

from .console import print_json, results, warn
from .options import Json, real_option
from .tables import plain_table, print_table
from .weather_options import Fog, Rain, Smoke, Snow, Visibility

if TYPE_CHECKING:
    from collections.abc import Callable

    from rich.table import Table

    from spisim.atmosphere import Atmosphere

EXAMPLE = "spisim weather --fog heavy-advection --visibility 50 --rain 10 --compare"

DEFAULT_FOG = "moderate-radiation"
#: Range to the target and back, for the light that goes straight.
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
RELATIVE = "extinction, 1550 nm = 1"
OF_WAVELENGTHS = {
    "sun, W/m²/nm at 100 klx": "sun_w_per_m2_nm_100klx",
    "class 1, mean power, W": "class_1_mean_w",
    "class 1, pulse of ns, J": "class_1_pulse_j",
    "k of water": "water_k",
    "k of ice": "ice_k",
}
COMPARED = ROWS | {RELATIVE: "over_1550_nm"} | OF_WAVELENGTHS
#: Digits of a number, with which the five columns of wavelengths fit 80 characters.
DIGITS = 9


def command(
    visibility: Visibility = None,
    fog: Fog = None,
    water: Annotated[
        float | None,
        real_option("Fog of so much liquid water, for --visibility.", metavar="G_PER_M3"),
    ] = None,
    definition: Annotated[
        str, typer.Option(help="Of visibility: koschmieder (2 % contrast) or mor (5 %).")
    ] = "koschmieder",
    rain: Rain = None,
    snow: Snow = None,
    snow_kind: Annotated[str, typer.Option(help="wet or dry.")] = "wet",
    smoke: Smoke = None,
    smoke_kind: Annotated[
        str, typer.Option(help="biomass, soot, glycol-fine or glycol.")
    ] = "glycol",
    wavelength: Annotated[
        float, real_option("Of the instrument.", minimum=700, maximum=1700, metavar="NM")
    ] = 1550.0,
    compare: Annotated[
        bool, typer.Option("--compare", help="850, 905, 940, 1460 and 1550 nm side by side.")
    ] = False,
    json: Json = False,
) -> None:
    """Extinction, albedo, scattering and water of weather, at one wavelength or at five.

    With --compare and no weather, what each wavelength has in typical fogs, smokes, rain and snow.
    """
    from spisim.atmosphere import combine
    from spisim.atmosphere import fog as make_fog
    from spisim.atmosphere import rain as make_rain
    from spisim.atmosphere import snow as make_snow

    kind = fog or DEFAULT_FOG
    fog_visibility = _fog_visibility(visibility, water, fog, definition)
    amounts: dict[Callable[..., Atmosphere], float | None] = {
        partial(make_fog, kind=kind, definition=definition): fog_visibility,
        partial(make_fog, kind=smoke_kind, definition=definition): smoke,
        make_rain: rain,
        partial(make_snow, kind=snow_kind): snow,
    }
    given = [(make, amount) for make, amount in amounts.items() if amount is not None]
    if compare and not given:
        _tell({"compare": _typical()}, _print_typical, json)
        return
    if not given:
        raise InputError(
            "no weather: give --visibility, --water, --rain, --snow or --smoke, or --compare alone"
        )

    def media(wavelength_nm: float) -> list[Atmosphere]:
        return [make(amount, wavelength_nm=wavelength_nm) for make, amount in given]

    parts = media(wavelength)
    together = combine(parts)
    warn(together.warnings)
    report: dict[str, Any] = {
        "wavelength_nm": wavelength,
        **_figures(together),
        "media": [_figures(part) for part in parts],
        "empirical": _empirical(fog_visibility, definition, wavelength),
        "empirical_smoke": _empirical(smoke, "koschmieder", wavelength, "smoke"),
        "rain_with_diffraction": _with_diffraction(rain, wavelength),
        "warnings": together.warnings,
    }
    if compare:
        report["compare"] = _compared(lambda nm: combine(media(nm)))
    _tell(report, _print, json)


def _tell(
    report: dict[str, Any], print_tables: Callable[[dict[str, Any]], None], json: bool
) -> None:
    if json:
        print_json(report)
    else:
        print_tables(report)


def _fog_visibility(
    visibility: float | None, water: float | None, kind: str | None, definition: str
) -> float | None:
    """Visibility of the fog in metres; None where the options give no fog."""
    from spisim.atmosphere import agreed_visibility

    if visibility is None and water is None:
        if kind is not None:
            raise InputError("--fog needs --visibility or --water")
        return None
    return agreed_visibility(visibility, water, kind or DEFAULT_FOG, definition)


def _empirical(
    visibility: float | None, definition: str, wavelength_nm: float, medium: str = "fog"
) -> dict[str, float]:
    """Extinction of fog or smoke by all models that hold for it."""
    from spisim.atmosphere import all_extinctions

    if visibility is None:
        return {}
    return all_extinctions(visibility, definition, wavelength_nm, medium)


def _with_diffraction(rate_mm_per_h: float | None, wavelength_nm: float) -> dict[str, Any] | None:
    """Extinction by rain where light that is bent by a milliradian is lost, as to a narrow link."""
    from spisim.atmosphere import rain

    if not rate_mm_per_h:
        return None
    whole = rain(rate_mm_per_h, wavelength_nm=wavelength_nm, diffraction="include").summary()
    return {name: whole[name] for name in ("extinction_per_m", "extinction_db_per_km")}


def _figures(medium: Atmosphere) -> dict[str, Any]:
    transmission = math.exp(-2 * RANGE_M * medium.extinction_per_m)
    return medium.summary() | {"two_way_transmission": transmission}


def _compared(medium_at: Callable[[float], Atmosphere]) -> list[dict[str, Any]]:
    """The same weather at every wavelength."""
    from spisim.budget.wavelengths import WAVELENGTHS_NM, wavelength_figures

    reference = medium_at(1550).extinction_per_m
    rows = []
    for wavelength_nm in WAVELENGTHS_NM:
        medium = medium_at(wavelength_nm)
        ratio = medium.extinction_per_m / reference
        rows.append(
            {"wavelength_nm": wavelength_nm, **_figures(medium), "over_1550_nm": ratio}
            | wavelength_figures(wavelength_nm)
        )
    return rows


def _typical() -> list[dict[str, Any]]:
    """What each wavelength has in weathers of many kinds, relative to 1550 nm."""
    from spisim.atmosphere.typical import typical_weather
    from spisim.budget.wavelengths import WAVELENGTHS_NM, wavelength_figures

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


def _print(report: dict[str, Any]) -> None:
    columns = report["media"] + ([report] if len(report["media"]) > 1 else [])
    titles = [column["kind"] for column in report["media"]] + ["together"]
    first = f"at {report['wavelength_nm']:g} nm"
    table = plain_table(first, *titles[: len(columns)], minimum=DIGITS)
    for title, key in ROWS.items():
        table.add_row(title, *(_short(column[key]) for column in columns))
    print_table(table)
    if whole := report["rain_with_diffraction"]:
        results.print(
            "Light that rain's drops diffract, by a milliradian, counts as not scattered here; a "
            f"narrow link loses it: {whole['extinction_per_m']:.4g} 1/m, "
            f"{whole['extinction_db_per_km']:.3g} dB/km",
            style="dim",
            soft_wrap=True,
        )
    for medium, key in (("fog", "empirical"), ("smoke", "empirical_smoke")):
        if not report[key]:
            continue
        others = ", ".join(f"{name} {value:.4f}" for name, value in report[key].items())
        results.print(
            f"Empirical models that hold at the {medium}'s visibility have, 1/m: {others}",
            style="dim",
            soft_wrap=True,
        )
    if "compare" in report:
        rows = report["compare"]
        results.print()
        print_table(_side_by_side("wavelength", rows, COMPARED))


def _print_typical(report: dict[str, Any]) -> None:
    rows = report["compare"]
    ratios = [row | row["over_1550_nm"] for row in rows]
    weathers = {name: name for name in rows[0]["over_1550_nm"]}
    print_table(_side_by_side(RELATIVE, ratios, weathers, minimum=6))
    results.print()
    print_table(_side_by_side("wavelength", rows, OF_WAVELENGTHS))


def _side_by_side(
    first: str, rows: list[dict[str, Any]], keys: dict[str, str], minimum: int = DIGITS
) -> Table:
    """A column for each wavelength, with the values under `keys` by their titles."""
    table = plain_table(first, *(f"{row['wavelength_nm']} nm" for row in rows), minimum=minimum)
    for title, key in keys.items():
        table.add_row(title, *(_short(row[key]) for row in rows))
    return table


def _short(value: float | None) -> str:
    return "–" if value is None else f"{value:.4g}"

"""`spisim weather`: optical properties of fog, smoke, rain and snow, without rendering."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from reconstruction.base.errors import InputError

from .console import print_json, results, warn
from .options import Json, real_option
from .tables import print_report
from .weather_options import Fog, Rain, Smoke, Snow, Visibility

EXAMPLE = "spisim weather --fog heavy-advection --visibility 50 --rain 10 --compare"


def command(
    visibility: Visibility = None,
    fog: Fog = None,
    water: Annotated[
        float | None,
        real_option("Liquid water of the fog, instead of --visibility.", metavar="G_PER_M3"),
    ] = None,
    definition: Annotated[
        str, typer.Option(help="Of visibility: koschmieder (2 % contrast) or mor (5 %).")
    ] = "koschmieder",
    rain: Rain = None,
    snow: Snow = None,
    snow_kind: Annotated[str, typer.Option(help="wet or dry.")] = "wet",
    smoke: Smoke = None,
    smoke_kind: Annotated[
        str, typer.Option(help="biomass, soot, flare, fog-machine or hazer.")
    ] = "fog-machine",
    wavelength: Annotated[
        float, real_option("Of the instrument.", minimum=700, maximum=1700, metavar="NM")
    ] = 1550.0,
    compare: Annotated[
        bool, typer.Option("--compare", help="850, 905, 940, 1460 and 1550 nm side by side.")
    ] = False,
    json: Json = False,
) -> None:
    """Extinction, albedo, scattering and water of weather, at one wavelength or at five.

    With --compare and no weather, typical fogs, smokes, rain and snow are compared.
    """
    from spisim.atmosphere.report import DEFAULT_FOG, WeatherMix, fog_visibility, weather_tables
    from spisim.budget.wavelengths import (
        compared,
        compared_tables,
        compared_typical,
        typical_tables,
    )

    if fog is not None and visibility is None and water is None:
        raise InputError("--fog needs --visibility or --water")
    fog_m = fog_visibility(visibility, water, fog, definition)
    mix = WeatherMix(
        fog_m, fog or DEFAULT_FOG, definition, rain, snow, snow_kind, smoke, smoke_kind
    )
    report: dict[str, Any]
    if all(amount is None for amount in (fog_m, rain, snow, smoke)):
        if not compare:
            raise InputError(
                "no weather: give --visibility, --water, --rain, --snow or --smoke, or --compare "
                "alone"
            )
        report = {"compare": compared_typical()}
        tables = typical_tables(report["compare"])
    else:
        report = mix.report(wavelength)
        warn(report["warnings"])
        tables = weather_tables(report)
        if compare:
            report["compare"] = compared(mix.together)
            tables += compared_tables(report["compare"])
    if json:
        print_json(report)
        return
    for number, table in enumerate(tables):
        if number > 0:
            results.print()
        print_report(table)

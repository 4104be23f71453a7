"""Weather options of all commands that simulate light in a scene."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import typer

from reconstruction.base.errors import InputError

from .options import real_option

MIN = 1e-3
"""Minimum of visibilities in metres, and of rates in mm/h."""
Visibility = Annotated[
    float | None,
    real_option("Fog of this visibility, in metres.", "--visibility", minimum=MIN, metavar="M"),
]
Fog = Annotated[
    str | None,
    typer.Option("--fog", metavar="KIND", help="Fog with these droplets, such as heavy-advection."),
]
Rain = Annotated[
    float | None, real_option("Rain of this rate.", "--rain", minimum=MIN, metavar="MM_PER_H")
]
Snow = Annotated[
    float | None, real_option("Snow of this rate.", "--snow", minimum=MIN, metavar="MM_PER_H")
]
Smoke = Annotated[
    float | None,
    real_option("Smoke of this visibility, in metres.", "--smoke", minimum=MIN, metavar="M"),
]
Clear = Annotated[
    bool, typer.Option("--clear", help="Clear air instead of the scene's fog and weather.")
]
Drops = Annotated[bool, typer.Option("--drops", help="Rain or snow of single drops or flakes.")]


@dataclass(frozen=True)
class Weather:
    """Options that replace a scene's own weather; none by default."""

    visibility: Visibility = None
    fog: Fog = None
    rain: Rain = None
    snow: Snow = None
    smoke: Smoke = None
    clear: Clear = False
    drops: bool = False

    def __post_init__(self) -> None:
        """InputError for contradictory options."""
        media = ("visibility", "fog", "rain", "snow", "smoke")
        given = [f"--{name}" for name in media if getattr(self, name) is not None]
        if self.clear and given:
            raise InputError(f"--clear and {given[0]} exclude each other")
        if self.drops and self.rain is None and self.snow is None:
            raise InputError("--drops goes with --rain or --snow")

    def sections(self, own: Mapping[str, Any]) -> dict[str, Any]:
        """Sections that replace the `own` ones of a scene file; None removes a section."""
        from spisim.atmosphere.sections import WEATHER

        if self.clear:
            return dict.fromkeys((*WEATHER, "volumes"))
        model = {"model": "drops"} if self.drops else {}
        changed: dict[str, Any] = {
            name: {"rate_mm_per_h": rate} | model
            for name, rate in (("rain", self.rain), ("snow", self.snow))
            if rate is not None
        }
        if self.smoke is not None:
            changed["smoke"] = {"visibility_m": self.smoke}
        if self.visibility is not None or self.fog is not None:
            changed["fog"] = _fog(own.get("fog") or {}, self.visibility, self.fog)
        return changed


@dataclass(frozen=True)
class WeatherOfDrops(Weather):
    """Weather whose drops may be single, for commands that record over time."""

    drops: Drops = False


OWN_WEATHER = Weather()
OWN_WEATHER_OF_DROPS = WeatherOfDrops()


def _fog(old: dict[str, Any], visibility_m: float | None, kind: str | None) -> dict[str, Any]:
    """The scene's fog section with another visibility, other droplets, or both."""
    retained = {"kind", "droplets", "definition", "phase"}
    if visibility_m is None:
        retained |= {"visibility_m", "liquid_water_g_per_m3"}
    if kind is not None:
        retained -= {"kind", "droplets"}
    new = {field: value for field, value in old.items() if field in retained}
    if not isinstance(new.get("phase", ""), str):  # the phase function of a medium by coefficients
        del new["phase"]
    if visibility_m is not None:
        new["visibility_m"] = visibility_m
    if kind is not None:
        new["kind"] = kind
    if not new.keys() & {"visibility_m", "liquid_water_g_per_m3"}:
        raise InputError("--fog needs --visibility: the scene's own fog has none")
    return new

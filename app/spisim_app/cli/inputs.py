"""Load scene and instrument with the changes of the command line."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any
from warnings import catch_warnings, simplefilter

import typer
import yaml

from reconstruction.base.errors import InputError

from . import options as opt
from .console import warn
from .weather_options import OWN_WEATHER, Weather

if TYPE_CHECKING:
    from spisim.instrument import Instrument
    from spisim.scene import Scene


@dataclass(frozen=True)
class PlanOptions:
    """A pattern plan that replaces the instrument's own, as far as it is given."""

    patterns: Annotated[int | None, opt.number_option(1, 2**31, "Patterns per frame.")] = None
    order: Annotated[str | None, typer.Option(help="Which patterns come first.")] = None
    polarity: Annotated[str | None, typer.Option(help="differential or single-ended.")] = None
    interleave: Annotated[
        int | None, opt.number_option(1, 256, "Frames that patterns are dealt out to.")
    ] = None


OWN_PLAN = PlanOptions()


def scene_with(
    name: str, wavelength_nm: float, weather: Weather = OWN_WEATHER
) -> tuple[Scene, list[str]]:
    """Load a scene at a wavelength, with the weather of the command line instead of its own.

    The scene's text changes too, so that a capture records it. Warnings are printed and returned.
    """
    from spisim.scene import SceneWarning, load_scene

    with catch_warnings(record=True) as odd:
        simplefilter("always", SceneWarning)
        scene = load_scene(name, weather.sections, wavelength_nm=wavelength_nm)
    warnings = [str(warning.message) for warning in odd]
    warn(warnings)
    return scene, warnings


def captures_in(names: Iterable[Path]) -> list[Path]:
    """Return captures by name, and those of folders in order. Raises InputError for none."""
    files: list[Path] = []
    for name in names:
        inside = sorted(name.glob("*.h5")) if name.is_dir() else [name]
        if not inside:
            raise InputError(f"{name}: no captures (.h5) in this folder")
        files += inside
    return files


def _weather(stated: str) -> str | float:
    """Parse weather as in an instrument file. Raises InputError."""
    from reconstruction.ranging.weather import WORDS
    from reconstruction.ranging.weather import Weather as StatedWeather

    visibility_m = StatedWeather.parsed(stated).visibility_m
    return stated.strip() if stated.strip() in WORDS else visibility_m


def instrument_with(
    name: str,
    wavelength_nm: float | None = None,
    stated: str | None = None,
    plan: PlanOptions = OWN_PLAN,
) -> Instrument:
    """Load an instrument with the wavelength, plan and weather of the command line."""
    from spisim.base.config import dump_yaml, parse_model
    from spisim.instrument import Instrument, load_instrument

    instrument = load_instrument(name)
    if wavelength_nm is not None:
        instrument = instrument.at_wavelength(wavelength_nm)
    changes = {key: value for key, value in asdict(plan).items() if value is not None}
    if not changes and stated is None:
        return instrument
    fields: dict[str, Any] = yaml.safe_load(instrument.text)
    if changes:
        instrument.imaging  # noqa: B018 - raises where there are no patterns
        fields["plan"] |= changes
    if stated is not None:
        fields["weather"] = _weather(stated)
    return parse_model(dump_yaml(fields), Instrument, "pattern plan of the command line")

"""Scene and instrument, as the command line changes them."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any
from warnings import catch_warnings, simplefilter

import yaml

from reconstruction.errors import InputError

from .console import warn

if TYPE_CHECKING:
    from spisim.instrument import Instrument
    from spisim.scene import Scene


def scene_with(
    name: str,
    wavelength_nm: float,
    visibility_m: float | None,
    clear: bool,
    fog_kind: str | None = None,
    rain_mm_per_h: float | None = None,
    drops: bool = False,
    *,
    snow_mm_per_h: float | None = None,
    smoke_m: float | None = None,
) -> tuple[Scene, list[str]]:
    """Load a scene at a wavelength and replace its weather where the command line says so.

    The scene's text is changed along, so that a capture tells how to make it again. Its warnings
    are printed, and returned too.
    """
    from spisim.atmosphere.sections import WEATHER
    from spisim.config import load_yaml
    from spisim.scene import SceneWarning, load_scene

    options = {
        "--visibility": visibility_m,
        "--fog": fog_kind,
        "--rain": rain_mm_per_h,
        "--snow": snow_mm_per_h,
        "--smoke": smoke_m,
    }
    given = [option for option, value in options.items() if value is not None]
    if clear and given:
        raise InputError(f"--clear and {given[0]} exclude each other")
    if drops and rain_mm_per_h is None and snow_mm_per_h is None:
        raise InputError("--drops goes with --rain or --snow")
    with catch_warnings(record=True) as odd:
        simplefilter("always", SceneWarning)
        scene = load_scene(name, wavelength_nm=wavelength_nm)
        changes: dict[str, Any] = {}
        if clear:
            changes = dict.fromkeys((*WEATHER, "volumes"))
        if visibility_m is not None or fog_kind is not None:
            changes["fog"] = _fog(load_yaml(scene.text, name).get("fog"), visibility_m, fog_kind)
        model = {"model": "drops"} if drops else {}
        for section, rate_mm_per_h in (("rain", rain_mm_per_h), ("snow", snow_mm_per_h)):
            if rate_mm_per_h is not None:
                changes[section] = {"rate_mm_per_h": rate_mm_per_h} | model
        if smoke_m is not None:
            changes["smoke"] = {"visibility_m": smoke_m}
        if changes:
            odd.clear()
            scene = load_scene(name, changes, wavelength_nm=wavelength_nm)
    warnings = [str(warning.message) for warning in odd]
    warn(warnings)
    return scene, warnings


def captures_in(names: Iterable[Path]) -> list[Path]:
    """Captures by their names, those of folders in the order of theirs; InputError for none."""
    found: list[Path] = []
    for name in names:
        inside = sorted(name.glob("*.h5")) if name.is_dir() else [name]
        if not inside:
            raise InputError(f"{name}: there is no capture (.h5) in this folder")
        found += inside
    return found


def _fog(
    old: dict[str, Any] | None, visibility_m: float | None, kind: str | None
) -> dict[str, Any]:
    """The scene's fog with another visibility, other droplets, or both."""

    kept = {"kind", "droplets", "definition", "phase"}
    if visibility_m is None:
        kept |= {"visibility_m", "liquid_water_g_per_m3"}
    if kind is not None:
        kept -= {"kind", "droplets"}
    new = {field: value for field, value in (old or {}).items() if field in kept}
    if not isinstance(new.get("phase", ""), str):  # of a medium by coefficients
        del new["phase"]
    if visibility_m is not None:
        new["visibility_m"] = visibility_m
    if kind is not None:
        new["kind"] = kind
    if not new.keys() & {"visibility_m", "liquid_water_g_per_m3"}:
        raise InputError("--fog needs --visibility: the scene's own fog has none")
    return new


def instrument_with(
    name: str,
    wavelength_nm: float | None = None,
    patterns: int | None = None,
    order: str | None = None,
    polarity: str | None = None,
    interleave: int | None = None,
) -> Instrument:
    """Load an instrument; move it and change its pattern plan where the command line says so."""
    from spisim.config import dump_yaml, parse_model
    from spisim.instrument import Instrument, load_instrument

    instrument = load_instrument(name)
    if wavelength_nm is not None:
        instrument = instrument.at_wavelength(wavelength_nm)
    plan = {
        "patterns": patterns,
        "order": order,
        "polarity": polarity,
        "interleave": interleave,
    }
    changes = {key: value for key, value in plan.items() if value is not None}
    if not changes:
        return instrument
    fields: dict[str, Any] = yaml.safe_load(instrument.text)
    fields["plan"] |= changes
    return parse_model(dump_yaml(fields), Instrument, "pattern plan of the command line")

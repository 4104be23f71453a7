"""Scene and instrument, as the command line changes them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any
from warnings import catch_warnings, simplefilter

import yaml

from .console import warn

if TYPE_CHECKING:
    from spisim.instrument import Instrument
    from spisim.scene import Scene


def scene_with(name: str, visibility_m: float | None, clear: bool) -> Scene:
    """Load a scene and replace its fog where the command line says so.

    The scene's text is changed along, so that a capture tells how to make it again.
    """
    from reconstruction.errors import InputError
    from spisim.atmosphere import CLEAR, fog
    from spisim.scene import SceneWarning, load_scene

    if clear and visibility_m is not None:
        raise InputError("--clear and --visibility exclude each other")
    with catch_warnings(record=True) as odd:
        simplefilter("always", SceneWarning)
        scene = load_scene(name)
    warn(str(warning.message) for warning in odd)
    description = yaml.safe_load(scene.text)
    if clear:
        description = {k: v for k, v in description.items() if k not in ("fog", "volumes")}
        text = yaml.safe_dump(description, sort_keys=False)
        return replace(scene, atmosphere=CLEAR, volumes=(), text=text)
    if visibility_m is None:
        return scene
    old = description.get("fog") or {}
    new = {key: old[key] for key in ("kind", "definition") if key in old}
    description["fog"] = {"visibility_m": visibility_m} | new
    atmosphere = fog(visibility_m, **new)
    return replace(scene, atmosphere=atmosphere, text=yaml.safe_dump(description, sort_keys=False))


def instrument_with(
    name: str, patterns: int | None = None, order: str | None = None, polarity: str | None = None
) -> Instrument:
    """Load an instrument and replace parts of its pattern plan where the command line says so."""
    from spisim.config import parse_model
    from spisim.instrument import Instrument, load_instrument

    instrument = load_instrument(name)
    plan = {"patterns": patterns, "order": order, "polarity": polarity}
    changes = {key: value for key, value in plan.items() if value is not None}
    if not changes:
        return instrument
    fields: dict[str, Any] = yaml.safe_load(instrument.text)
    fields["plan"] |= changes
    return parse_model(yaml.safe_dump(fields), Instrument, "pattern plan of the command line")

"""Summaries of the shipped scenes, without loading them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import yaml

from spisim.atmosphere.sections import WEATHER
from spisim.base.config import read_text
from spisim.scene.load import list_scenes, scenes_folder


@dataclass(frozen=True)
class Entry:
    """A shipped scene; `family` is None if all its objects are in its file."""

    name: str
    description: str
    family: str | None
    weather: tuple[str, ...]  # such as "fog 200 m"; empty for clear air


def catalogue() -> list[Entry]:
    """Summaries of the shipped scenes, sorted by name."""
    return [_entry(name) for name in list_scenes()]


def _entry(name: str) -> Entry:
    fields = yaml.safe_load(read_text(scenes_folder() / f"{name}.yaml"))
    return Entry(name, fields.get("description", ""), fields.get("family"), weather(fields))


def weather(fields: Mapping[str, Any]) -> tuple[str, ...]:
    """The media in a scene file's fields, as short descriptions."""
    units = {
        "visibility_m": "m",
        "liquid_water_g_per_m3": "g/m³",
        "extinction_per_m": "/m",
        "rate_mm_per_h": "mm/h",
    }
    result = []
    for medium in WEATHER:
        section = fields.get(medium) or {}
        available = [f"{medium} {section[f]:g} {unit}" for f, unit in units.items() if f in section]
        result += available or ([medium] if section else [])
    result += [f"volume {volume['name']}" for volume in fields.get("volumes") or ()]
    return tuple(result)

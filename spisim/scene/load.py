"""Scenes listed, loaded from files and drawn from families."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from reconstruction.base.arrays import usual_float_errors
from spisim.atmosphere.sections import WEATHER
from spisim.base.config import check_fields, dump_yaml, find_named, read_mapping, read_text, shipped
from spisim.base.config.yaml import load_yaml
from spisim.scene.assemble import assemble, check_drone, warn_of_oddities
from spisim.scene.description import DrawnDescription, DroneState, SceneDescription
from spisim.scene.drawn import draw
from spisim.scene.drone import at_drone_state
from spisim.scene.load_context import LoadContext, SceneCache
from spisim.scene.model import Scene


def scenes_folder() -> Path:
    """Folder of the shipped scenes; InputError if it is missing."""
    return shipped("scenes")


def list_scenes() -> list[str]:
    """Sorted names of the shipped scenes."""
    return sorted(path.stem for path in scenes_folder().glob("*.yaml"))


@usual_float_errors
def load_scene(
    path: str | Path,
    changes: Mapping[str, Any] | Callable[[Mapping[str, Any]], Mapping[str, Any]] | None = None,
    *,
    wavelength_nm: float = 1550.0,
) -> Scene:
    """Load a scene from a YAML file, or a shipped one by its name ("warehouse").

    Parameters
    ----------
    path : str or Path
        The scene file, or the name of a shipped scene.
    changes : mapping or callable, optional
        Top-level sections that replace the file's own, in the scene's text too; None removes a
        section. A callable gets the file's sections and returns those to replace.
    wavelength_nm : float
        Wavelength of the instrument, at which materials and weather are made.

    Raises
    ------
    InputError
        Names file, field, value and what is allowed, for a file, mesh, picture or table that is
        missing or unusable, fields that are unknown, missing or out of range, an unknown material,
        duplicate names, a drone inside an object, and a family that cannot be drawn.

    Warns
    -----
    SceneWarning
        For unsound or oddly sized meshes, overlapping volumes, and unnatural daylight or weather.
    """
    file = find_named(str(path), scenes_folder(), "scene")
    text = read_text(file)
    if changes:
        fields = read_mapping(text, SceneDescription, file)
        kind = DrawnDescription if "family" in fields else SceneDescription
        check_fields(fields, kind, file)  # the unchanged file must be valid too
        if changed := changes(fields) if callable(changes) else changes:
            sections = {**fields, **changed}
            text = dump_yaml({name: each for name, each in sections.items() if each is not None})
    return make_scene(text, file.parent, file, wavelength_nm=wavelength_nm)


def draw_scene(
    family: str,
    seed: int = 0,
    parameters: Mapping[str, Any] | None = None,
    changes: Mapping[str, Any] | None = None,
    *,
    wavelength_nm: float = 1550.0,
) -> Scene:
    """Draw a scene of a family; equal seeds and parameters give equal scenes.

    Parameters
    ----------
    family : str
        Name of the family.
    seed : int
        Seed of all that `parameters` leave open.
    parameters : mapping, optional
        Fixed parameters of the family.
    changes : mapping, optional
        Other sections of a scene file, such as fog.
    wavelength_nm : float
        As for `load_scene`, which raises and warns alike.
    """
    sections = {"family": family, "seed": seed, "parameters": dict(parameters or {})}
    text = dump_yaml({**sections, **(changes or {})})
    return make_scene(text, Path(), f"family {family}", wavelength_nm=wavelength_nm)


def make_scene(
    text: str,
    folder: Path,
    source: Path | str,
    *,
    wavelength_nm: float = 1550.0,
    cache: SceneCache | None = None,
) -> Scene:
    """Make a scene from the text of a scene file.

    Parameters
    ----------
    text : str
        YAML of the scene file.
    folder : Path
        Folder that file names are relative to.
    source : Path or str
        What messages call the file.
    wavelength_nm : float
        As for `load_scene`, which raises and warns alike.
    cache : SceneCache, optional
        Shares parts with other scenes made with it.
    """
    context = LoadContext(folder, text, source, wavelength_nm, cache or SceneCache())
    fields = read_mapping(text, SceneDescription, source)
    if "family" in fields:
        scene = draw(fields, context).scene
    else:
        scene = assemble(check_fields(fields, SceneDescription, source), context)
    check_drone(scene, source)
    if fields.get("moment") is not None:
        state = DroneState.model_validate(fields["moment"])  # checked with the other fields
        scene = replace(at_drone_state(scene, state), text=text)
        check_drone(scene, source)
    warn_of_oddities(scene)
    return scene


@dataclass(frozen=True)
class Entry:
    """A shipped scene; `family` is None if all its objects are in its file."""

    name: str
    description: str
    family: str | None
    weather: tuple[str, ...]  # such as "fog 200 m"; empty for clear air


def catalogue() -> list[Entry]:
    """Summaries of the shipped scenes, sorted by name."""
    entries = []
    for name in list_scenes():
        fields = load_yaml(read_text(scenes_folder() / f"{name}.yaml"), name)
        family = fields.get("family")
        entries.append(Entry(name, fields.get("description", ""), family, weather(fields)))
    return entries


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

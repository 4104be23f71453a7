"""Scene and instrument files of a fitted twin."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from reconstruction.base.files import mark, write_atomically
from spisim.atmosphere.sections import WEATHER
from spisim.base.config import dump_yaml, parse_model
from spisim.instrument import Instrument
from spisim.scene import Material, Scene
from spisim.scene.bsdf import BSDFS
from spisim_inverse.fit.parameters import MATERIAL
from spisim_inverse.fit.result import Fitted

SCENE, INSTRUMENT = "fitted scene", "fitted instrument"
FILES = ("mesh", "density", "picture", "texture", "opacity")
"""Fields of a scene that name files."""


def scene_text(fitted: Fitted, folder: Path) -> str:
    """The scene's YAML with the estimates; files that it names are looked up in ``folder``."""
    scene = fitted.twin.scene
    fields = _absolute(yaml.safe_load(scene.text), folder)
    names = [each.name for each in fitted.estimates]
    if any(name.startswith("scene.fog.") for name in names):
        _put_fog(fields, scene)
    for name in names:
        if name.startswith(MATERIAL):
            _put_reflectance(fields, scene, name.removeprefix(MATERIAL))
    return dump_yaml(fields)


def instrument_text(fitted: Fitted) -> str:
    """The instrument's YAML with the estimates; offsets in counts are rounded."""
    twin = fitted.twin
    fields = yaml.safe_load(twin.instrument.text)
    for scale, detector in (
        (twin.buckets, fields.get("detector")),
        (twin.spots, (fields.get("tof") or {}).get("detector")),
    ):
        if scale is not None and detector is not None and detector.get("adc"):
            adc = detector["adc"]
            adc["full_scale_electrons"] = float(scale.electrons_per_count * 2 ** adc["bits"])
            adc["offset_counts"] = max(round(scale.offset_counts), 0)
    text = dump_yaml(fields)
    parse_model(text, Instrument, "fitted instrument")  # it must load
    return text


def write_fitted(fitted: Fitted, scene: Path | None, instrument: Path | None, folder: Path) -> None:
    """Write what was asked for; raises OSError if a file cannot be written."""
    offset_m = fitted.twin.range_offset_m
    for path, kind, text in (
        (scene, SCENE, None if scene is None else scene_text(fitted, folder)),
        (instrument, INSTRUMENT, None if instrument is None else instrument_text(fitted)),
    ):
        if path is None or text is None:
            continue
        note = f"# ranges of spots are {offset_m:+.4g} m off\n" if offset_m else ""
        write_atomically(path, f"# {mark(kind)}\n{note}{text}".encode())


def _put_fog(fields: dict[str, Any], scene: Scene) -> None:
    air = scene.atmosphere
    name = next(each for each in WEATHER if fields.get(each))
    section = {
        key: value
        for key, value in fields[name].items()
        if key not in ("visibility_m", "liquid_water_g_per_m3", "extinction_per_m")
    }
    if air.visibility_m is None:
        fields[name] = section | {"extinction_per_m": float(air.extinction_per_m)}
    else:
        fields[name] = section | {"visibility_m": float(air.visibility_m)}


def _put_reflectance(fields: dict[str, Any], scene: Scene, name: str) -> None:
    material = next(each.material for each in scene.objects if each.material.name == name)
    own = fields.setdefault("materials", {})
    described = own.get(name) or _described(material)
    own[name] = described | {"reflectance": float(material.reflectance)}


def _described(material: Material) -> dict[str, Any]:
    kind = next(name for name, model in BSDFS.items() if type(material.bsdf) is model)
    return {"source": f"fitted to a recording; before: {material.source}", "bsdf": kind} | dict(
        vars(material.bsdf)
    )


def _absolute(value: Any, folder: Path, key: str = "") -> Any:
    """The fields of a scene with the files that they name where they are."""
    if isinstance(value, Mapping):
        return {name: _absolute(each, folder, name) for name, each in value.items()}
    if isinstance(value, list):
        return [_absolute(each, folder, key) for each in value]
    if isinstance(value, str) and key in FILES and (folder / value).is_file():
        return str((folder / value).resolve())
    return value

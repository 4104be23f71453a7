"""Two boards in fog, one behind the other, recordings of them, and fits to these."""

from functools import cache
from pathlib import Path

import yaml

import spisim
from reconstruction import Capture
from spisim.base.config import dump_yaml, parse_model
from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.scene.load import make_scene
from spisim_inverse.fit.fitting import fit
from spisim_inverse.fit.result import Fitted

VISIBILITY, BOARD, HIDDEN = "scene.fog.visibility_m", "materials.board", "materials.hidden"
GAIN, DARK = "buckets.electrons_per_count", "buckets.offset_counts"
OFFSET, LASER, POWER = "spots.range_offset_m", "lasers.power_w", "projector.power_w"
SPP, FRAMES = 16, 4
PARTS = {"board": 4.0, "hidden": 60.0}
"""Distances of two boards, of which the far one is hidden behind the near one."""


def instrument_of(method: str = "paper", **parts: dict) -> Instrument:
    """A preset with few pixels, and changed fields of its parts."""
    fields = yaml.safe_load(spisim.load_instrument(method).text)
    if "projector" in fields:
        fields["projector"]["shape"] = [8, 8]
        fields["plan"] = {"patterns": 15, "order": "sequency-2d", "polarity": "single-ended"}
    for name, changes in parts.items():
        fields[name] |= changes
    fields.pop("eye_safety", None)
    return parse_model(dump_yaml(fields), Instrument, "instrument")


@cache
def boards(visibility_m: float | None = 60.0, reflectance: float = 0.4) -> Scene:
    boxes = [
        {
            "name": name,
            "shape": "box",
            "size_m": [6, 0.02, 6],
            "translate_m": [0, distance_m, 0],
            "material": name,
        }
        for name, distance_m in PARTS.items()
    ]
    materials = {name: {"reflectance": reflectance, "source": "test"} for name in PARTS}
    fields = {
        "name": "boards",
        "drone": {"position_m": [0, 0, 0], "look_at_m": [0, 1, 0]},
        "objects": boxes,
        "materials": materials,
    }
    if visibility_m is not None:
        fields["fog"] = {"visibility_m": visibility_m}
    return make_scene(dump_yaml(fields), Path(), "boards")


@cache
def recorded(visibility_m: float | None = 60.0, method: str = "paper") -> Capture:
    scene = boards(visibility_m)
    made = spisim.simulate(scene, instrument_of(method), spp=256, seed=3, frames=FRAMES)
    return made.capture


def fitted(free: dict, capture: Capture | None = None, **options) -> Fitted:
    capture = recorded() if capture is None else capture
    options = {"spp": SPP, "seed": 5} | options
    scene, instrument = options.pop("scene", boards()), options.pop("instrument", instrument_of())
    return fit(capture, scene, instrument, free, **options)

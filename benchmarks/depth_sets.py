"""Captures for benchmarks/depth.py: drawn and shipped scenes, traced, in clear air and two fogs."""

import math
import subprocess
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import spisim.dataset
from spisim.config import dump_yaml
from spisim.scene import list_scenes
from spisim.scene.families import FAMILIES

LEARNED_FROM = (
    *("forest-trail", "hovering-drone", "person", "reflective-shelf", "scaffold"),
    *("street-canyon", "warehouse", "forest-edge", "landing-approach", "facade", "valley-line"),
)
JUDGED_BY = (
    *("landing-pad", "power-line", "racing-gates", "rubble", "stairwell", "targets", "tunnel"),
    *("bridge", "field", "shipyard"),
)
"""Families that nothing was ever fitted to or trained on."""
GROUPS = ("unseen seeds", "unseen families", "shipped scenes")
PRESETS = ("paper", "fog")
KINDS = ("moderate-radiation", "heavy-radiation", "moderate-advection", "heavy-advection")
FOGS_M = {"fog 150–500 m": (150.0, 500.0), "fog 50–150 m": (50.0, 150.0)}
WEATHERS = ("clear", *FOGS_M)
SEED = 20261123
CAPTURES = 200
"""Of each group and weather, at least, by all presets together."""
POSES = 2
"""Of each drawn scene."""


@dataclass(frozen=True)
class Case:
    """A capture's file, and the cell of the tables that it belongs to; scenes are independent."""

    path: Path
    group: str
    weather: str
    preset: str
    scene: str


def captures(folder: Path, *, quick: bool) -> Iterator[Case]:
    """All captures; those that `folder` lacks are made first."""
    for group in GROUPS:
        place = folder / group.replace(" ", "-")
        plan = place.with_suffix(".yaml")
        folder.mkdir(parents=True, exist_ok=True)
        plan.write_text(dump_yaml(plan_of(group, quick=quick)))
        subprocess.run([sys.executable, "-m", "spisim", "dataset", str(plan), "-o", str(place)],
                       check=True)  # fmt: skip
        for sample in spisim.dataset.open(place):
            told = sample.parameters
            yield Case(sample.path, group, weather_of(told), told["instrument"], sample.scene_name)


def plan_of(group: str, *, quick: bool) -> dict[str, Any]:
    """Plan of a group: every scene or family, weather and preset, as often as it takes."""
    scenes = scenes_of(group)[: 1 if quick else None]
    cells = len(WEATHERS) * len(PRESETS)
    each = CAPTURES / len(scenes) / len(PRESETS)
    rounds = 1 if quick else POSES * math.ceil(each / POSES)
    fogs = [
        {"scene.fog": {"kind": {"choice": list(KINDS)}, "visibility_m": {"log_uniform": list(m)}}}
        for m in FOGS_M.values()
    ]
    return {
        "name": group,
        "samples": len(scenes) * cells * rounds,
        "seed": SEED,
        "scenes": scenes,
        "every_scene": True,
        "poses": rounds if group == "shipped scenes" else min(POSES, rounds),
        "instrument": {"grid": list(PRESETS)},
        "vary": {
            "scene.rain": None,
            "scene.snow": None,
            "weather": {"grid": [{"scene.fog": None}, *fogs]},
        },
        "transport_noise_share": 0.5,
    }


def scenes_of(group: str) -> list[dict[str, str]]:
    """Sources of a group's scenes, those that there are."""
    if group == "shipped scenes":
        return [{"scene": name} for name in list_scenes()]
    families = LEARNED_FROM if group == "unseen seeds" else JUDGED_BY
    return [{"family": name} for name in families if name in FAMILIES]


def weather_of(parameters: Mapping[str, Any]) -> str:
    """Clear, or the fog in whose range the visibility is."""
    visibility_m = parameters.get("scene.fog.visibility_m")
    if visibility_m is None:
        return "clear"
    return next(name for name, (low, high) in FOGS_M.items() if low <= visibility_m <= high)

"""Captures for benchmarks/depth.py: drawn and shipped scenes, traced, in clear air and two fogs."""

import math
import subprocess
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from depth_worlds import imported

import spisim.dataset
from spisim.base.config import dump_yaml
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
DRAWN = {"unseen seeds": LEARNED_FROM, "unseen families": JUDGED_BY}
SHIPPED, WORLDS = "shipped scenes", "worlds of others"
GROUPS = (*DRAWN, SHIPPED, WORLDS)
PRESETS = ("paper", "fog")
KINDS = ("moderate-radiation", "heavy-radiation", "moderate-advection", "heavy-advection")
FOGS_M = {"fog 150–500 m": (150.0, 500.0), "fog 50–150 m": (50.0, 150.0)}
WEATHERS = ("clear", *FOGS_M)
SEED = 20261123
CAPTURES = 200
"""Of each group and weather, at least, by all presets together, unless fewer are asked for."""
POSES, POSES_OF_FILES = 2, 6
"""Of each drawn scene, and of each scene file."""


@dataclass(frozen=True)
class Case:
    """A capture's file, and the cell of the tables that it belongs to; scenes are independent."""

    path: Path
    group: str
    weather: str
    preset: str
    scene: str


def captures(
    folder: Path, *, worlds: Path | None, wanted: int = CAPTURES, quick: bool
) -> Iterator[Case]:
    """All captures; those that `folder` lacks are made first.

    ``wanted`` is the number of each group and weather. Worlds of others are those of which the
    folder ``worlds`` has a checkout; without it that group is left out.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for group in GROUPS:
        position = folder / group.replace(" ", "-")
        every = scenes_of(group, worlds, position.with_name(f"{position.name}-scenes"))
        scenes = list(islice(every, 1 if quick else None))
        if not scenes:
            continue
        plan = position.with_suffix(".yaml")
        plan.write_text(dump_yaml(plan_of(group, scenes, 1 if quick else wanted)))
        subprocess.run([sys.executable, "-m", "spisim", "dataset", str(plan), "-o", str(position)],
                       check=True)  # fmt: skip
        for sample in spisim.dataset.open(position):
            reported = sample.parameters
            yield Case(
                sample.path, group, weather_of(reported), reported["instrument"], sample.scene_name
            )


def plan_of(group: str, scenes: list[dict[str, str]], wanted: int) -> dict[str, Any]:
    """Plan of a group: every scene or family, weather and preset, as often as it takes."""
    cells = len(WEATHERS) * len(PRESETS)
    rounds = math.ceil(wanted / len(scenes) / len(PRESETS))
    if rounds > 1:
        rounds = POSES * math.ceil(rounds / POSES)
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
        "poses": POSES if group in DRAWN else POSES_OF_FILES,
        "instrument": {"grid": list(PRESETS)},
        "vary": {
            "scene.rain": None,
            "scene.snow": None,
            "weather": {"grid": [{"scene.fog": None}, *fogs]},
        },
        "transport_noise_share": 0.5,
    }


def scenes_of(group: str, worlds: Path | None, folder: Path) -> Iterator[dict[str, str]]:
    """Sources of a group's scenes, those that there are; worlds are imported into ``folder``."""
    if group in DRAWN:
        yield from ({"family": name} for name in DRAWN[group] if name in FAMILIES)
    elif group == SHIPPED:
        yield from ({"scene": name} for name in list_scenes())
    elif worlds is not None:
        yield from ({"scene": str(file.resolve())} for file in imported(worlds, folder))


def weather_of(parameters: Mapping[str, Any]) -> str:
    """Clear, or the fog in whose range the visibility is."""
    visibility_m = parameters.get("scene.fog.visibility_m")
    if visibility_m is None:
        return "clear"
    return next(name for name, (low, high) in FOGS_M.items() if low <= visibility_m <= high)

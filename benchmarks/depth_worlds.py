"""Worlds of others for benchmarks/depth.py, imported from checkouts of public repositories."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple


class World(NamedTuple):
    """A ``file`` in the checkout of a GitHub ``repository``, and where its models are."""

    repository: str
    file: str
    models: tuple[str, ...] = ()


ROBOMAKER = "aws-robotics/aws-robomaker-{}-world"
CLEARPATH = "clearpathrobotics/cpr_gazebo"
COLLECTION = "leonhartyao/gazebo_models_worlds_collection"
MAPS = "engcang/gazebo_maps"
OSRF = "../gazebo_models"
"""Beside the others: a checkout of osrf/gazebo_models."""
WORLDS = {
    "agriculture": World(CLEARPATH, "cpr_agriculture_gazebo/meshes/agriculture_world.dae"),
    "aisle": World(MAPS, "competition_2021add/aisle.world", (OSRF,)),
    "arena": World(COLLECTION, "worlds/fetchit_challenge_simple.world", ("models", OSRF)),
    "barrels": World(COLLECTION, "worlds/barrels.world", ("models", OSRF)),
    "bookstore": World(ROBOMAKER.format("bookstore"), "worlds/bookstore.world", ("", "models")),
    "competition-a": World(MAPS, "competition_2021add/A.world", ("competition_2021add", OSRF)),
    "competition-b": World(MAPS, "competition_2021add/B.world", ("competition_2021add", OSRF)),
    "construction": World(CLEARPATH, "cpr_office_gazebo/meshes/office_construction.dae"),
    "house": World(COLLECTION, "worlds/house.world", ("models", OSRF)),
    "inspection": World(CLEARPATH, "cpr_inspection_gazebo/meshes/inspection_world.dae"),
    "neighborhood": World(COLLECTION, "worlds/neighborhood.world", ("models", OSRF)),
    "obstacles": World(CLEARPATH, "cpr_obstacle_gazebo/models/obstacle_world.stl"),
    "office": World(CLEARPATH, "cpr_office_gazebo/meshes/office.dae"),
    "orchard": World(CLEARPATH, "cpr_orchard_gazebo/meshes/orchard_world.dae"),
    "power-plant": World(COLLECTION, "worlds/powerplant.world", ("models", OSRF)),
    "race-track": World(COLLECTION, "worlds/drone_race_track_2018_actual.world", ("models", OSRF)),
    "rubble-of-others": World(COLLECTION, "worlds/rubble.world", ("models", OSRF)),
    "safe-landing": World("PX4/PX4-SITL_gazebo-classic", "worlds/safe_landing.world", ("models",)),
    "small-house": World(ROBOMAKER.format("small-house"), "worlds/small_house.world", ("models",)),
    "small-office": World(COLLECTION, "worlds/office_small.world", ("models", OSRF)),
    "small-warehouse": World(
        ROBOMAKER.format("small-warehouse"), "worlds/small_warehouse.world", ("models",)
    ),
    "space-lab": World("PX4/PX4-gazebo-models", "worlds/kthspacelab.sdf", ("models",)),
    "waypoints": World(COLLECTION, "worlds/waypoint.world", ("models", OSRF)),
}
"""None of these was ever fitted to or trained on."""


def imported(checkouts: Path, folder: Path) -> Iterator[Path]:
    """Scene files in ``folder`` of those worlds that are among the checkouts; made once."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, world in WORLDS.items():
        root, scene = checkouts / world.repository.partition("/")[2], folder / f"{name}.yaml"
        if not scene.exists() and (root / world.file).exists():
            paths = [each for path in world.models for each in ("--model-path", str(root / path))]
            command = [sys.executable, "-m", "spisim", "scenes", "import", str(root / world.file)]
            subprocess.run(
                [*command, "-o", str(scene), "--skip-missing", *paths],
                check=False,  # what cannot be imported is told, and left out
                stdout=subprocess.DEVNULL,
            )
        if scene.exists():
            yield scene

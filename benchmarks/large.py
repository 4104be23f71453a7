"""Scenes of a million triangles, and what one costs in a process of its own."""

import multiprocessing
import re
import resource
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
import yaml

import spisim

#: Subdivisions of icosahedra: 1,310,720 triangles at once, or 1000 times 1280.
ONE, MANY = 8, 3
COPIES = 1000


@dataclass(frozen=True)
class Cost:
    """Of loading a scene and simulating a capture of it.

    `processor_s` is the time of all cores together, which other work on the machine does not alter.
    """

    triangles: int
    load_s: float
    simulate_s: float
    processor_s: float
    peak_gb: float


def write_scenes(folder: Path) -> dict[str, Path]:
    """Scene files: one bumpy boulder as one PLY, and pebbles as copies of one mesh; fog, a wall."""
    boulder = trimesh.creation.icosphere(ONE)
    x, y, z = boulder.vertices.T
    boulder.vertices *= (1 + 0.05 * np.sin(12 * x) * np.sin(11 * y) * np.sin(13 * z))[:, None]
    boulder.export(folder / "boulder.ply")
    trimesh.creation.icosphere(MANY, 0.08).export(folder / "pebble.ply")
    positions = np.random.default_rng(0).uniform([3, -2, 0], [8, 2, 3], (COPIES, 3)).round(3)
    things = {
        "one PLY file": {"name": "boulder", "mesh": "boulder.ply", "translate_m": [5, 0, 1.5]},
        f"{COPIES} copies": {
            "name": "pebble",
            "mesh": "pebble.ply",
            "instances": [{"translate_m": position} for position in positions.tolist()],
        },
    }
    wall = {"name": "wall", "shape": "rectangle", "size_m": [9, 9], "material": "brick"}
    pose = {"rotate_deg": [0, -90, 0], "translate_m": [9, 0, 1.5]}
    files = {}
    for name, thing in things.items():
        fields = {
            "name": name,
            "drone": {"position_m": [0, 0, 1.5], "look_at_m": [5, 0, 1.5]},
            "fog": {"visibility_m": 100},
            "objects": [thing | {"material": "concrete"}, wall | pose],
        }
        files[name] = folder / f"{name.replace(' ', '-')}.yaml"
        files[name].write_text(yaml.safe_dump(fields))
    return files


def in_a_process(path: Path, spp: int) -> Cost:
    """Cost of a scene in a process of its own."""
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=spawn) as pool:
        return pool.submit(cost, path, spp).result()


def cost(path: Path, spp: int) -> Cost:
    """Load and simulate, here."""
    began, used = time.perf_counter(), time.process_time()
    scene = spisim.load_scene(path)
    loaded = time.perf_counter()
    spisim.simulate(scene, spisim.load_instrument("paper"), spp=spp)
    return Cost(
        sum(len(thing.mesh.faces) for thing in scene.objects),
        loaded - began,
        time.perf_counter() - loaded,
        time.process_time() - used,
        peak_gb(),
    )


def peak_gb() -> float:
    """Of this process alone: what the system counts by default begins at its parent's peak."""
    status = Path("/proc/self/status")
    if status.is_file():
        match = re.search(r"VmHWM:\s+(\d+) kB", status.read_text())
        if match:
            return int(match[1]) * 1024 / 1e9
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e9

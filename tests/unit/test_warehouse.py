"""Things in the aisle of a warehouse stand apart and hang from something."""

import itertools

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from spisim.scene import Scene, draw_scene

THINGS = ("drum-pallet", "carton-pallet", "tyre", "pallet truck", "cone", "gas bottle in the way",
          "carton on the floor", "step ladder", "worker")  # fmt: skip
#: Objects that belong to one thing.
PARTS = {
    "drum": "drum-pallet",
    "pallet below the drum": "drum-pallet",
    "pallet below the cartons": "carton-pallet",
    "stacked carton": "carton-pallet",
    "open carton": "carton-pallet",
    "overall": "worker",
    "skin": "worker",
}


def outlines(scene: Scene) -> dict[str, ConvexHull]:
    """Convex outline on the floor of everything in the aisle."""
    points: dict[str, list] = {}
    for thing in scene.objects:
        kind = thing.name.rsplit("-", 1)[0]
        kind = PARTS.get(kind, kind)
        if kind in THINGS:
            points.setdefault(kind, []).append(thing.mesh.vertices[:, :2])
    return {kind: ConvexHull(np.concatenate(parts)) for kind, parts in points.items()}


def are_apart(one: ConvexHull, other: ConvexHull) -> bool:
    """Whether a line parallel to an edge of one separates them."""
    for a, b in ((one, other), (other, one)):
        normals, offsets = a.equations[:, :2], a.equations[:, 2]
        if ((b.points @ normals.T + offsets).min(axis=0) > 0).any():
            return True
    return False


@pytest.mark.parametrize("seed", range(4))
def test_things_and_people_in_the_aisle_stand_apart(seed: int) -> None:
    parameters = {"things": 8, "worker": "worker", "aisle_m": 1.7}
    result = outlines(draw_scene("warehouse", seed, parameters))
    assert len(result) >= 4
    for (name, one), (other_name, other) in itertools.combinations(result.items(), 2):
        assert are_apart(one, other), (name, other_name)
    assert all(np.abs(one.points[:, 1]).max() < 0.87 for one in result.values())


def test_lamps_and_cable_hang_from_bars_below_the_skylight() -> None:
    scene = draw_scene("warehouse", 1)
    bars = [thing.mesh.bounds for thing in scene.objects if thing.name.startswith("skylight bar")]
    hung = [thing.mesh for thing in scene.objects
            if thing.name.startswith(("lamp", "hanging cable"))]  # fmt: skip
    assert len(bars) == len(hung)
    for mesh in hung:
        top = mesh.vertices[mesh.vertices[:, 2].argmax()]
        assert any((low <= top).all() and (top <= high).all() for low, high in bars)

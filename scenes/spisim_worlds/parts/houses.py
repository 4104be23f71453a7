"""Houses, barns and halls as seen from outside and from afar; lengths in metres."""

from typing import NamedTuple

import numpy as np

from spisim.scene.families import SceneBuilder
from spisim_worlds.parts.shapes import Mesh, block, prism, union

WALLS = ("plaster", "brick", "paint-white", "wood-weathered", "concrete")
ROOFS = ("roof-tile-concrete", "roof-shingle", "brick", "metal-roof")


class House(NamedTuple):
    """Parts of a house on z = 0, its ridge along y."""

    walls: Mesh
    roof: Mesh
    openings: Mesh


def house(length: float, width: float, eaves: float, pitch_deg: float) -> House:
    """Four walls, a gable roof or a flat one of pitch 0, windows and a door."""
    rise = 0.5 * width * np.tan(np.radians(pitch_deg))
    walls = [block((width, length, eaves + 1), (0, 0, (eaves - 1) / 2))]
    over, thick = 0.4, 0.22
    if rise > 0:
        half, drop = width / 2 + over, over * rise / (width / 2)
        walls.append(prism([(-width / 2, eaves), (width / 2, eaves), (0, eaves + rise)], length))
        foot, ridge = eaves - drop, eaves + rise
        slopes = [
            [(-half, foot), (0, ridge), (0, ridge + thick), (-half, foot + thick)],
            [(0, ridge), (half, foot), (half, foot + thick), (0, ridge + thick)],
        ]
        roof = union([prism(slope, length + 2 * over) for slope in slopes])
    else:
        roof = block((width + 0.3, length + 0.3, 0.25), (0, 0, eaves + 0.12))
    panes = [block((width + 0.07, 1.0, 2.0), (0, 0.2 * length, 1.0))]
    for z in np.arange(1.5, eaves - 0.6, 2.8):
        for y in np.arange(-length / 2 + 1.4, length / 2 - 1.0, 2.4):
            panes.append(block((width + 0.06, 1.0, 1.2), (0, y, z)))
        for x in np.arange(-width / 2 + 1.4, width / 2 - 1.0, 2.6):
            panes.append(block((1.0, length + 0.06, 1.2), (x, 0, z)))
    return House(union(walls), roof, union(panes))


def add_houses(
    builder: SceneBuilder,
    rng: np.random.Generator,
    positions: list[tuple[float, float, float]],
    name: str = "house",
) -> None:
    """Add a different house at every position (x, y, z), turned at random."""
    for number, position in enumerate(positions, 1):
        flat = rng.random() < 0.2
        made = house(
            rng.uniform(7, 20), rng.uniform(6, 11), rng.uniform(2.8, 8.5),
            0.0 if flat else rng.uniform(20, 50),
        )  # fmt: skip
        turn = (0.0, 0.0, rng.uniform(0, 360))
        builder.mesh(f"{name} {number}", str(rng.choice(WALLS)), made.walls, position, turn)
        roof = "roofing-felt" if flat else str(rng.choice(ROOFS))
        builder.mesh(f"roof of {name} {number}", roof, made.roof, position, turn)
        builder.mesh(
            f"windows of {name} {number}", "glass-painted-back", made.openings, position, turn
        )

"""Boats and ships: afloat on z = 0 along x, bow towards +x; lengths in metres."""

import numpy as np

from spisim.scene.families import Point, SceneBuilder
from spisim_worlds.parts.shapes import Mesh, block, loft, rod, union


def hull(length: float, beam: float, freeboard: float, draught: float) -> Mesh:
    """Closed hull with flared bow and a transom, from below the water line to the deck."""
    stations = np.linspace(-0.5, 0.5, 25)
    taper = np.where(stations < 0, 1.0, np.sqrt(1 - np.clip(2 * stations, 0, 1) ** 2.6))
    taper = np.maximum(taper, 0.015) * np.interp(stations, [-0.5, -0.3, 0.5], [0.85, 1, 1])
    rings = []
    for s, wide in zip(stations, taper, strict=True):
        sheer = freeboard * (1 + 0.35 * max(0.0, 2 * s) ** 2)
        x = s * length
        half = wide * beam / 2
        # The bow rakes forward and flares: its foot is narrower and farther back than its deck.
        rake = 0.06 * length * max(0.0, 2 * s) ** 3
        y = half * np.array([0.0, 0.75, 0.95, 1.0, 1.0])
        z = np.array([-draught, -draught, -0.5 * draught, 0.2 * freeboard, sheer])
        back = rake * np.array([-1.0, -1.0, -0.7, -0.2, 0.3])
        port = np.column_stack([x + back, y, z])
        starboard = port[:0:-1] * (1, -1, 1)
        rings.append(np.vstack([port, starboard]))
    return loft(np.array(rings))


def add_boat(
    builder: SceneBuilder, rng: np.random.Generator, name: str, at: Point, yaw_deg: float
) -> None:
    """A small boat with a cabin and a mast."""
    length = rng.uniform(4, 14)
    beam, free = 0.32 * length, 0.09 * length
    turn = (0.0, 0.0, yaw_deg)
    builder.mesh(name, str(rng.choice(["fibreglass", "paint-white", "wood-weathered"])),
               hull(length, beam, free, 0.4 * free), at, turn)  # fmt: skip
    cabin = [
        block((0.3 * length, 0.6 * beam, 0.14 * length), (-0.1 * length, 0, free + 0.07 * length))
    ]
    if rng.random() < 0.6:
        cabin.append(rod((0, 0, free), (0, 0, rng.uniform(0.5, 1.3) * length), 0.04, 8))
        cabin.append(rod((-0.4 * length, 0, free + 1.0), (0, 0, free + 1.2), 0.04, 8))
    builder.mesh(f"cabin of {name}", "paint-white", union(cabin), at, turn)

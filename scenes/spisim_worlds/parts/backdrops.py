"""Backdrops and daylight of outdoor scenes; a backdrop ends every beam."""

from collections.abc import Callable
from typing import Any

import numpy as np

from spisim.scene.families import SceneBuilder
from spisim_worlds.parts.natural import clipped_bush
from spisim_worlds.parts.shapes import block, rod, union


def add_backdrop(
    builder: SceneBuilder, kind: str, x_m: float, axis_z_m: float, rng: np.random.Generator
) -> None:
    """Add ground, and a backdrop of this kind across the x axis at `x_m`.

    `axis_z_m` is the height at which the line of sight meets it, where its details are.
    """
    ground = {"hedge": "soil-field"}.get(kind, "asphalt")
    builder.rectangle("ground", ground, (60, 60), (x_m - 10, 0, 0))
    _BACKDROPS[kind](builder, x_m, axis_z_m, rng)


def _brick_wall(builder: SceneBuilder, x: float, axis_z: float, rng: np.random.Generator) -> None:
    """Façade with a row of windows, one of them nearly ahead, and a downpipe."""
    height = axis_z + 4
    builder.box("brick wall", "brick", (0.3, 14, height), (x + 0.15, 0, height / 2))
    spacing, first = rng.uniform(1.7, 2.3), rng.uniform(0.3, 1.1)
    low = max(0.9, axis_z - rng.uniform(0.4, 1.1))
    copies = [((0, 0, 0), (x, first + i * spacing, low)) for i in range(-3, 3)]
    frame = [block((0.06, 0.06, 1.4), (0, y, 0.7)) for y in (-0.5, 0.0, 0.5)]
    frame += [block((0.06, 1.06, 0.06), (0, 0, z)) for z in (0.03, 0.95, 1.37)]
    builder.mesh("window frame", "paint-white", union(frame), copies=copies)
    builder.box(
        "window",
        "glass-painted-back",
        (0.02, 0.96, 1.34),
        copies=[((0, 0, 0), (x, y, z + 0.7)) for _, (_, y, z) in copies],
    )
    sill = block((0.16, 1.2, 0.05), (-0.06, 0, -0.025))
    builder.mesh("window sill", "concrete-weathered", sill, copies=copies)
    pipe_y = first - spacing / 2
    pipe = [rod((x - 0.08, pipe_y, 0), (x - 0.08, pipe_y, height), 0.05, 10)]
    pipe += [rod((x - 0.08, pipe_y, z), (x, pipe_y, z), 0.012, 6) for z in np.arange(1, height, 2)]
    builder.mesh("downpipe", "steel-galvanised", union(pipe))


def _hedge(builder: SceneBuilder, x: float, axis_z: float, rng: np.random.Generator) -> None:
    """Add two staggered rows of bushes on trunks, as high as needed."""
    height = axis_z + 0.25 * x
    leaf = rng.uniform(0.07, 0.14)
    shape, foliage = clipped_bush(rng, (1.7, 2.1, height), leaf, 1000)
    copies = [
        ((0, 0, rng.uniform(-25, 25) + 180 * (i % 2)), (x + 1 + row, y, 0.5 * height))
        for row in (0, 1)
        for i, y in enumerate(np.arange(-4.5 + 0.75 * row, 4.6, 1.5))
    ]
    builder.mesh("bush", "leaves-green", shape, copies=copies)
    builder.mesh("leaves", "leaves-green", foliage, copies=copies)
    trunks = [rod((px, py, 0), (px, py, 0.4 * height), 0.09, 8) for _, (px, py, _) in copies]
    builder.mesh("trunks", "bark", union(trunks))


def _containers(builder: SceneBuilder, x: float, axis_z: float, rng: np.random.Generator) -> None:
    """Stacked shipping containers, their corrugated long sides to us."""
    length, height, pitch = 6.06, 2.59, 0.28
    panel = block((0.1, length, height), (0.05, 0, height / 2))
    ribs = [
        block((0.04, pitch / 2, height - 0.3), (-0.02, y, height / 2))
        for y in np.arange(-length / 2 + 0.3, length / 2 - 0.2, pitch)
    ]
    rails = [block((0.09, length, 0.14), (-0.03, 0, z)) for z in (0.08, height - 0.08)]
    posts = [
        block((0.1, 0.16, height), (-0.03, s * (length - 0.16) / 2, height / 2)) for s in (-1, 1)
    ]
    storeys = 2 + int(axis_z // height)
    copies = [
        ((0, 0, 0), (x + rng.uniform(0, 0.25), shift + column * (length + 0.15), storey * height))
        for storey, shift in enumerate(rng.uniform(-2.5, 2.5, storeys))
        for column in (-1, 0, 1)
    ]
    side = union([panel, *ribs, *rails, *posts])
    builder.mesh("container", "steel-painted", side, copies=copies)
    builder.box("wall of containers behind", "steel-painted", (0.1, 20, 15), (x + 0.6, 0, 7.5))


_BACKDROPS: dict[str, Callable[[SceneBuilder, float, float, np.random.Generator], None]] = {
    "brick-wall": _brick_wall,
    "hedge": _hedge,
    "containers": _containers,
}
#: Kinds of backdrops.
BACKDROPS = tuple(_BACKDROPS)


def outdoors(rng: np.random.Generator) -> dict[str, Any]:
    """Return fields of a builder: an overcast sky, or equally often the sun 15° to 60° high."""
    overcast = rng.random() < 0.5
    azimuth, elevation = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(15, 60))
    sun_klx, overcast_klx, blue_klx = rng.uniform(20, 90), rng.uniform(1, 15), rng.uniform(8, 18)
    if overcast:
        return {"sky_klx": float(overcast_klx)}
    level = np.cos(elevation) * np.array([np.cos(azimuth), np.sin(azimuth)])
    direction = (*level.tolist(), -float(np.sin(elevation)))
    return {"sun_klx": float(sun_klx), "sun_direction": direction, "sky_klx": float(blue_klx)}

"""Land from the drone's feet to the horizon at little cost: a grid that coarsens with distance.

The drone is above the origin and looks along x; lengths in metres.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from reconstruction.base.arrays import Floats
from spisim.scene.families import SceneBuilder
from spisim_worlds.parts.shapes import Mesh, grid_mesh

Range = tuple[float, float]
Relief = Callable[[Floats, Floats], Floats]
#: Extent of land and water. From 30 m above, their edge is 0.2° below the horizon; single
#: precision still resolves millimetres there.
HORIZON_M = 8000.0
#: Ratio of successive distances between grid lines.
GROWTH = 1.14


@dataclass(frozen=True, eq=False)
class Terrain:
    """Heights `z_m` (n, m) at lines `x_m` (n,) across and `y_m` (m,) along the line of sight."""

    x_m: Floats
    y_m: Floats
    z_m: Floats

    def height(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Return the height of the mesh itself, so that objects on it neither float nor sink.

        `x`, `y` and the heights have the same shape.
        """
        i, u = _cell(self.x_m, np.asarray(x, float))
        j, v = _cell(self.y_m, np.asarray(y, float))
        a, b = self.z_m[i, j], self.z_m[i + 1, j]
        c, d = self.z_m[i + 1, j + 1], self.z_m[i, j + 1]
        return np.where(u >= v, a + u * (b - a) + v * (c - b), a + v * (d - a) + u * (c - d))

    def on(self, x: float, y: float, sunk_m: float = 0.0) -> tuple[float, float, float]:
        """Return a point on the ground, or below it by a depth."""
        return (float(x), float(y), float(self.height(x, y)) - sunk_m)

    def positions(self, x: ArrayLike, y: ArrayLike, sunk_m: float = 0.0) -> Floats:
        """Return points (n, 3) on the ground, or below it by a depth."""
        return np.stack([x, y, self.height(x, y) - sunk_m], axis=-1)

    def draped(self, path: ArrayLike, width_m: float, above_m: float = 0.02) -> Mesh:
        """Return a strip along points (n, 2), slightly above the ground: a road, a furrow."""
        points = np.asarray(path, float)
        along = np.gradient(points, axis=0)
        across = np.stack([-along[:, 1], along[:, 0]], axis=1)
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        offsets = np.linspace(-width_m / 2, width_m / 2, 5)[:, None, None]
        x, y = np.moveaxis(points + offsets * across, -1, 0)
        lines = self.positions(x, y, -above_m)
        return grid_mesh(np.swapaxes(lines, 0, 1))

    def centres(self) -> tuple[Floats, Floats]:
        """x and y (n - 1, m - 1) of the middles of the cells."""
        x, y = ((line[:-1] + line[1:]) / 2 for line in (self.x_m, self.y_m))
        return np.meshgrid(x, y, indexing="ij")

    def add(
        self,
        builder: SceneBuilder,
        materials: Sequence[str],
        kinds: NDArray[np.int64] | None = None,
        name: str = "ground",
    ) -> None:
        """Add the land, with the kind of material of each cell given by `kinds` (n - 1, m - 1)."""
        whole = grid_mesh(np.stack([*np.meshgrid(self.x_m, self.y_m, indexing="ij"), self.z_m], -1))
        of_face = np.zeros(len(whole.faces), int) if kinds is None else np.tile(kinds.ravel(), 2)
        for number, material in enumerate(materials):
            faces = whole.faces[of_face == number]
            if len(faces):
                used, renumbered = np.unique(faces, return_inverse=True)
                part = Mesh(whole.vertices[used], renumbered.reshape(-1, 3), process=False)
                builder.mesh(f"{name} {number + 1}" if number else name, material, part)


def terrain(relief: Relief, near: tuple[Range, Range], step_m: float) -> Terrain:
    """Return land of a relief out to the horizon.

    The grid has `step_m` within the near limits of x and y, and is ever coarser beyond.
    """
    x, y = (_graded(limits, step_m) for limits in near)
    grid = np.meshgrid(x, y, indexing="ij")
    return Terrain(x, y, np.asarray(relief(*grid), float))


def waves(rng: np.random.Generator, lengths_m: Range, count: int = 9) -> Relief:
    """Smooth random relief between -1 and 1, of wavelengths between two."""
    low, high = np.log(lengths_m).tolist()
    lengths = np.exp(rng.uniform(low, high, count))
    headings, phases = rng.uniform(0, 2 * np.pi, (2, count))
    numbers = 2 * np.pi / lengths * np.array([np.cos(headings), np.sin(headings)])
    weights = lengths / lengths.sum()  # long waves are higher

    def relief(x: Floats, y: Floats) -> Floats:
        return np.cos(np.stack([x, y], axis=-1) @ numbers + phases) @ weights

    return relief


def hills(rng: np.random.Generator, start_m: float, height_m: float) -> Relief:
    """Hills up to `height_m` that rise beyond `start_m` all around, or flat land if that is 0."""
    wave = waves(rng, (1.2 * start_m, 6 * start_m))

    def relief(x: Floats, y: Floats) -> Floats:
        rise = np.clip((np.hypot(x, y) - start_m) / (2 * start_m), 0, 1)
        return height_m * rise**2 * (3 - 2 * rise) * np.clip(0.5 + wave(x, y), 0, None)

    return relief


def add_shore(
    builder: SceneBuilder,
    land: Terrain,
    level_m: float,
    materials: Sequence[str],
    kinds: NDArray[np.int64],
) -> Terrain:
    """Add land of some kinds (n - 1, m - 1) of material, and water up to a level.

    At 1550 nm water is opaque and reflects 2 %, because its body absorbs the transmitted light.
    Returns the land including the water's surface, as ground for objects.
    """
    flooded = Terrain(land.x_m, land.y_m, np.maximum(land.z_m, level_m))
    z = flooded.z_m
    highest = np.maximum(np.maximum(z[:-1, :-1], z[1:, :-1]), np.maximum(z[:-1, 1:], z[1:, 1:]))
    kinds = np.where(highest > level_m, kinds, len(materials))
    flooded.add(builder, [*materials, "water"], kinds)
    return flooded


def patchwork(
    rng: np.random.Generator, land: Terrain, kinds: int, size_m: float, count: int = 150
) -> NDArray[np.int64]:
    """Return a kind (n - 1, m - 1) for each cell: random fields, larger with distance."""
    steps, angles = rng.uniform(0, 7, count), rng.uniform(-np.pi, np.pi, count)
    ahead = rng.random(count) < 0.6
    angles[ahead] /= 6
    x, y = land.centres()
    own = _log_polar(np.log1p(np.hypot(x, y) / size_m), np.arctan2(y, x))
    _, nearest = cKDTree(_log_polar(steps, angles)).query(own)
    return rng.integers(0, kinds, count)[nearest]


def _log_polar(log_radius: Floats, angle: Floats) -> Floats:
    """Return points (..., 3) from logarithms of radii, and angles."""
    return np.stack([log_radius, np.cos(angle), np.sin(angle)], axis=-1)


def _cell(lines: Floats, at: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Return the cell of each position, and the fractional position within it."""
    i = np.clip(np.searchsorted(lines, at, side="right") - 1, 0, len(lines) - 2)
    return i, (at - lines[i]) / (lines[i + 1] - lines[i])


def _graded(near: Range, step_m: float) -> Floats:
    low, high = near
    middle = np.linspace(low, high, max(2, round((high - low) / step_m) + 1))
    count = round(float(np.log1p((HORIZON_M / step_m) * (GROWTH - 1)) / np.log(GROWTH)))
    away = GROWTH ** np.arange(1, count + 1) - 1
    away *= HORIZON_M / away[-1]
    return np.concatenate([low - away[::-1], middle, high + away])

"""Trees, branches, bushes and grass, grown at random; lengths in metres.

Wood is a list of `Limb`s, from which `wood` makes round tubes; leaves are small sheets.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from reconstruction.base.arrays import Floats
from spisim_worlds.parts.shapes import Mesh, tube, union

#: Thinnest twig.
TWIG_RADIUS_M = 0.0015
#: Widening of a trunk at its foot, relative to its radius.
FLARE = 1.35
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Limb:
    """A tapering piece of wood along points (n, 3), with a radius (n,) at each."""

    path: Floats
    radii: Floats

    def at(self, fraction: float) -> tuple[Floats, Floats, float]:
        """Point, direction and radius at a fraction of its points."""
        position = fraction * (len(self.path) - 1)
        i = min(int(position), len(self.path) - 2)
        step = self.path[i + 1] - self.path[i]
        radius = np.interp(position, np.arange(len(self.radii)), self.radii)
        return self.path[i] + (position - i) * step, unit(step), float(radius)


def grow(
    rng: np.random.Generator,
    start: ArrayLike,
    direction: ArrayLike,
    length_m: float,
    radius_m: float,
    levels: int,
    children: int = 4,
) -> list[Limb]:
    """Return a branch with branches `levels` deep, each half as long and as thick."""
    points = 6 if levels else 4
    steps = wander(rng, unit(direction), points - 1, 0.18) * (length_m / (points - 1))
    path = np.vstack([np.zeros(3), steps.cumsum(axis=0)]) + np.asarray(start, float)
    tip = max(TWIG_RADIUS_M, 0.35 * radius_m)
    limb = Limb(path, np.linspace(max(radius_m, tip), tip, points))
    limbs = [limb]
    if levels == 0:
        return limbs
    for fraction in np.linspace(0.3, 1.0, children) + rng.uniform(-0.05, 0.0, children):
        position, along, thick = limb.at(float(fraction))
        turned = unit(along + rng.uniform(0.5, 1.1) * aside_of(rng, along) + 0.15 * UP)
        reach = length_m * rng.uniform(0.3, 0.55)
        limbs += grow(rng, position, turned, reach, 0.55 * thick, levels - 1, children)
    return limbs


def tree(
    rng: np.random.Generator,
    height_m: float,
    radius_m: float,
    branches: int,
    lowest_m: float,
    reach_m: float,
) -> list[Limb]:
    """Return a trunk on z = 0 with branches from `lowest_m` up, the lowest `reach_m` long."""
    lean = rng.normal(0, 0.04, 3) * (1, 1, 0)
    steps = wander(rng, unit(UP + lean), 8, 0.04) * (height_m / 8)
    path = np.vstack([np.zeros(3), steps.cumsum(axis=0)])
    flare = np.array([FLARE, *np.linspace(1.0, 0.35, 8)])
    trunk = Limb(path, radius_m * flare)
    limbs = [trunk]
    for height in rng.uniform(lowest_m / height_m, 0.95, branches):
        position, along, thick = trunk.at(float(height))
        out = unit(aside_of(rng, along) + rng.uniform(-0.1, 0.7) * UP)
        length = reach_m * rng.uniform(0.6, 1.0) * (1.1 - 0.6 * height)
        limbs += grow(rng, position, out, length, min(0.02 * length + 0.004, 0.5 * thick), 1, 4)
    return limbs


def bush(rng: np.random.Generator, height_m: float, stems: int, twigs: int) -> list[Limb]:
    """Return stems from one point on the ground, each with as many twigs."""
    limbs: list[Limb] = []
    for _ in range(stems):
        out = unit(UP + rng.uniform(0.1, 0.9) * aside_of(rng, UP))
        length = height_m * rng.uniform(0.7, 1.1)
        limbs += grow(rng, rng.normal(0, 0.05, 3) * (1, 1, 0), out, length, 0.006, 1, twigs)
    return limbs


def wood(limbs: Sequence[Limb]) -> Mesh:
    """Return limbs as tubes; thicker ones are rounder."""
    return union([tube(limb.path, limb.radii, _sections(limb)) for limb in limbs])


def leaves(rng: np.random.Generator, limbs: Sequence[Limb], size_m: float, per_limb: int) -> Mesh:
    """Return leaves, diamonds of about `size_m`, along the outer part of the thinnest limbs."""
    twigs = [limb for limb in limbs if limb.radii[0] < 0.008]
    positions, along = [], []
    for twig in twigs:
        for fraction in rng.uniform(0.2, 1.0, per_limb):
            position, direction, _ = twig.at(float(fraction))
            positions.append(position)
            along.append(direction)
    return blades(rng, np.array(positions), np.array(along), size_m)


def blades(rng: np.random.Generator, positions: Floats, along: Floats, size_m: float) -> Mesh:
    """Return a leaf per position (n, 3) that points roughly `along` (n, 3), away from it.

    Each has two triangles, slightly folded at the midrib.
    """
    n = len(positions)
    sizes = size_m * rng.uniform(0.6, 1.3, (n, 1))
    forward = _units(along + rng.normal(0, 0.7, (n, 3)))
    across = _units(np.cross(forward, rng.normal(0, 1, (n, 3))))
    normal = np.cross(forward, across)
    middle = positions + 0.5 * sizes * forward + 0.12 * sizes * normal
    spread = 0.28 * sizes * across
    corners = np.stack(
        [positions, middle + spread, positions + sizes * forward, middle - spread], axis=1
    )
    first = 4 * np.arange(n)[:, None]
    faces = (first + np.array([0, 2, 1, 0, 3, 2])).reshape(-1, 3)
    return Mesh(corners.reshape(-1, 3), faces, process=False)


def tuft(rng: np.random.Generator, height_m: float, stalks: int) -> Mesh:
    """Grass on z = 0: upright narrow triangles that bend over at the tip."""
    roots = rng.normal(0, 0.06, (stalks, 3)) * (1, 1, 0)
    heading = rng.uniform(0, 2 * np.pi, stalks)
    out = np.stack([np.cos(heading), np.sin(heading), 0 * heading], axis=1)
    wide = 0.004 * np.stack([-out[:, 1], out[:, 0], out[:, 2]], axis=1)
    tall = height_m * rng.uniform(0.5, 1.2, (stalks, 1))
    knee = roots + tall * (0.7 * UP + 0.15 * out)
    tip = roots + tall * (UP + 0.5 * out)
    corners = np.stack([roots - wide, roots + wide, knee + wide, knee - wide, tip], axis=1)
    first = 5 * np.arange(stalks)[:, None]
    faces = (first + np.array([0, 1, 2, 0, 2, 3, 3, 2, 4])).reshape(-1, 3)
    return Mesh(corners.reshape(-1, 3), faces, process=False)


def wander(rng: np.random.Generator, direction: Floats, steps: int, spread: float) -> Floats:
    """Return unit steps (steps, 3) of a random walk that starts in a direction."""
    walk = direction + np.vstack([np.zeros(3), rng.normal(0, spread, (steps - 1, 3))]).cumsum(0)
    return _units(walk)


def aside_of(rng: np.random.Generator, direction: Floats) -> Floats:
    """Return a random unit vector across a direction."""
    while True:
        across = np.cross(direction, rng.normal(0, 1, 3))
        if np.linalg.norm(across) > 0.1:
            return unit(across)


def unit(vector: ArrayLike) -> Floats:
    """Return a vector (3,) scaled to length 1."""
    values = np.asarray(vector, float)
    return np.asarray(values / np.linalg.norm(values))


def _units(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def _sections(limb: Limb) -> int:
    thick = float(limb.radii.max())
    return 4 if thick < 0.006 else 6 if thick < 0.03 else 12

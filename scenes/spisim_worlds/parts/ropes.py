"""Ropes, cables and nets, which are thin for a drone's camera; lengths in metres."""

from collections.abc import Sequence

import numpy as np

from reconstruction.base.arrays import Floats
from spisim_worlds.parts.shapes import Mesh, Point, tube, union


def hanging(start: Point, end: Point, sag: float, points: int = 13) -> Floats:
    """Points (n, 3) along a rope between two ends: the parabola with `sag` below their middle."""
    along = np.linspace(0.0, 1.0, points)[:, None]
    path = np.asarray(start) + along * np.subtract(end, start)
    path[:, 2] -= 4 * sag * (along * (1 - along))[:, 0]
    return path


def lying(
    corners: Sequence[Point], sway: float, height: float, rng: np.random.Generator, points: int = 40
) -> Floats:
    """Points (n, 3) of a cable thrown down through corners (n, 2), at a constant height."""
    knots = np.asarray(corners, float)
    knots[1:-1] += rng.uniform(-sway, sway, (len(knots) - 2, 2))
    path = np.empty((points, 3))
    # Unlike a cubic through the corners, the smoothed polygon does not overshoot.
    fine = np.linspace(0, len(knots) - 1, points)
    for axis in (0, 1):
        straight = np.interp(fine, np.arange(len(knots)), knots[:, axis])
        padded = np.pad(straight, 4, mode="reflect", reflect_type="odd")
        path[:, axis] = np.convolve(padded, np.full(9, 1 / 9), "valid")
    path[:, 2] = height
    return path


def net(corners: Sequence[Point], mesh: float, diameter: float, sag: float) -> Mesh:
    """Return a knotted net within corners (4, 3), in order, whose cords across sag by `sag`."""
    low, high, high_far, low_far = (np.asarray(corner, float) for corner in corners)
    across = _steps(low, low_far, mesh)
    up = _steps(low, high, mesh)
    grid = np.array(
        [
            hanging(low + u * (high - low), low_far + u * (high_far - low_far), sag, len(across))
            for u in up
        ]
    )
    cords = [*grid, *grid.transpose(1, 0, 2)]
    return union([tube(cord, diameter / 2, sections=5) for cord in cords])


def _steps(start: Floats, end: Floats, mesh: float) -> Floats:
    """Return the fractions between two corners at which a cord crosses."""
    return np.linspace(0, 1, 1 + max(2, round(float(np.linalg.norm(end - start)) / mesh)))

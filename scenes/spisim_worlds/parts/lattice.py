"""Lattices of bars: pylons, cranes, trusses; lengths in metres."""

import numpy as np
from numpy.typing import ArrayLike

from reconstruction.base.arrays import Floats
from spisim_worlds.parts.shapes import Mesh, bars, union

#: Corners of a square across the axis of a boom.
SQUARE = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
TRIANGLE = np.array([(-1, -0.7), (1, -0.7), (0, 0.9)])


def boom(
    start: ArrayLike,
    end: ArrayLike,
    half_m: tuple[float, float],
    panels: int,
    chord_m: float,
    corners: Floats = SQUARE,
) -> Mesh:
    """Return a straight lattice between two points.

    Chords of radius `chord_m` are at the corners of a square or triangle, given half its width at
    either end, with battens and crossing diagonals in every panel.
    """
    axis = np.asarray(end, float) - np.asarray(start, float)
    along = axis / np.linalg.norm(axis)
    helper = np.array([0.0, 0, 1]) if abs(along[2]) < 0.9 else np.array([1.0, 0, 0])
    side = np.cross(helper, along)
    side /= np.linalg.norm(side)
    up = np.cross(along, side)
    t = np.linspace(0, 1, panels + 1)[:, None, None]
    half = half_m[0] + t * (half_m[1] - half_m[0])
    square = corners[:, :1] * side + corners[:, 1:] * up
    joints = np.asarray(start, float) + t * axis + half * square  # (panels + 1, k, 3)
    following = np.roll(joints, -1, axis=1)
    chords = np.stack([joints[0], joints[-1]], axis=1)
    braces = [
        np.stack([joints, following], axis=2),
        np.stack([joints[:-1], following[1:]], axis=2),
        np.stack([following[:-1], joints[1:]], axis=2),
    ]
    thin = np.concatenate([part.reshape(-1, 2, 3) for part in braces])
    return union([bars(chords, chord_m, 6), bars(thin, 0.55 * chord_m)])

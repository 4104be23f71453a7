"""Positions of objects: angles seen by the drone, and ground with relief.

The drone looks along x; angles to the left and up are positive.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from reconstruction.base.arrays import Floats
from spisim_worlds.parts.shapes import Mesh, grid_mesh

Range = tuple[float, float]
#: Extra depth of a foot on a slope, because triangles cut the curves of the ground.
DEEPER = 1.2


def aside(ahead_m: float, angle_deg: float) -> float:
    """Return the offset from the line of sight of an object `ahead_m` seen at an angle."""
    return float(ahead_m * np.tan(np.radians(angle_deg)))


@dataclass(frozen=True)
class Ground:
    """Rolling ground, z = 0 on average, that rises to a bank ahead.

    Waves with `numbers` (n, 2) in rad/m and `phases` (n,) sum to at most `relief_m`. The bank
    starts `bank_start_m` ahead and rises by `bank_slope` to about `bank_height_m`.
    """

    relief_m: float
    numbers: Floats
    phases: Floats
    bank_start_m: float
    bank_slope: float = 1.2
    bank_height_m: float = 5.0

    def height(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Return the height at positions, of the shape of `x` and `y`."""
        x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        waves = np.cos(np.stack([x, y], axis=-1) @ self.numbers.T + self.phases)
        bank = np.clip(self.bank_slope * (x - self.bank_start_m), 0, self.bank_height_m)
        wave = waves.mean(axis=-1)
        # A bank is rougher than the ground before it.
        return np.asarray(self.relief_m * wave + bank * (1 + wave / 2), float)

    def on(self, x: float, y: float, sunk_m: float = 0.0) -> tuple[float, float, float]:
        """Return a point on the ground, or below it by a depth."""
        return (x, y, float(self.height(x, y)) - sunk_m)

    def below(self, x: float, y: float, sunk_m: float, foot_m: float) -> tuple[float, float, float]:
        """Return a point below the ground, so deep that all of a round foot is in it."""
        turn = np.linspace(0, 2 * np.pi, 16, endpoint=False)
        rim = self.height(x + foot_m * np.cos(turn), y + foot_m * np.sin(turn))
        height = float(self.height(x, y))
        return (x, y, height - max(sunk_m, DEEPER * (height - float(rim.min()))))

    def mesh(self, x: Range, y: Range, step_m: float) -> Mesh:
        """The ground between two x and two y."""
        grid = np.meshgrid(_steps(x, step_m), _steps(y, step_m), indexing="ij")
        return grid_mesh(np.stack([*grid, self.height(*grid)], axis=-1))

    def path(self, middle: ArrayLike, width_m: float, above_m: float) -> Mesh:
        """Return a strip along points (n, 2), slightly above the ground."""
        points = np.asarray(middle, float)
        along = np.gradient(points, axis=0)
        across = np.stack([-along[:, 1], along[:, 0]], axis=1)
        across *= width_m / 2 / np.linalg.norm(across, axis=1, keepdims=True)
        edges = points - across, points, points + across
        lifted = [np.column_stack([e, self.height(e[:, 0], e[:, 1]) + above_m]) for e in edges]
        return grid_mesh(np.stack(lifted, axis=1))


def rolling(
    rng: np.random.Generator,
    relief_m: float,
    bank_start_m: float,
    bank_slope: float = 1.2,
    bank_height_m: float = 5.0,
) -> Ground:
    """Ground whose waves are 2 to 7 m long."""
    lengths, headings = rng.uniform(2.0, 7.0, 8), rng.uniform(0, 2 * np.pi, 8)
    numbers = 2 * np.pi / lengths * np.array([np.cos(headings), np.sin(headings)])
    phases = rng.uniform(0, 2 * np.pi, 8)
    return Ground(relief_m, numbers.T, phases, bank_start_m, bank_slope, bank_height_m)


def _steps(limits: Range, step_m: float) -> Floats:
    return np.linspace(*limits, max(2, round((limits[1] - limits[0]) / step_m) + 1))

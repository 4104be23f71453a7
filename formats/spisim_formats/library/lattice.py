"""Values on a grid in space, and resampling onto a grid that fills a box."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats

#: Limit on cells of a written grid.
MAX_CELLS = 2**24
#: Minimum cells along the longest edge if a grid ends within the box.
CUT_CELLS = 64
#: Cells per cell of a grid that is not aligned, unless that exceeds
FINER, FINE_CELLS = (8, 4, 2), 2**22
#: Tolerance of alignment, in cells.
ALIGNED = 1e-3


@dataclass(frozen=True, eq=False)
class Lattice:
    """Values (nz, ny, nx) at the centres of cells that fill the unit cube, placed by `to_world`.

    They are interpolated linearly, and constant beyond the outermost centres. They are 0 outside of
    `within`, a unit cube placed likewise, if given.
    """

    values: NDArray[np.float32]
    to_world: Floats
    within: Floats | None = None

    def at(self, points: Floats) -> Floats:
        """Return values (n,) at world points (n, 3)."""
        positions, count = self.cells(points), np.array(self.values.shape[::-1])
        positions = np.clip(positions, 0, count - 1)
        low = np.minimum(np.floor(positions).astype(int), np.maximum(count - 2, 0))
        fractions = positions - low
        total = np.zeros(len(points))
        for step in product((0, 1), repeat=3):
            x, y, z = np.minimum(low + step, count - 1).T
            weight = np.where(step, fractions, 1 - fractions).prod(axis=1)
            total += weight * self.values[z, y, x]
        return total if self.within is None else total * _is_inside(self.within, points)

    def cells(self, points: Floats) -> Floats:
        """Return positions of points, in cells from the first centre."""
        local = points @ np.linalg.inv(self.to_world)[:3, :3].T
        local += np.linalg.inv(self.to_world)[:3, 3]
        return np.asarray(local * self.values.shape[::-1] - 0.5)

    def cells_along(self, box: Floats) -> Floats:
        """Return the maximum number of its cells that any edge (3,) of a box crosses."""
        edges = np.linalg.inv(self.to_world)[:3, :3] @ box[:3, :3]
        return np.asarray(np.abs(edges * np.array(self.values.shape[::-1])[:, None]).max(axis=0))


def _is_inside(cube: Floats, points: Floats) -> NDArray[np.bool_]:
    """Return whether points (n, 3) lie in a placed unit cube."""
    inverse = np.linalg.inv(cube)
    local = points @ inverse[:3, :3].T + inverse[:3, 3]
    return np.asarray(((local >= 0) & (local <= 1)).all(axis=1))


def fill(box: Floats, lattices: tuple[Lattice, ...]) -> tuple[list[NDArray[np.float32]], bool]:
    """Resample several lattices onto one grid (nz, ny, nx) that fills a box; tell whether exactly.

    The box is the unit cube placed by `box` (4, 4). Cells are as fine as those of the lattices, or
    finer if not aligned, because linear interpolation between their centres cuts corners.
    """
    crossed = np.max([each.cells_along(box) for each in lattices], axis=0)
    if any(each.within is not None for each in lattices):
        edges = np.linalg.norm(box[:3, :3], axis=0)
        crossed = np.maximum(crossed, CUT_CELLS * edges / edges.max())
    count = np.maximum(1, np.ceil(crossed - ALIGNED)).astype(int)
    exact = all(_meets(each, box, count) for each in lattices)
    if not exact:
        finer = (times for times in FINER if (times * count).prod() <= FINE_CELLS)
        count = next(finer, FINER[-1]) * count
    while count.prod() > MAX_CELLS:
        count, exact = np.maximum(1, count // 2), False
    x, y, z = (np.arange(each) for each in count)
    result = [np.empty(count[::-1], np.float32) for _ in lattices]
    for layer in z:
        points = _middles(box, count, x, y, layer[None])
        for values, lattice in zip(result, lattices, strict=True):
            values[layer] = lattice.at(points).reshape(len(y), len(x))
    return result, exact


def _meets(lattice: Lattice, box: Floats, count: NDArray[np.int_]) -> bool:
    """Return whether the cells of a box are those of a lattice, tested by the first and last."""
    if lattice.values.size == 1 or lattice.within is not None:
        return lattice.within is None
    ends = (np.unique([0, min(1, each - 1), each - 1]) for each in count)
    positions = lattice.cells(_middles(box, count, *ends))
    return bool(np.abs(positions - np.round(positions)).max() <= ALIGNED)


def _middles(
    box: Floats,
    count: NDArray[np.int_],
    x: NDArray[np.int_],
    y: NDArray[np.int_],
    z: NDArray[np.int_],
) -> Floats:
    """Return centres (n, 3) of cells of a box, x first."""
    above, across, along = np.meshgrid(z, y, x, indexing="ij")
    cells = np.column_stack([along.ravel(), across.ravel(), above.ravel()])
    return np.asarray((cells + 0.5) / count @ box[:3, :3].T + box[:3, 3])

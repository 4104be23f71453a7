"""Order-independent sums: the same seed gives the same bits, however threads interleave."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.transport.jit import Bool, Float, UInt

#: Contributions are summed as integers, in units of 2^-48 /m² of detector area. Integer addition
#: is associative, which floating-point addition is not.
QUANTUM_PER_M2 = 2.0**-48
#: Sums stay exact below this: the power returned by a white wall 3 mm away.
MAX_SUM_PER_M2 = 2.0**15
#: What a cell receives is checked in coarser units, rounded up: it would take 2^30 contributions
#: above the limit to wrap this check.
COARSE_PER_M2 = 2.0**-16


class Accumulator:
    """Sums of contributions per cell, in fractions of emitted power per detector area (1/m²)."""

    def __init__(self, cells: int) -> None:
        self._sums = dr.zeros(mi.Int64, cells)

    def add(self, value: Float, cell: UInt, active: Bool) -> None:
        """Add one contribution per active lane; see `Check` for what cannot be added."""
        quanta = mi.Int64(dr.round(mi.Float64(value) * (1.0 / QUANTUM_PER_M2)))
        dr.scatter_reduce(dr.ReduceOp.Add, self._sums, quanta, cell, active)

    def read(self) -> Floats:
        """Evaluate everything added so far; shape (cells,), 1/m²."""
        return np.asarray(self._sums.numpy(), dtype=np.float64) * QUANTUM_PER_M2


class Check:
    """Whether the contributions to each cell can be summed."""

    def __init__(self, cells: int) -> None:
        self._cells = cells
        self._coarse = dr.zeros(mi.Int64, cells + 1)  # and a count of what is not finite

    def passed(self, value: Float, length_m: Float, cell: UInt, active: Bool) -> Bool:
        """Lanes whose contribution is finite, and so its path length, on which phasors depend."""
        finite = dr.isfinite(value) & dr.isfinite(length_m)
        size: Float = dr.minimum(dr.abs(value), 2 * MAX_SUM_PER_M2) * (1.0 / COARSE_PER_M2)
        amount = dr.select(finite, mi.Int64(dr.ceil(size)), 1)
        index = dr.select(finite, mi.UInt32(cell), self._cells)
        dr.scatter_reduce(dr.ReduceOp.Add, self._coarse, amount, index, active)
        return active & finite

    def read(self) -> int:
        """How many contributions were not finite.

        Raises
        ------
        InputError
            If a sum is too large to be exact.
        """
        coarse = self._coarse.numpy()
        largest = float(coarse[:-1].max()) * COARSE_PER_M2
        if largest >= MAX_SUM_PER_M2:
            raise InputError(
                f"light of {largest:.3g} per m² of detector; less than {MAX_SUM_PER_M2:g} can be "
                "summed: a surface, or fog before a tiny aperture, is too close to source and "
                "detector"
            )
        return int(coarse[-1])

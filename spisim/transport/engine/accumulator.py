"""Order-independent sums: the same seed gives the same bits, whatever the order of threads."""

from functools import cached_property

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.transport.jit import Bool, Float, UInt

#: Contributions are summed as integers in units of 2^-48 /m² of detector area, because integer
#: addition is associative and floating-point addition is not.
QUANTUM_PER_M2 = 2.0**-48
#: Sums are exact below this limit, the power that a white wall 3 mm away returns.
MAX_SUM_PER_M2 = 2.0**15
#: Weights up to which weighted contributions need no limit of their own.
MAX_WEIGHT = 2.0**10
#: The limit is checked in coarser units, rounded up: only 2^30 contributions above the limit could
#: wrap the check.
COARSE_PER_M2 = 2.0**-16


class Accumulator:
    """Sums of contributions per cell, as fractions of emitted power per detector area (1/m²)."""

    def __init__(self, cells: int) -> None:
        self._sums = dr.zeros(mi.Int64, cells)

    def add(self, value: Float, cell: UInt, active: Bool) -> None:
        """Add one contribution per active lane; `Check` tells which contributions can be summed."""
        quanta = mi.Int64(dr.round(mi.Float64(value) * (1.0 / QUANTUM_PER_M2)))
        dr.scatter_reduce(dr.ReduceOp.Add, self._sums, quanta, cell, active)

    def read(self, part: int = 0, parts: int = 1) -> Floats:
        """Evaluate the sums, (cells / parts,), 1/m², of one of so many equal parts."""
        return np.asarray(self._quanta.reshape(parts, -1)[part], np.float64) * QUANTUM_PER_M2

    @cached_property
    def _quanta(self) -> NDArray[np.int64]:
        return np.asarray(self._sums.numpy())


class Check:
    """Tests that the contributions to each cell are finite and their sum is exact."""

    def __init__(self, cells: int) -> None:
        self._cells = cells
        self._coarse = dr.zeros(mi.Int64, cells + 1)  # the last one counts what is not finite

    def passed(self, value: Float, length_m: Float, cell: UInt, active: Bool) -> Bool:
        """Lanes whose contribution and path length are finite."""
        finite = dr.isfinite(value) & dr.isfinite(length_m)
        size: Float = dr.minimum(dr.abs(value), 2 * MAX_SUM_PER_M2) * (1.0 / COARSE_PER_M2)
        amount = dr.select(finite, mi.Int64(dr.ceil(size)), 1)
        index = dr.select(finite, mi.UInt32(cell), self._cells)
        dr.scatter_reduce(dr.ReduceOp.Add, self._coarse, amount, index, active)
        return active & finite

    def read(self, *, weighted: bool = False) -> int:
        """Number of non-finite contributions; InputError if a sum is too large to be exact.

        `weighted` contributions, up to `MAX_WEIGHT` times as large, must fill less than half of it.
        """
        limit = MAX_SUM_PER_M2 / (2 * MAX_WEIGHT if weighted else 1)
        coarse = self._coarse.numpy()
        largest = float(coarse[:-1].max()) * COARSE_PER_M2
        if largest >= limit:
            raise InputError(
                f"light of {largest:.3g} per m² of detector; less than {limit:g} can be "
                "summed: a surface, or fog in front of a tiny aperture, is too close to source and "
                "detector"
            )
        return int(coarse[-1])

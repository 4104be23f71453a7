"""Order-independent sums: the same seed gives the same bits, however threads interleave."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

#: Contributions are summed as integers, in units of 2^-48 /m² of detector area. Integer addition
#: is associative, which floating-point addition is not. Sums stay exact below 2^15 /m²: the power
#: returned by a white wall 3 mm away.
QUANTUM_PER_M2 = 2.0**-48


class Accumulator:
    """Sums of contributions per cell, in fractions of emitted power per detector area (1/m²)."""

    def __init__(self, cells: int) -> None:
        self._sums = dr.zeros(mi.Int64, cells)

    def add(self, value: Any, cell: Any, active: Any) -> None:
        """Add one contribution per active lane.

        A connection of no length gives 0/0; it has no probability, and is left out.
        """
        active = active & dr.isfinite(value)
        quanta = mi.Int64(dr.round(mi.Float64(value) * (1.0 / QUANTUM_PER_M2)))
        dr.scatter_reduce(dr.ReduceOp.Add, self._sums, quanta, cell, active)

    def read(self) -> NDArray[np.float64]:
        """Evaluate everything added so far; shape (cells,), 1/m²."""
        return np.asarray(self._sums.numpy(), dtype=np.float64) * QUANTUM_PER_M2

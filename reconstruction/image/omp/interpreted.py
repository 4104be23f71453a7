"""Batch-OMP in NumPy."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Floats

NEGLIGIBLE = 1e-12
"""Correlations below this fraction of the first are rounding errors."""
DEPENDENT = 1e-10
"""Minimum fraction of an atom's energy that must be linearly independent of those taken before."""


def pursue_frames(
    gram: Floats,
    correlation: NDArray[Any],
    energy: Floats,
    ridge: Floats,
    tolerance: Floats,
    maximum: int,
) -> NDArray[Any]:
    """Coefficients (F, n) of correlations (F, n), limits (F,) and at most ``maximum`` atoms."""
    limits = zip(energy.tolist(), ridge.tolist(), tolerance.tolist(), strict=True)
    result = np.zeros_like(correlation)
    for frame, each in enumerate(limits):
        chosen, values = _pursue(gram, correlation[frame], *each, maximum)
        result[frame, chosen] = values
    return result


def _pursue(
    gram: Floats,
    correlation: NDArray[Any],
    energy: float,
    ridge: float,
    tolerance: float,
    maximum: int,
) -> tuple[list[int], NDArray[Any]]:
    """Atoms chosen for one frame, and their coefficients."""
    columns = np.empty((maximum, len(gram)))  # of F
    lower = np.eye(maximum)
    diagonal = np.empty(maximum)
    scaled = np.empty(maximum, correlation.dtype)  # D^-1 z
    residual = correlation.copy()
    negligible = NEGLIGIBLE * np.abs(correlation).max(initial=0.0)
    chosen: list[int] = []
    excluded: list[int] = []
    while (taken := len(chosen)) < maximum and energy > tolerance:
        atom = int(np.abs(residual).argmax())
        best = residual[atom]
        if not abs(best) > negligible:
            break
        row, new = lower[taken], columns[taken]
        np.divide(columns[:taken, atom], diagonal[:taken], out=row[:taken])
        np.subtract(gram[atom], row[:taken] @ columns[:taken], out=new)
        pivot = float(new[atom]) + ridge
        excluded.append(atom)
        if pivot > DEPENDENT * gram[atom, atom]:
            diagonal[taken], scaled[taken] = pivot, best / pivot
            residual -= scaled[taken] * new
            energy -= abs(best) ** 2 / pivot
            chosen.append(atom)
        residual[excluded] = 0
    return chosen, np.linalg.solve(lower[:taken, :taken].T, scaled[:taken])

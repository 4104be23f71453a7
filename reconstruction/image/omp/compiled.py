"""Batch-OMP compiled by Numba, frame by frame, so that a step stays in the processor's cache."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ...base.arrays import Floats
from .interpreted import DEPENDENT, NEGLIGIBLE

HOW = {"error_model": "numpy", "fastmath": {"contract", "nnan", "nsz"}}
BLOCK = 64
"""Entries whose maximum is computed at once, in vector registers."""


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function, with its machine code cached on disk if possible."""
    try:
        return njit(cache=True, **HOW)(function)
    except RuntimeError:
        return njit(**HOW)(function)


def pursue_frames(
    gram: Floats,
    correlation: NDArray[Any],
    energy: Floats,
    ridge: Floats,
    tolerance: Floats,
    maximum: int,
) -> NDArray[Any]:
    """As `interpreted.pursue_frames`."""
    residual = correlation.copy()
    result = np.zeros_like(correlation)
    columns, numbers = np.empty((maximum, len(gram))), np.empty((2, maximum))
    indices = np.empty((2, len(gram)), np.intp)
    scaled = np.empty(maximum, correlation.dtype)
    for frame in range(len(correlation)):
        pursue(
            gram,
            residual[frame],
            energy[frame],
            ridge[frame],
            tolerance[frame],
            result[frame],
            columns,
            *numbers,
            scaled,
            *indices,
        )
    return result


@compiled
def pursue(
    gram: Floats,
    residual: NDArray[Any],
    energy: float,
    ridge: float,
    tolerance: float,
    result: NDArray[Any],
    columns: Floats,
    diagonal: Floats,
    row: Floats,
    scaled: NDArray[Any],
    chosen: NDArray[np.intp],
    excluded: NDArray[np.intp],
) -> None:
    """Fill in the coefficients ``result`` (n,) of one frame; later arguments are work arrays."""
    negligible = NEGLIGIBLE * abs(residual[strongest(residual)])
    taken = 0
    for step in range(residual.size):
        atom = strongest(residual)
        best = residual[atom]
        if taken == diagonal.size or not energy > tolerance or not abs(best) > negligible:
            break
        for k in range(taken):
            row[k] = columns[k, atom] / diagonal[k]
        unexplained(gram, atom, columns, row, taken)
        pivot = columns[taken, atom] + ridge
        excluded[step] = atom
        if pivot > DEPENDENT * gram[atom, atom]:
            fraction = best / pivot
            for i in range(residual.size):
                residual[i] -= fraction * columns[taken, i]
            energy -= abs(best) ** 2 / pivot
            chosen[taken], diagonal[taken], scaled[taken] = atom, pivot, fraction
            taken += 1
        for k in range(step + 1):
            residual[excluded[k]] = 0
    for k in range(taken - 1, -1, -1):
        value = scaled[k]
        for following in range(k + 1, taken):
            value -= columns[k, chosen[following]] / diagonal[k] * result[chosen[following]]
        result[chosen[k]] = value


@compiled
def strongest(values: NDArray[Any]) -> int:
    """Index of the value of largest modulus, the first of several."""
    best, index = -1.0, 0
    for start in range(0, values.size, BLOCK):
        largest = 0.0
        for at in range(start, min(start + BLOCK, values.size)):
            power = values[at].real ** 2 + values[at].imag ** 2
            largest = power if power > largest else largest
        if largest > best:
            best, index = largest, start
    for at in range(index, values.size):
        if values[at].real ** 2 + values[at].imag ** 2 >= best:
            return at
    return index


@compiled
def unexplained(gram: Floats, atom: int, columns: Floats, row: Floats, taken: int) -> None:
    """Write the column of an ``atom`` minus those taken times ``row``, four at a time."""
    whole = taken - taken % 4
    for i in range(len(gram)):
        columns[taken, i] = gram[atom, i]
    for k in range(0, whole, 4):
        for i in range(len(gram)):
            columns[taken, i] -= (
                row[k] * columns[k, i]
                + row[k + 1] * columns[k + 1, i]
                + row[k + 2] * columns[k + 2, i]
                + row[k + 3] * columns[k + 3, i]
            )
    for k in range(whole, taken):
        for i in range(len(gram)):
            columns[taken, i] -= row[k] * columns[k, i]

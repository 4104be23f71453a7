"""Batch orthogonal matching pursuit, of one frame or of many at once.

R. Rubinstein, M. Zibulevsky, M. Elad, "Efficient Implementation of the K-SVD Algorithm using Batch
Orthogonal Matching Pursuit", Technion CS-2008-08: with a precomputed Gram matrix the pursuit never
touches the measurements, and a progressive factorisation replaces the least squares.

On the chosen set S let G + ridge I = L D L^T with a unit lower triangle L, and F = G[:, S] L^-T.
With L z = correlation[S], the residual's correlation is correlation - F D^-1 z, the atoms'
coefficients u solve L^T u = D^-1 z, and J = energy - z^T D^-1 z. An atom adds a column to F and
changes none.

If Numba is installed the pursuit is compiled, which makes it several times as fast. Arrays of other
libraries than NumPy, such as PyTorch and CuPy, are processed on their own device.
"""

from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from itertools import count
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import interpreted

FEW = 16
"""Number of calls up to which loading the compiled pursuit does not pay off."""

_calls = count(1)


def batch_omp(
    gram: Any,
    correlation: Any,
    energy: Any,
    *,
    ridge: Any = 0.0,
    tolerance: Any = 0.0,
    max_atoms: int,
) -> Any:
    """Greedy minimisation of J(u) = |y - Phi u|^2 + ridge |u|^2 over a few atoms.

    Each step takes the atom with the largest correlation with the residual, then solves for all
    atoms taken so far. It ends when J <= ``tolerance``, after ``max_atoms`` atoms, or when no atom
    helps. Columns need not be normalised: longer ones are preferred.

    Parameters
    ----------
    gram
        Phi^T Phi (n, n).
    correlation
        Phi^T y (..., n) of each frame, real or complex.
    energy
        |y|^2 (...) of each frame.
    ridge, tolerance
        One number, or one for each frame.
    max_atoms
        Maximum number of atoms.

    Returns
    -------
    array
        Coefficients u (..., n), 0 for atoms that were not taken.
    """
    if not isinstance(gram, np.ndarray):
        from .in_step import pursue  # needs array-api-compat

        return pursue(gram, correlation, energy, ridge, tolerance, max_atoms)
    frames = correlation.reshape(-1, len(gram))
    limits = np.empty((3, len(frames)))
    for number, limit in enumerate((energy, ridge, tolerance)):
        limits[number] = np.ravel(limit)
    pursue_frames = pursuit_of(len(frames))
    result = pursue_frames(gram, frames, *limits, min(max_atoms, len(gram)))
    return result.reshape(correlation.shape)


def pursuit_of(frames: int) -> Callable[..., NDArray[Any]]:
    """Compiled pursuit if it is available and pays off, else the interpreted one."""
    loaded = _compiled.cache_info().currsize > 0
    many = loaded or frames > 1 or next(_calls) > FEW
    return (_compiled() if many else None) or interpreted.pursue_frames


def load_pursuit() -> None:
    """Load the compiled pursuit, if available, ahead of time-critical calls."""
    batch_omp(np.eye(2), np.ones((2, 2)), np.ones(2), max_atoms=1)


@cache
def _compiled() -> Callable[..., NDArray[Any]] | None:
    if find_spec("numba") is None:
        return None
    from . import compiled  # slow to import

    return compiled.pursue_frames

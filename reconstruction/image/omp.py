"""Batch orthogonal matching pursuit.

R. Rubinstein, M. Zibulevsky, M. Elad, "Efficient Implementation of the K-SVD Algorithm using Batch
Orthogonal Matching Pursuit", Technion CS-2008-08: with a precomputed Gram matrix the pursuit never
touches the measurements, and a progressive Cholesky factorisation replaces the least squares.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from ..arrays import Floats


def batch_omp(
    gram: Floats,
    correlation: NDArray[Any],
    energy: float,
    *,
    ridge: float = 0.0,
    tolerance: float = 0.0,
    max_atoms: int,
) -> tuple[NDArray[np.intp], NDArray[Any]]:
    """Greedy minimisation of J(u) = |y - Phi u|^2 + ridge |u|^2 over few atoms.

    ``gram`` (n, n) is Phi^T Phi, ``correlation`` (n,) is Phi^T y, ``energy`` |y|^2. Each step takes
    the atom with the largest correlation with the residual, then solves for all atoms taken so far.
    It ends when J <= ``tolerance``, after ``max_atoms`` atoms, or when no atom helps. Returns the
    atoms and their coefficients. Columns need not be normalised: the longer ones are preferred. The
    measurements, and with them the coefficients, may be complex.
    """
    # With G + ridge I = L L^T on the chosen set S, keep F = G[:, S] L^-T. Then the residual's
    # correlation is correlation - F z and J = energy - |z|^2, where L z = correlation[S].
    count = min(max_atoms, len(correlation))
    factor = np.empty((len(correlation), count), order="F")
    lower = np.zeros((count, count))
    z = np.empty(count, dtype=correlation.dtype)
    chosen = np.empty(count, dtype=np.intp)
    residual = correlation.copy()
    available = np.ones(len(correlation))
    negligible = 1e-12 * np.abs(correlation).max(initial=0.0)
    taken = 0
    while taken < count and energy > tolerance:
        atom = int(np.argmax(np.abs(residual) * available))
        row = factor[atom, :taken]
        pivot = gram[atom, atom] + ridge - row @ row
        if abs(residual[atom]) * available[atom] <= negligible:
            break
        available[atom] = 0
        if pivot <= 1e-10 * gram[atom, atom]:
            continue  # a combination of the atoms taken before
        lower[taken, :taken] = row
        lower[taken, taken] = np.sqrt(pivot)
        factor[:, taken] = (gram[:, atom] - factor[:, :taken] @ row) / lower[taken, taken]
        z[taken] = residual[atom] / lower[taken, taken]
        residual -= factor[:, taken] * z[taken]
        energy -= abs(z[taken]) ** 2
        chosen[taken] = atom
        taken += 1
    values = solve_triangular(lower[:taken, :taken], z[:taken], lower=True, trans="T")
    return chosen[:taken], values

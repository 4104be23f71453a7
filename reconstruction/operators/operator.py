"""What decoded readings say of an image: linear operators with orthogonal rows of one length."""

from collections.abc import Hashable
from functools import cached_property
from typing import Any
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from .basis import Basis


class MeasurementOperator:
    """y = A x of images x (N,) as K coefficients, with A A^T = row_length^2 I.

    ``image_shape`` (H, W); ``level`` is the row that alone sees a constant image, or None.
    `forward` and `back_project` act on stacks of (H, W). SciPy's solvers take it as it is:
    `scipy.sparse.linalg.aslinearoperator` asks for shape, type, `matvec` and `rmatvec`.
    ``usual_noise`` (K,): relative standard deviations that equal noise of all readings makes.
    """

    dtype = np.dtype(np.float64)

    image_shape: tuple[int, int]
    row_length: float
    level: int | None
    usual_noise: Floats

    def __init__(self, rows: int, image_shape: tuple[int, int]) -> None:
        self.image_shape = image_shape
        self.usual_noise = np.ones(rows)
        # What methods make of this operator and share, for as long as any of them needs it.
        self.shared: WeakValueDictionary[Hashable, Any] = WeakValueDictionary()
        self.shape = rows, image_shape[0] * image_shape[1]

    def forward(self, images: NDArray[Any]) -> NDArray[Any]:
        """Coefficients (..., K) of images (..., H, W), real or complex."""
        flat = np.asarray(images).reshape(*np.shape(images)[:-2], self.shape[1])
        return self._project(flat)

    def back_project(self, coefficients: NDArray[Any]) -> NDArray[Any]:
        """A^T of coefficients (..., K): images (..., H, W)."""
        flat = self._combine(np.asarray(coefficients))
        return flat.reshape(*flat.shape[:-1], *self.image_shape)

    def min_norm(self, coefficients: NDArray[Any]) -> NDArray[Any]:
        """Of all images that fit coefficients (..., K) the one of least energy: (..., H, W)."""
        return self.back_project(coefficients) / self.row_length**2

    def mean_dc(self, coefficient: Any, image: NDArray[Any]) -> Any:
        """What an ``image`` (H, W) lacks in every pixel for the ``coefficient`` of the level."""
        row = self._dc_row
        return (coefficient - (row * image).sum()) / row.sum()

    @cached_property
    def _dc_row(self) -> Floats:
        return self.back_project((~self.varying).astype(np.float64))

    @cached_property
    def varying(self) -> NDArray[np.bool_]:
        """Rows (K,) other than the level."""
        return np.arange(self.shape[0]) != (-1 if self.level is None else self.level)

    def in_atoms(self, vertical: Floats, horizontal: Floats) -> "SeenAtoms":
        """What rows other than the level see of outer products of atoms.

        ``vertical`` (H, a) and ``horizontal`` (W, b) have an atom in each column.
        """
        return SeenAtoms(vertical.T @ self._unit_rows @ horizontal)

    @cached_property
    def _unit_rows(self) -> Floats:
        """Rows other than the level (..., H, W), of length 1."""
        return self.back_project(np.eye(self.shape[0])[self.varying]) / self.row_length

    def _project(self, flat: NDArray[Any]) -> NDArray[Any]:
        raise NotImplementedError

    def _combine(self, coefficients: NDArray[Any]) -> NDArray[Any]:
        raise NotImplementedError

    def matvec(self, image: NDArray[Any]) -> NDArray[Any]:
        """A x of a flat image (N,)."""
        return self._project(np.ravel(image))

    def rmatvec(self, coefficients: NDArray[Any]) -> NDArray[Any]:
        """A^T y of coefficients (K,), a flat image."""
        return self._combine(np.ravel(coefficients))


class SeenAtoms:
    """Products of K orthonormal rows with outer products (a, b) of atoms."""

    def __init__(self, products: Floats) -> None:
        self._products = products  # (K, a, b)

    def by_row(self, variance: Floats) -> Floats:
        """Sum over atoms of squared products times ``variance`` (a, b): (K,)."""
        return np.einsum("khw,hw->k", self._products**2, variance)

    def by_atom(self) -> Floats:
        """Sum over rows of squared products: (a, b)."""
        return np.asarray((self._products**2).sum(axis=0))

    def of(self, atoms: tuple[NDArray[np.intp], ...]) -> Floats:
        """Products with the atoms at these rows and columns (A,) of the band: (K, A)."""
        return self._products[:, atoms[0], atoms[1]]

    def combined(self, weights: NDArray[Any]) -> NDArray[Any]:
        """Sums of products by weights (..., K) of the rows: (..., a, b)."""
        return np.tensordot(weights, self._products, axes=1)


class RowOperator(MeasurementOperator):
    """Rows of an orthogonal basis, by their factors where the basis has them."""

    def __init__(self, basis: Basis, index: NDArray[np.int32]) -> None:
        super().__init__(len(index), basis.shape)
        self.basis = basis
        self.index = index
        self.row_length = float(np.sqrt(basis.pixels))
        position = np.flatnonzero(index == (-1 if basis.level is None else basis.level))
        self.level = int(position[0]) if position.size else None
        self._products = None if basis.factors is None else _Products(*basis.factors, index)

    def in_atoms(self, vertical: Floats, horizontal: Floats) -> SeenAtoms:
        """As any operator does, by factors where the basis has them."""
        if self.basis.factors is None:
            return super().in_atoms(vertical, horizontal)
        height, width = self.basis.shape
        tall, wide = self.basis.factors
        products = tall @ vertical / np.sqrt(height), wide @ horizontal / np.sqrt(width)
        return _SeenFactors(*products, np.unravel_index(self.index[self.varying], (height, width)))

    def _project(self, flat: NDArray[Any]) -> NDArray[Any]:
        if self._products is None:
            return self.basis.project(flat, self.index)
        return self._products.project(flat)

    def _combine(self, coefficients: NDArray[Any]) -> NDArray[Any]:
        if self._products is None:
            return self.basis.combine(coefficients, self.index)
        return self._products.combine(coefficients)


class _Products:
    """Rows that are outer products: of either side's factors only those that occur."""

    def __init__(self, tall: Floats, wide: Floats, index: NDArray[np.int32]) -> None:
        vertical, horizontal = np.divmod(index, len(wide))
        above, row = np.unique(vertical, return_inverse=True)
        beside, column = np.unique(horizontal, return_inverse=True)
        self._tall, self._wide = tall[above], wide[beside]
        self._place = row * len(beside) + column

    def project(self, flat: NDArray[Any]) -> NDArray[Any]:
        images = flat.reshape(*flat.shape[:-1], self._tall.shape[1], self._wide.shape[1])
        products = self._tall @ images @ self._wide.T
        return products.reshape(*flat.shape[:-1], -1)[..., self._place]

    def combine(self, coefficients: NDArray[Any]) -> NDArray[Any]:
        stack = coefficients.shape[:-1]
        weights = np.zeros(
            (*stack, len(self._tall) * len(self._wide)), np.result_type(coefficients, np.float64)
        )
        weights[..., self._place] = coefficients
        weights = weights.reshape(*stack, len(self._tall), len(self._wide))
        return (self._tall.T @ weights @ self._wide).reshape(*stack, -1)


class _SeenFactors(SeenAtoms):
    """The same where rows are outer products: both sides apart, so that no array is K x N."""

    def __init__(
        self, vertical: Floats, horizontal: Floats, rows: tuple[NDArray[np.intp], ...]
    ) -> None:
        self._vertical, self._horizontal, self._rows = vertical, horizontal, rows

    def by_row(self, variance: Floats) -> Floats:
        return (self._vertical**2 @ variance @ self._horizontal.T**2)[self._rows]

    def by_atom(self) -> Floats:
        sampled = np.zeros((len(self._vertical), len(self._horizontal)))
        sampled[self._rows] = 1
        return self._vertical.T**2 @ sampled @ self._horizontal**2

    def of(self, atoms: tuple[NDArray[np.intp], ...]) -> Floats:
        tall, wide = self._rows
        return self._vertical[tall[:, None], atoms[0]] * self._horizontal[wide[:, None], atoms[1]]

    def combined(self, weights: NDArray[Any]) -> NDArray[Any]:
        above, beside, position = self._occurring
        there = np.zeros((*weights.shape[:-1], len(above) * len(beside)), weights.dtype)
        there[..., position] = weights
        there = there.reshape(*weights.shape[:-1], len(above), len(beside))
        return np.asarray(above.T @ there @ beside)

    @cached_property
    def _occurring(self) -> tuple[Floats, Floats, NDArray[np.intp]]:
        """Products of the factors that occur, and where each row is among pairs of these."""
        above, row = np.unique(self._rows[0], return_inverse=True)
        beside, column = np.unique(self._rows[1], return_inverse=True)
        position = row * beside.size + column
        return self._vertical[above], self._horizontal[beside], position


class MatrixOperator(MeasurementOperator):
    """Orthonormal rows as a matrix (K, N), of which at most the first sees the level."""

    row_length = 1.0

    def __init__(
        self, matrix: Floats, image_shape: tuple[int, int], usual_noise: Floats | None = None
    ) -> None:
        super().__init__(len(matrix), image_shape)
        self.matrix = matrix
        if usual_noise is not None:
            self.usual_noise = usual_noise
        self.level = 0 if len(matrix) and abs(matrix[0].sum()) > 1e-6 else None

    def _project(self, flat: NDArray[Any]) -> NDArray[Any]:
        return flat @ self.matrix.T

    def _combine(self, coefficients: NDArray[Any]) -> NDArray[Any]:
        return coefficients @ self.matrix

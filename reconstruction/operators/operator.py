"""Linear operators with orthogonal rows of equal length, from images to coefficients."""

from collections.abc import Hashable
from functools import cached_property
from typing import Any
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from .basis import Basis


class MeasurementOperator:
    """y = A x: K coefficients of images x (N,), with A A^T = row_length^2 I.

    `forward` and `back_project` act on stacks of images. `scipy.sparse.linalg.aslinearoperator`
    accepts the operator through its shape, dtype, `matvec` and `rmatvec`.

    Attributes
    ----------
    image_shape
        Rows H and columns W of the images.
    dc_row
        Index of the row that alone sees a constant image, or None.
    usual_noise
        Relative standard deviation (K,) of the coefficients if all readings are equally noisy.
    shared
        Cache of objects that methods derive from the operator, held as long as one is in use.
    """

    dtype = np.dtype(np.float64)

    image_shape: tuple[int, int]
    row_length: float
    dc_row: int | None
    usual_noise: Floats

    def __init__(self, rows: int, image_shape: tuple[int, int]) -> None:
        self.image_shape = image_shape
        self.usual_noise = np.ones(rows)
        self.shared: WeakValueDictionary[Hashable, Any] = WeakValueDictionary()
        self.shape = rows, image_shape[0] * image_shape[1]

    def forward(self, images: NDArray[Any]) -> NDArray[Any]:
        """Coefficients (..., K) of images (..., H, W), real or complex."""
        flat = np.asarray(images).reshape(*np.shape(images)[:-2], self.shape[1])
        return self._project(flat)

    def back_project(self, coefficients: NDArray[Any]) -> NDArray[Any]:
        """A^T y: images (..., H, W) of coefficients (..., K)."""
        flat = self._combine(np.asarray(coefficients))
        return flat.reshape(*flat.shape[:-1], *self.image_shape)

    def min_norm(self, coefficients: NDArray[Any]) -> NDArray[Any]:
        """Minimum-norm images (..., H, W) among all that have these coefficients (..., K)."""
        return self.back_project(coefficients) / self.row_length**2

    def dc_offset(self, coefficient: Any, image: NDArray[Any]) -> Any:
        """Constant to add to an ``image`` (H, W) so that it has this DC ``coefficient``."""
        row = self._dc_pattern
        return (coefficient - (row * image).sum()) / row.sum()

    @cached_property
    def _dc_pattern(self) -> Floats:
        return self.back_project((~self.varying).astype(np.float64))

    @cached_property
    def varying(self) -> NDArray[np.bool_]:
        """Mask (K,) of all rows but the DC row."""
        return np.arange(self.shape[0]) != (-1 if self.dc_row is None else self.dc_row)

    def in_atoms(self, vertical: Floats, horizontal: Floats) -> "SeenAtoms":
        """Products of the rows other than DC with separable atoms.

        Atoms are outer products of the columns of ``vertical`` (H, a) and ``horizontal`` (W, b).
        """
        return SeenAtoms(vertical.T @ self._unit_rows @ horizontal)

    @cached_property
    def _unit_rows(self) -> Floats:
        """Rows other than DC (..., H, W), normalised to length 1."""
        return self.back_project(np.eye(self.shape[0])[self.varying]) / self.row_length

    def _project(self, flat: NDArray[Any]) -> NDArray[Any]:
        raise NotImplementedError

    def _combine(self, coefficients: NDArray[Any]) -> NDArray[Any]:
        raise NotImplementedError

    def matvec(self, image: NDArray[Any]) -> NDArray[Any]:
        """A x of a flat image (N,)."""
        return self._project(np.ravel(image))

    def rmatvec(self, coefficients: NDArray[Any]) -> NDArray[Any]:
        """A^T y of coefficients (K,), as a flat image."""
        return self._combine(np.ravel(coefficients))


class SeenAtoms:
    """Products of K orthonormal rows with outer products (a, b) of atoms."""

    def __init__(self, products: Floats) -> None:
        self._products = products  # (K, a, b)

    def by_row(self, variance: Floats) -> Floats:
        """Sum over atoms of the squared products times ``variance`` (a, b): (K,)."""
        return np.einsum("khw,hw->k", self._products**2, variance)

    def by_atom(self) -> Floats:
        """Sum over rows of the squared products: (a, b)."""
        return np.asarray((self._products**2).sum(axis=0))

    def of(self, atoms: tuple[NDArray[np.intp], ...]) -> Floats:
        """Products (K, A) with the atoms at these row and column indices (A,)."""
        return self._products[:, atoms[0], atoms[1]]

    def combined(self, weights: NDArray[Any]) -> NDArray[Any]:
        """Sum over rows of the products, weighted by ``weights`` (..., K): (..., a, b)."""
        return np.tensordot(weights, self._products, axes=1)


class RowOperator(MeasurementOperator):
    """Rows ``index`` (K,) of an orthogonal basis, evaluated by their factors if it is separable."""

    def __init__(self, basis: Basis, index: NDArray[np.int32]) -> None:
        super().__init__(len(index), basis.shape)
        self.basis = basis
        self.index = index
        self.row_length = float(np.sqrt(basis.pixels))
        dc = np.flatnonzero(index == (-1 if basis.dc_row is None else basis.dc_row))
        self.dc_row = int(dc[0]) if dc.size else None
        self._products: _Products | None = None
        if basis.factors is not None:
            self._products = _Products(*basis.factors, np.divmod(index, basis.shape[1]))

    def in_atoms(self, vertical: Floats, horizontal: Floats) -> SeenAtoms:
        """Products of the rows other than DC with separable atoms, by factors where possible."""
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
    """Rows of a separable basis, with only those factors that occur."""

    def __init__(self, tall: Floats, wide: Floats, rows: tuple[NDArray[Any], ...]) -> None:
        above, row = np.unique(rows[0], return_inverse=True)
        beside, column = np.unique(rows[1], return_inverse=True)
        self._tall, self._wide = tall[above], wide[beside]
        self._index = row * len(beside) + column

    def project(self, flat: NDArray[Any]) -> NDArray[Any]:
        images = flat.reshape(*flat.shape[:-1], self._tall.shape[1], self._wide.shape[1])
        products = self._tall @ images @ self._wide.T
        return products.reshape(*flat.shape[:-1], -1)[..., self._index]

    def combine(self, coefficients: NDArray[Any]) -> NDArray[Any]:
        stack = coefficients.shape[:-1]
        weights = np.zeros(
            (*stack, len(self._tall) * len(self._wide)), np.result_type(coefficients, np.float64)
        )
        weights[..., self._index] = coefficients
        weights = weights.reshape(*stack, len(self._tall), len(self._wide))
        return (self._tall.T @ weights @ self._wide).reshape(*stack, -1)


class _SeenFactors(SeenAtoms):
    """`SeenAtoms` of separable rows, both sides apart, so that no array has K x N entries."""

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
        shape = self._vertical.shape[1], self._horizontal.shape[1]
        return self._products_of_rows.combine(weights).reshape(*weights.shape[:-1], *shape)

    @cached_property
    def _products_of_rows(self) -> _Products:
        return _Products(self._vertical, self._horizontal, self._rows)


class MatrixOperator(MeasurementOperator):
    """Orthonormal rows in a matrix (K, N), of which only the first may see a constant image."""

    row_length = 1.0

    def __init__(
        self, matrix: Floats, image_shape: tuple[int, int], usual_noise: Floats | None = None
    ) -> None:
        super().__init__(len(matrix), image_shape)
        self.matrix = matrix
        if usual_noise is not None:
            self.usual_noise = usual_noise
        self.dc_row = 0 if len(matrix) and abs(matrix[0].sum()) > 1e-6 else None

    def _project(self, flat: NDArray[Any]) -> NDArray[Any]:
        return flat @ self.matrix.T

    def _combine(self, coefficients: NDArray[Any]) -> NDArray[Any]:
        return coefficients @ self.matrix

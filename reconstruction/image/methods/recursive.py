"""Recursive estimation: coefficients of earlier frames contribute as far as they still hold.

For recordings whose frames are reconstructed in order. If they expose different patterns, the image
rests on all of these; if they expose the same, on the mean of their readings. After a cut it is
that of the single frame. See `reconstruction.image.memory`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...base.errors import InputError
from ...operators import MeasurementOperator, RowOperator
from ..coefficients import Coefficients
from ..memory import Memory
from ..method import CarryingMethod, Estimate, ImageMethod, ImageSolver
from . import image_method


@dataclass(frozen=True)
class Recursive:
    """The ``inner`` method, applied to the coefficients of this and earlier frames."""

    title = "recursive"
    inner: str = "least-squares"

    def compile(self, operator: MeasurementOperator) -> ImageSolver:
        """Solver of the inner method, for frames without predecessors."""
        return self._method.compile(operator)

    def begin(self, operators: Sequence[MeasurementOperator]) -> ImageMethod:
        """Start the method for one recording; InputError unless the basis is orthogonal."""
        rows = [each for each in operators if isinstance(each, RowOperator)]
        if len(rows) < len(operators):
            raise InputError(
                "image method 'recursive' needs patterns of an orthogonal basis, such as Hadamard's"
            )
        index = np.unique(np.concatenate([each.index for each in rows]))
        return _Remembering(self._method, RowOperator(rows[0].basis, index))

    @property
    def _method(self) -> ImageMethod:
        method = image_method(self.inner)
        if isinstance(method, CarryingMethod):
            raise InputError(
                f"image method 'recursive:{self.inner}': {self.inner} is recursive already"
            )
        return method


class _Remembering:
    """Method of one recording, with its memory."""

    title = Recursive.title

    def __init__(self, inner: ImageMethod, operator: RowOperator) -> None:
        self._operator = operator
        self._memory = Memory(operator)
        self._inner, self._solve = inner, inner.compile(operator)

    def compile(self, operator: MeasurementOperator) -> ImageSolver:
        """Solver of frames that measure this operator's coefficients."""
        assert isinstance(operator, RowOperator)
        rows = np.searchsorted(self._operator.index, operator.index)
        others = np.ones(self._operator.shape[0], dtype=bool)
        others[rows] = False
        alone = self._inner.compile(operator)

        def solve(coefficients: Coefficients) -> Estimate:
            given = self._memory.take(rows, coefficients)
            if (given.measured & others).any():
                return self._solve(given)
            return alone(Coefficients(given.values[rows], given.noise[rows]))

        return solve


METHOD = Recursive()

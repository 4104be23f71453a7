"""Frames that remember: the coefficients of earlier frames, as far as they still hold, join.

For recordings whose frames are reconstructed in their order. Where they show different patterns,
the image rests on all of these; where they show the same, on the mean of their readings. After a
cut it is that of the single frame. See `reconstruction.image.memory`.
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
    """The ``inner`` method, on what this frame and those before it tell together."""

    title = "recursive"
    inner: str = "least-squares"

    def compile(self, operator: MeasurementOperator) -> ImageSolver:
        """The inner method's solver, of frames that have no others before them."""
        return self._method.compile(operator)

    def begin(self, operators: Sequence[MeasurementOperator]) -> ImageMethod:
        """The method of one recording.

        Raises InputError where patterns are not of an orthogonal basis, and as the inner method.
        """
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
            raise InputError(f"image method 'recursive:{self.inner}': one memory is enough")
        return method


class _Remembering:
    """The method of one recording, and what it remembers of it."""

    title = Recursive.title

    def __init__(self, inner: ImageMethod, operator: RowOperator) -> None:
        self._operator = operator
        self._memory = Memory(operator)
        self._inner, self._solve = inner, inner.compile(operator)

    def compile(self, operator: MeasurementOperator) -> ImageSolver:
        """Solver of frames of which this operator's coefficients are measured."""
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

"""Recursive estimation: coefficients of earlier frames contribute as far as they still hold.

For recordings whose frames are reconstructed in order. If they expose different patterns, the image
rests on all of these; if they expose the same, on the mean of their readings. After a cut it is
that of the single frame. Where frames have poses, the last image moves as they and the depth map
say, as far as the readings agree. See `reconstruction.image.memory`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError
from ...operators import MeasurementOperator, RowOperator
from ..coefficients import Coefficients
from ..memory import Memory
from ..method import CarryingMethod, Estimate, ImageMethod, ImageSolver, Motion
from . import image_method

VEIL = 1 / 8
"""Blur that leaves the veil of fog, which moves with the camera, relative to the longer side."""


@dataclass(frozen=True)
class Recursive:
    """The ``inner`` method, applied to the coefficients of this and earlier frames."""

    title = "recursive"
    inner: str = "least-squares"

    def compile(self, operator: MeasurementOperator) -> ImageSolver:
        """Solver of the inner method, for frames without predecessors."""
        return self._method.compile(operator)

    def begin(self, operators: Sequence[MeasurementOperator], motion: Motion) -> ImageMethod:
        """Start the method for one recording; InputError unless the basis is orthogonal."""
        rows = [each for each in operators if isinstance(each, RowOperator)]
        if len(rows) < len(operators):
            raise InputError(
                "image method 'recursive' needs patterns of an orthogonal basis, such as Hadamard's"
            )
        index = np.unique(np.concatenate([each.index for each in rows]))
        return _Remembering(self._method, RowOperator(rows[0].basis, index), motion)

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

    def __init__(self, inner: ImageMethod, operator: RowOperator, motion: Motion) -> None:
        self._operator, self._motion = operator, motion
        self._image: NDArray[np.inexact] | None = None
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
            changes, self._image = self._changes(), None
            given = self._memory.take(rows, coefficients, changes)
            if (given.measured & others).any():
                estimate = self._solve(given)
            else:
                estimate = alone(Coefficients(given.values[rows], given.noise[rows]))
            self._image = estimate.image
            return estimate

        return solve

    def _changes(self) -> NDArray[np.inexact] | None:
        """Changes (2, K) of coefficients if all of the last image moves, or all but a veil."""
        move = self._motion()
        if self._image is None or move is None:
            return None
        from scipy.ndimage import gaussian_filter  # slow to load

        veil = gaussian_filter(self._image, VEIL * max(self._image.shape), mode="nearest")
        images = np.array([self._image, self._image - veil])
        changes = self._operator.forward(move(images) - images)
        return changes if np.isfinite(changes).all() else None


METHOD = Recursive()

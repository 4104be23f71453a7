"""Interface of image methods."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from numpy.typing import NDArray

from ..base.arrays import Floats
from ..operators import MeasurementOperator
from .coefficients import Coefficients


@dataclass(frozen=True, eq=False)
class Estimate:
    """Result of an image method.

    Parameters
    ----------
    image
        Image (H, W), complex if the coefficients are.
    sigma
        Standard deviation (H, W) of the pixels, None if the method cannot estimate it.
    note
        Message to the user, such as that another method was used instead.
    """

    image: NDArray[Any]
    sigma: Floats | None = None
    note: str | None = None


ImageSolver = Callable[[Coefficients], Estimate]
"""From the coefficients of one frame to the image and its standard deviation."""


@runtime_checkable
class SolverOfMany(Protocol):
    """`ImageSolver` that processes several frames faster together than one by one."""

    def many(self, frames: Sequence[Coefficients]) -> list[Estimate]:
        """Estimate for each frame."""


class ImageMethod(Protocol):
    """Image method; `compile` does the work that frames share."""

    title: str
    """Short label for plots and tables."""

    def compile(self, operator: MeasurementOperator) -> ImageSolver:
        """Create the solver of an operator's coefficients; InputError if it cannot be used."""


Motion = Callable[[], Callable[[NDArray[Any]], NDArray[Any]] | None]
"""How images (N, H, W) of the frame just before this one move, None if that is unknown."""


@runtime_checkable
class CarryingMethod(ImageMethod, Protocol):
    """Method that carries state from frame to frame, for frames taken in order.

    The solver from `compile` carries none.
    """

    def begin(self, operators: Sequence[MeasurementOperator], motion: Motion) -> ImageMethod:
        """Start the method for one recording.

        Parameters
        ----------
        operators
            Operators of its successive frames, repeated cyclically, for frames whose readings are
            all usable.
        motion
            How images move from the last frame to the one that is reconstructed.

        Raises
        ------
        InputError
            If the method cannot use them.
        """

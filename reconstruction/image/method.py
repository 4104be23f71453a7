"""What a method of making images is."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from numpy.typing import NDArray

from ..base.arrays import Floats
from ..operators import MeasurementOperator
from .coefficients import Coefficients


@dataclass(frozen=True, eq=False)
class Estimate:
    """An ``image`` (H, W), complex where its coefficients are, and how sure of it a method is.

    ``sigma`` (H, W): standard deviation of each pixel, None where the method cannot tell.
    ``note``: what the user must know of it, such as that another method took over.
    """

    image: NDArray[Any]
    sigma: Floats | None = None
    note: str | None = None


ImageSolver = Callable[[Coefficients], Estimate]
"""From the coefficients of one frame to the image and its standard deviation."""


@runtime_checkable
class SolverOfMany(Protocol):
    """An `ImageSolver` that is faster with several frames at once."""

    def many(self, frames: Sequence[Coefficients]) -> list[Estimate]:
        """What it makes of each frame."""


class ImageMethod(Protocol):
    """A way from coefficients to an image; everything that frames share is done by `compile`."""

    title: str
    """A few words for plots and tables."""

    def compile(self, operator: MeasurementOperator) -> ImageSolver:
        """Solver of this operator's coefficients.

        Raises InputError where the method cannot use the operator.
        """


@runtime_checkable
class CarryingMethod(ImageMethod, Protocol):
    """A method whose images rest on earlier frames too, of frames that are taken in their order.

    What `compile` makes knows of no others.
    """

    def begin(self, operators: Sequence[MeasurementOperator]) -> ImageMethod:
        """The method of one recording, which holds what it carries.

        ``operators`` are those of its successive frames, over and over, where all readings are
        usable. Raises InputError where the method cannot use them.
        """

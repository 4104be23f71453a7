"""What a method of making images is."""

from collections.abc import Callable, Sequence
from typing import Any, Protocol, runtime_checkable

from numpy.typing import NDArray

from ..operators import MeasurementOperator
from .coefficients import Coefficients

ImageSolver = Callable[[Coefficients], NDArray[Any]]
"""From the coefficients of one frame to the image (H, W), complex where they are."""


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

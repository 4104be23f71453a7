"""What images are made of."""

from typing import Any, Protocol

from numpy.typing import NDArray

from ..arrays import Floats


class Dictionary(Protocol):
    """Orthonormal atoms that are outer products of those of either axis, and how strong each is."""

    def __hash__(self) -> int:
        """Solvers are kept by dictionary."""

    def atoms(self, side: int) -> Floats:
        """Orthonormal atoms of one axis, one in each column: (side, side)."""

    def deviation(self, shape: tuple[int, int]) -> Floats:
        """Relative standard deviation of the atoms' coefficients in natural images, (H, W).

        0 for the constant image, whose level is measured by itself.
        """

    def synthesise(self, spectrum: NDArray[Any]) -> NDArray[Any]:
        """Image (H, W) of the atoms' coefficients (H, W), real or complex."""

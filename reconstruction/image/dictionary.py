"""What images are made of."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from ..base.arrays import Floats


@dataclass(frozen=True, eq=False)
class Band:
    """Atoms that are outer products of those of either axis, and how strong each is.

    ``vertical`` (H, a) and ``horizontal`` (W, b) have an atom in each column. ``sigma`` (a, b):
    relative standard deviation of their coefficients in natural images, 0 for the constant image,
    whose level is measured by itself.
    """

    vertical: Floats
    horizontal: Floats
    sigma: Floats


class Dictionary(Protocol):
    """Atoms of images of any shape, in bands: orthonormal or not, complete or more than that."""

    def __hash__(self) -> int:
        """Solvers are kept by dictionary."""

    def bands(self, shape: tuple[int, int]) -> Sequence[Band]:
        """All atoms of images of a shape (H, W).

        Raises InputError where there are none for that shape, or something is not installed.
        """

"""Points in a view, by which its depth map is completed."""

from dataclasses import dataclass, fields
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Floats, Mask

MAX_LOG_SIGMA = 0.3
"""Relative sigma above which a range is no point."""


class Rows:
    """Arrays of one length, of which rows can be taken."""

    def __getitem__(self, which: Mask | NDArray[np.intp]) -> Self:
        """Some of the rows."""
        return type(self)(*(getattr(self, each.name)[which] for each in fields(self)))  # type: ignore[arg-type]


@dataclass(frozen=True, eq=False)
class Seen(Rows):
    """Points as a view sees them: their indices (n,), pixels (n, 2), and ln depth.

    ``log_variance`` is that of range and position, ``pixel_variance`` that of the pixel along
    either axis.
    """

    index: NDArray[np.intp]
    pixel: Floats
    log_depth: Floats
    log_variance: Floats
    pixel_variance: Floats

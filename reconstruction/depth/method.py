"""Interface of depth methods."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import Floats
from ..capture import Frames, Setup
from ..image import Imaging
from ..ranging import Ranges

Need = Literal["optics", "spots", "pattern_taps", "poses"]
"""Parts of a recording."""


@dataclass(frozen=True, eq=False)
class Context:
    """What a depth method is compiled for: a recording and its compiled image methods."""

    setup: Setup
    imaging: Imaging


@dataclass(frozen=True, eq=False)
class View:
    """Data of one frame: ``image`` (H, W), the spots' ranges if any, and the readings."""

    image: Floats
    ranges: Ranges | None
    frame: Frames

    @property
    def directions(self) -> Floats:
        """Unit vectors (spots, 3) of the ranges."""
        assert self.frame.spots is not None
        return self.frame.spots.directions


FreeTowards = Callable[[ArrayLike], Floats]
"""Probability (K,) that a corridor is free up to each of `DISTANCES_M`, from its direction (3,)."""
MAX_RANGE_M = 40.0
"""Maximum range: anything farther counts as no return."""


@dataclass(frozen=True, eq=False)
class DepthEstimate:
    """Result of a depth method.

    Parameters
    ----------
    depth_m
        Depth (H, W) along the optical axis in metres, nan where there is none.
    sigma
        Standard deviation (H, W) of ln depth, at least where there is a depth; None if unknown.
    no_return
        Probability (H, W) that there is nothing within MAX_RANGE_M; None if unknown.
    note
        Message to the user, such as that another method was used instead.
    free
        Probability (K,) that the corridor ahead is free up to each of `DISTANCES_M`; None if it
        follows from the map (see `Corridor.free`).
    points_m
        Points (N, 3) in the optical frame that earlier frames' ranges have met; None for methods
        that remember none.
    points_log_sigma
        Standard deviations (N,) of the ln depth of those points, infinite where one is not seen
        now; None if unknown.
    free_towards
        The same as ``free`` of a corridor in another direction (3,) in view; None if unknown.
    """

    depth_m: NDArray[Any]
    sigma: Floats | None = None
    no_return: Floats | None = None
    note: str | None = None
    free: Floats | None = None
    points_m: Floats | None = None
    points_log_sigma: Floats | None = None
    free_towards: FreeTowards | None = None


def unknown_depth(shape: tuple[int, int]) -> DepthEstimate:
    """The map (H, W) of a frame for which no method has one."""
    return DepthEstimate(np.full(shape, np.nan), note="no depth map")


DepthSolver = Callable[[View], DepthEstimate | None]
"""From a frame to a depth map, or None if the frame contains no depth information."""


class DepthMethod(Protocol):
    """Depth method; `compile` does the work that frames share."""

    title: str
    """Short label for plots and tables."""
    needs: tuple[Need, ...]
    """Parts that a recording must have."""

    def compile(self, context: Context) -> DepthSolver:
        """Create the solver of a recording's frames; InputError if the recording is unsuitable."""

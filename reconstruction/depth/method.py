"""What a method of making depth maps is."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, Protocol

from numpy.typing import NDArray

from ..base.arrays import Floats
from ..capture import Frames, Setup
from ..image import Imaging
from ..ranging import Ranges

Need = Literal["optics", "spots", "pattern_taps"]
"""Parts of a recording."""


@dataclass(frozen=True, eq=False)
class Context:
    """What a depth method is compiled for: a recording, and its compiled image methods."""

    setup: Setup
    imaging: Imaging


@dataclass(frozen=True, eq=False)
class View:
    """What is known of one frame: ``image`` (H, W), the spots' ranges if any, and the readings."""

    image: Floats
    ranges: Ranges | None
    frame: Frames


MAX_RANGE_M = 40.0
"""What is farther than this counts as nothing: it returns too little, and can wait."""


@dataclass(frozen=True, eq=False)
class DepthEstimate:
    """A depth map and how sure of it a method is, each (H, W).

    ``depth_m``: along the optical axis, nan where there is none. ``sigma``: standard deviation
    of ln depth, at least where there is a depth, and ``no_return``: probability in each pixel that
    there is nothing within REACH_M; both None where the method cannot tell. ``free`` (K,):
    probability that the corridor ahead is free up to each of `DISTANCES_M`, None where it is to be
    read off the map (see `Corridor.free`). ``note``: what the user must know of it, such as that
    another method took over.
    """

    depth_m: NDArray[Any]
    sigma: Floats | None = None
    no_return: Floats | None = None
    note: str | None = None
    free: Floats | None = None


DepthSolver = Callable[[View], DepthEstimate | None]
"""From a frame to depths; None where the frame tells nothing of them."""


class DepthMethod(Protocol):
    """A way from image, ranges or readings to depths; what frames share is done by `compile`."""

    title: str
    """A few words for plots and tables."""
    needs: tuple[Need, ...]
    """What a recording must have."""

    def compile(self, context: Context) -> DepthSolver:
        """Solver of one recording's frames.

        Raises InputError where the recording does not tell what the method needs.
        """

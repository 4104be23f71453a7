"""What a method of making depth maps is."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, Protocol

from numpy.typing import NDArray

from ..arrays import Floats
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


DepthSolver = Callable[[View], NDArray[Any] | None]
"""From a frame to depths (H, W) along the optical axis in metres, nan where there is none.

None where the frame tells nothing of depth.
"""


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

"""Whether the four spots of a recording are calibrated alike."""

from collections.abc import Callable

from ..capture import Spots
from ..capture.schema import between
from .fog.offsets import OffsetEvidence, PathOffsets, offset_finder, path_offsets
from .methods.fog import METHOD
from .ranges import LONGEST_IN_FOG_M


def path_check(spots: Spots) -> Callable[[Spots], OffsetEvidence | None]:
    """What each frame of a recording tells of its paths; see `fog.offsets.offset_finder`."""
    return offset_finder(spots, min(METHOD.unambiguous_range_m(spots), LONGEST_IN_FOG_M))


def measure_path_offsets(spots: Spots) -> PathOffsets:
    """What all frames tell together.

    Raises InputError of histograms, and where the recording does not tell what ranging in fog
    needs.
    """
    find = path_check(between(spots, 0, 0))
    frames = range(len(spots.readings))
    return path_offsets([find(between(spots, frame, frame + 1)) for frame in frames])

"""Methods of ranging, one module each; the one named as a kind of readings is its plain one."""

import numpy as np

from ...capture import Spots
from ...capture.readings.cw import CwSpots
from ...capture.readings.dtof import HistogramSpots
from ...capture.readings.pulsed import PulsedSpots
from ...capture.schema import between
from ...errors import InputError
from ...registry import Registry
from ..method import RangingMethod
from ..ranges import LONGEST_IN_FOG_M, Ranges

RANGING_METHODS: Registry[RangingMethod] = Registry(
    "ranging method", package=__name__, attribute="METHOD", group="reconstruction.rangings"
)

MANY_WINDOWS = 12
"""Windows of a pulse that tell fog from targets."""


def ranging_method(name: str, spots: Spots) -> RangingMethod:
    """Method of this name; InputError if there is none, or it reads another kind of readings."""
    method = RANGING_METHODS[name]
    if not isinstance(spots, method.reads):
        fitting = [
            name for name, each in RANGING_METHODS.loadable() if isinstance(spots, each.reads)
        ]
        kinds = method.reads if isinstance(method.reads, tuple) else (method.reads,)
        raise InputError(
            f"ranging method {name!r} reads {' and '.join(repr(kind.method) for kind in kinds)} "
            f"spots, not those of "
            f"{spots.method!r}; allowed: {', '.join(fitting)}"
        )
    return method


def reads(name: str, spots: Spots) -> bool:
    """Whether a method understands these readings."""
    return isinstance(spots, RANGING_METHODS[name].reads)


def usual_rangings(spots: Spots) -> tuple[str, ...]:
    """The plain method of these readings; before it the one that knows of fog, where they tell.

    Those of several frequencies or many windows do, and histograms. One frequency, or a few
    windows, can only say that they do not know; and readings that tell of targets farther off than
    drones fly in fog would lose these.
    """
    match spots:
        case CwSpots():
            tell = np.unique(spots.tap_frequencies_hz).size > 1
        case PulsedSpots():
            tell = spots.window_starts_s.size >= MANY_WINDOWS
        case _:
            tell = isinstance(spots, HistogramSpots)
    fog = RANGING_METHODS["fog"]
    if tell and fog.unambiguous_range_m(spots) <= LONGEST_IN_FOG_M:
        return "fog", spots.method
    return (spots.method,)


def measure_ranges(spots: Spots, frame: int = 0, method: str | None = None) -> Ranges:
    """Ranges of one frame, by the plain method of these readings where None."""
    solver = ranging_method(method or spots.method, spots).compile(between(spots, 0, 0))
    return solver(between(spots, frame, frame + 1))

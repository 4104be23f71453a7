"""What becomes of a frame, and the state of a stream, as tables of a message."""

from dataclasses import asdict, dataclass, fields
from typing import Any, NamedTuple, get_args

import numpy as np

from ..depth import DISTANCES_M
from ..ranging import Ranges, Status
from ..result import Result
from .counts import Counts
from .setups import StreamSetup
from .tables import Value

STATUSES = get_args(Status)
"""Of a spot, by the numbers that stand for them."""


class Outcome(NamedTuple):
    """The result of a frame, with its number and time as the sender tells them.

    ``latency_s``: from the frame's last byte to the result.
    """

    stream: StreamSetup
    result: Result
    time_ns: int
    latency_s: float


@dataclass(frozen=True)
class State:
    """How a stream is, at present: ``age_s`` since the last frame with a result came, nan before.

    ``latency_s`` and ``latency_99_s`` are median and 99th percentile of the latest frames,
    ``frames_per_s`` is since the last state, ``trouble`` a sentence, or empty; ``waiting_for`` is
    what has been waited for these ``waiting_s``.
    """

    counts: Counts
    age_s: float
    latency_s: float
    latency_99_s: float
    frames_per_s: float
    trouble: str
    waiting_for: str = ""
    waiting_s: float = 0.0

    @property
    def numbers(self) -> dict[str, Any]:
        """All of it by name."""
        return {
            **asdict(self.counts),
            **{each.name: getattr(self, each.name) for each in fields(self)[1:]},
        }


def result_entries(outcome: Outcome) -> dict[str, Any]:
    """Images (H, W) as float32, ranges (4,) as float64; what there is not is left out."""
    result = outcome.result
    entries: dict[str, Any] = {
        "image": result.image,
        "image_unit": result.unit,
        "image_deviation": result.sigma,
        "depth_m": result.depth_m,
        "depth_deviation": result.log_depth_sigma,
        "nothing": result.no_return,
        "free_probability": result.free_probability,
        "free_distance_m": None if result.free_probability is None else DISTANCES_M,
        "obstacle_m": result.obstacle_m,
        "latency_s": outcome.latency_s,
    }
    if result.ranges is not None:
        entries |= _ranges(result.ranges)
    return {name: value for name, value in entries.items() if value is not None}


def _ranges(ranges: Ranges) -> dict[str, Any]:
    return {
        "range_m": ranges.range_m,
        "range_sigma_m": ranges.sigma_m,
        "range_status": np.array([STATUSES.index(each) for each in ranges.status], np.uint8),
    }


def state_entries(state: State) -> dict[str, Any]:
    """Counts as integers of 64 bits, the others as float64."""
    return {
        name: np.int64(value) if isinstance(value, int) else value
        for name, value in state.numbers.items()
    }


def text_of(value: Value) -> str:
    """A text of a table; what is none in UTF-8 is shown as an escape."""
    return bytes(value.item()).decode(errors="backslashreplace")

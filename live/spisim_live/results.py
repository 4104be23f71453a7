"""Results and state of a stream, as tables of a message."""

from dataclasses import asdict, dataclass, fields
from typing import Any, NamedTuple, get_args

import numpy as np

from reconstruction.depth import DISTANCES_M
from reconstruction.ranging import Status
from reconstruction.result import Result

from .counts import Counts
from .setups import StreamSetup
from .tables import Value

STATUSES = get_args(Status)
"""Status of a spot, by its number in a message."""


class Outcome(NamedTuple):
    """Result of a frame, with the number and time of its sender.

    ``latency_s`` is from the frame's last byte to the result.
    """

    stream: StreamSetup
    result: Result
    time_ns: int
    latency_s: float


@dataclass(frozen=True)
class State:
    """State of a stream: ``age_s`` since the last frame with a result, nan before.

    ``latency_s`` and ``latency_99_s`` are median and 99th percentile of the latest frames,
    ``frames_per_s`` is since the last state, ``trouble`` a sentence, or empty; ``waiting_for`` has
    been awaited for ``waiting_s``.
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
        """All values by name."""
        return {
            **asdict(self.counts),
            **{each.name: getattr(self, each.name) for each in fields(self)[1:]},
        }


def result_entries(outcome: Outcome) -> dict[str, Any]:
    """Maps (H, W) as float32, ranges (spots,) as float64; missing values are left out."""
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
    if (ranges := result.ranges) is not None:
        entries["range_m"], entries["range_sigma_m"] = ranges.range_m, ranges.sigma_m
        status = [STATUSES.index(each) for each in ranges.status]
        entries["range_status"] = np.array(status, np.uint8)
    return {name: value for name, value in entries.items() if value is not None}


def state_entries(state: State) -> dict[str, Any]:
    """Counts as 64-bit integers, other numbers as float64."""
    return {
        name: np.int64(value) if isinstance(value, int) else value
        for name, value in state.numbers.items()
    }


def text_of(value: Value) -> str:
    """Text of a table entry; bytes that are not UTF-8 are escaped."""
    return bytes(value.item()).decode(errors="backslashreplace")

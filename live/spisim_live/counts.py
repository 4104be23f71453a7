"""Counts of a stream's frames, and their latencies."""

from collections import deque
from dataclasses import dataclass

import numpy as np

ROLLING = 1024
"""Number of latest frames in the latencies."""


@dataclass
class Counts:
    """Numbers since the beginning.

    Frames are ``received`` whole and in order; ``lost`` if they did not come in time, of which
    ``late`` ones came after all (and are no longer lost); ``reordered`` came after a later one;
    ``duplicated`` came twice; ``corrupted`` fail their checksum; ``refused`` ones, and setups, are
    invalid, or far ahead of all others; ``strangers`` have an unknown setup; ``dropped`` were too
    many for this machine; ``failed`` have no result. ``method_failures`` are frames whose results
    lack those of a method, ``sink_failures`` frames, results and states that a sink did not take.
    ``discarded_bytes`` belong to no sound message, ``ignored_bytes`` came from other senders;
    ``given_up`` messages began but did not end; ``foreign`` ones have another version; ``restarts``
    of the sender and ``connections`` to it.
    """

    received: int = 0
    reconstructed: int = 0
    lost: int = 0
    late: int = 0
    reordered: int = 0
    duplicated: int = 0
    corrupted: int = 0
    refused: int = 0
    strangers: int = 0
    dropped: int = 0
    failed: int = 0
    method_failures: int = 0
    sink_failures: int = 0
    foreign: int = 0
    restarts: int = 0
    connections: int = 0
    discarded_bytes: int = 0
    ignored_bytes: int = 0
    given_up: int = 0


class Latencies:
    """Seconds from a frame's last byte to its result, of the latest `ROLLING` frames."""

    def __init__(self) -> None:
        self._seconds: deque[float] = deque(maxlen=ROLLING)

    def add(self, seconds: float) -> None:
        """Add a frame."""
        self._seconds.append(seconds)

    def percentile(self, fraction: float) -> float:
        """Percentile in seconds; nan without frames."""
        return float(np.percentile(self._seconds, fraction)) if self._seconds else float("nan")

"""What has become of the frames of a stream, and how long they took."""

from collections import deque
from dataclasses import dataclass

import numpy as np

ROLLING = 1024
"""Frames whose latencies are looked at."""


@dataclass
class Counts:
    """Numbers since the beginning.

    Frames are ``received`` whole and in turn; ``lost`` are those that were not there in time, of
    which ``late`` ones came after all (and are then no longer lost); ``reordered`` ones came after
    a later one and were put in turn; ``duplicated`` ones came again; ``corrupted`` ones have a
    payload that is not what its checksum says; ``refused`` ones, and setups, cannot be used; of
    ``strangers`` the setup is not known. ``dropped`` were too many for this machine, ``failed``
    have no result. In other frames there were ``method_failures``, and their results lack what
    these methods tell; ``sink_failures`` are frames, results and states that a sink has not taken.
    ``discarded_bytes`` belong to no sound message, ``ignored_bytes`` came from others than who is
    heard; ``given_up`` messages began and did not come on; ``foreign`` ones are of another version;
    ``restarts`` of the sender and ``connections`` to it.
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
        """Of one more frame."""
        self._seconds.append(seconds)

    def percentile(self, fraction: float) -> float:
        """Seconds that so many per cent of the frames stay below; nan without any."""
        return float(np.percentile(self._seconds, fraction)) if self._seconds else float("nan")

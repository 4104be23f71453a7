"""Poses of frames from an autopilot's messages."""

import logging
import math
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError, in_words
from reconstruction.capture import Poses

from ..links import Source
from ..reception import FIRST_DELAY_S, MAX_DELAY_S, POLL_S, Arrival
from .clock import Clock, Instant
from .codec import codec, dialect, logged
from .connections import is_log, mavlink_source
from .readings import Reading, reading_of
from .track import Track, rotation_vector, slerp

logger = logging.getLogger(__name__)

HORIZON_S = 10.0
"""Messages are kept so long for frames that arrive late."""
MAX_LOG_BYTES = 2**30
TICK_S = 1e-6
"""Between frames without time stamps that arrive together."""


class PoseSigmas(NamedTuple):
    """Standard deviations of position and attitude, for messages that state none."""

    position_m: float = math.nan
    attitude_rad: float = math.nan

    @property
    def covariance(self) -> Floats:
        """Covariance (6, 6), nan if unknown."""
        variances = np.repeat([self.position_m**2, self.attitude_rad**2], 3)
        return np.diag(variances) if np.isfinite(variances).all() else np.full((6, 6), np.nan)


UNKNOWN_SIGMAS = PoseSigmas()


class PoseSource:
    """Poses of an autopilot at the times of frames.

    Messages of the first sender of a pose are used. ``refused`` counts unusable ones, ``trouble``
    says what is wrong, ``located`` and ``missing`` count frames with and without a pose. Raises
    InputError for a connection that can never be opened, and without pymavlink.

    Parameters
    ----------
    connection : str
        As for pymavlink, such as ``udp:14550``, or a .tlog file.
    sigmas : PoseSigmas
        For messages that state no covariance.
    offset_s : float
        To add to the frames' time stamps, which then are by the clock of a .tlog, seconds since
        1970, or by that of the frames' sender.
    clock : callable
        Monotonic seconds.
    """

    def __init__(
        self,
        connection: str,
        *,
        sigmas: PoseSigmas = UNKNOWN_SIGMAS,
        offset_s: float = 0.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        dialect()
        self.connection = connection
        self.refused = self.located = self.missing = 0
        self.trouble: str | None = f"no pose yet from {connection}"
        self._sigmas = sigmas
        self._offset_s = offset_s
        self._clock = clock
        self._log = Path(connection) if is_log(connection) else None
        self._link: Source | None = None if self._log else mavlink_source(connection)
        horizon_s = HORIZON_S if self._log is None else math.inf
        self._positions, self._orientations = (
            Track(horizon_s),
            Track(horizon_s, slerp, rotation_vector),
        )
        self._covariances, self._time_sigmas = Track(horizon_s), Track(horizon_s)
        self._autopilots: dict[bool, Clock] = {True: Clock(), False: Clock()}
        self._sender: tuple[int, int] | None = None
        self._frames, self._run, self._last_s = Clock(), 0, -math.inf
        self._lock = threading.Lock()
        self._stopped = threading.Event()
        self._codec: Any = codec()
        self._check()

    def _check(self) -> None:
        """Open what listens, and read what is recorded."""
        if self._link is not None:
            self._link.check()
            return
        assert self._log is not None
        if not self._log.is_file():
            raise InputError(f"{self._log}: no such recording of MAVLink")
        if (size := self._log.stat().st_size) > MAX_LOG_BYTES:
            raise InputError(f"{self._log}: {size} bytes; at most {MAX_LOG_BYTES} of a recording")
        for time_s, message in logged(self._log):
            self.take(message, time_s)
        if self._sender is None:
            raise InputError(f"{self._log} has no message of a pose that can be used")

    def run(self) -> None:
        """Receive until `stop` is called, opening the connection again after errors."""
        delay_s = FIRST_DELAY_S
        while self._link is not None and not self._stopped.is_set():
            try:
                self._link.open()
                delay_s = FIRST_DELAY_S
                while not self._stopped.is_set():
                    self.feed(self._link.receive(POLL_S), self._clock())
            except BaseException as error:  # nobody else sees errors of this thread
                if self._stopped.is_set():
                    return
                if not isinstance(error, OSError):
                    logger.exception("%s", self.connection)
                self.trouble = f"waiting for {self.connection}: {in_words(error)}"
                self._stopped.wait(delay_s)
                delay_s = min(2 * delay_s, MAX_DELAY_S)

    def stop(self) -> None:
        """Stop, from any thread."""
        self._stopped.set()
        if self._link is not None:
            self._link.close()

    def feed(self, content: bytes, arrival_s: float) -> None:
        """Take bytes that arrived together."""
        for message in self._codec.parse_buffer(content) or ():
            self.take(message, arrival_s)

    def take(self, message: Any, arrival_s: float) -> None:
        """Take a message."""
        try:
            reading = reading_of(message)
        except InputError as error:
            self.refused += 1
            self.trouble = f"{self.connection}: {error}"
            return
        if reading is not None:
            sender = (message.get_srcSystem(), message.get_srcComponent())
            self._sender = self._sender or sender
            if sender == self._sender:
                self._add(reading, arrival_s)

    def _add(self, reading: Reading, arrival_s: float) -> None:
        """Add a reading; those of a full pose may have another clock than its parts."""
        whole = reading.position_m is not None and reading.orientation is not None
        time_s, sigma_s, confirmed = Instant(arrival_s, 0.0)
        if reading.time_s > 0:
            time_s, sigma_s, confirmed = self._autopilots[whole].at(reading.time_s, arrival_s)
        if not confirmed:
            self.refused += 1
            self.trouble = f"{self.connection}: time stamp {reading.time_s:.6g} s is not in turn"
            return
        self.trouble = None
        parts = (
            (self._time_sigmas, np.array(sigma_s)),
            (self._positions, reading.position_m),
            (self._orientations, reading.orientation),
            (self._covariances, reading.covariance),
        )
        with self._lock:
            for track, value in parts:
                if value is not None:
                    track.add(time_s, value)

    def __call__(self, arrival: Arrival) -> Poses:
        """Pose of a frame, if there is one within `MAX_GAP_S` of it."""
        stamp_s, (local_s, sigma_s, _) = self._times(arrival)
        with self._lock:
            tracks = (self._positions, self._orientations, self._covariances)
            position_m, orientation, covariance = (track.at(local_s) for track in tracks)
            of_time = self._of_time(local_s, sigma_s)
        if position_m is None or orientation is None:
            self.missing += 1
            self.trouble = self.trouble or f"{self.connection}: no pose near the last frame"
            return Poses.none(1)
        self.located += 1
        if covariance is None:
            covariance = self._sigmas.covariance
        covariance = covariance + of_time
        return Poses(np.array([stamp_s]), position_m[None], orientation[None], covariance[None])

    def _of_time(self, local_s: float, sigma_s: float) -> Floats:
        """Covariance (6, 6) of a pose from the errors of its time, and from holding the last."""
        reading = self._time_sigmas.at(local_s)
        moved = np.zeros(6)
        for track, rows in ((self._positions, slice(3)), (self._orientations, slice(3, 6))):
            rate = track.rate(local_s)
            if rate is not None and reading is not None:
                moved[rows] = rate * math.hypot(sigma_s, float(reading), track.held_s(local_s))
        return np.outer(moved, moved)

    def _times(self, arrival: Arrival) -> tuple[float, Instant]:
        """Time of a frame as its pose states it, and by the clock of the poses.

        A time stamp of 0 is none, but for that of the first frame, with which time begins.
        """
        message = arrival.message
        if message.time_ns or not message.number:
            stamp_s = message.time_ns / 1e9
            if self._log is not None:
                return stamp_s, Instant(stamp_s + self._offset_s, 0.0)
            if message.run != self._run:
                self._run, self._frames = message.run, Clock()
            instant = self._frames.at(stamp_s, arrival.received_s)
            return stamp_s, instant._replace(time_s=instant.time_s + self._offset_s)
        self._last_s = max(arrival.received_s, self._last_s + TICK_S)
        return self._last_s, Instant(self._last_s + self._offset_s, 0.0)

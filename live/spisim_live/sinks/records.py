"""Received frames, in a file of their messages or in captures."""

import datetime
import math
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path

from reconstruction.base.errors import InputError, in_words
from reconstruction.base.files import Output, is_marked
from reconstruction.base.folders import output_files
from reconstruction.capture import Capture, Frames, Poses, write_capture
from reconstruction.capture.file import KINDS

from ..framing import Kind, Message, pack
from ..links import NewFile
from ..reception import Arrival
from ..senders import Allowance
from ..setups import StreamSetup
from .sink import Sink

FRAMES_OF_A_PART, BYTES_OF_A_PART = 4096, 2**26
FRAMES_BETWEEN = 512
"""Frames after which the last part is written again: so many are lost in a crash."""


class StreamRecord(Sink):
    """Messages of all frames, and of the setups before them."""

    waiting = 256

    def __init__(
        self, outlet: NewFile, read: Sequence[Path] = (), *, overwrite: bool = False
    ) -> None:
        self._outlet = outlet
        self._read = read
        self._overwrite = overwrite
        self._stream: StreamSetup | None = None

    @contextmanager
    def ready(self) -> Iterator[None]:
        with output_files([self._outlet.output], self._read, overwrite=self._overwrite):
            yield

    def frame(self, arrival: Arrival) -> None:
        self._outlet.open()
        message, stream = arrival.message, arrival.stream
        if stream is not self._stream:
            self._stream = stream
            setup = message._replace(kind=Kind.SETUP, payload=stream.payload)
            self._outlet.send(pack(setup))
        self._outlet.send(pack(message))

    def close(self) -> None:
        if self._stream is not None:
            self._outlet.send(pack(Message(Kind.END)))
        self._outlet.close()


class CaptureRecord(Sink):
    """Captures of successive frames, each whole at any time.

    The first has the given name, further ones add a number. A new one begins after
    `FRAMES_OF_A_PART` or `BYTES_OF_A_PART`, with another setup, where the time of poses goes back,
    as often as an `Allowance` permits, and, if frames show different patterns in turn, after a lost
    one. Where the time of poses stands, or goes back too often, frames are kept without a pose.
    """

    waiting = 256

    def __init__(self, path: Path, read: Sequence[Path] = (), *, overwrite: bool = False) -> None:
        self._path = path
        self._read = read
        self._overwrite = overwrite
        self._number = 0
        self._locked = ExitStack()
        self._begun = False
        self._arrivals: list[Arrival] = []
        self._time_s = -math.inf
        self._returns = Allowance()
        self._frames = 0

    @contextmanager
    def ready(self) -> Iterator[None]:
        with self._output():
            self._begun = True
            yield

    def frame(self, arrival: Arrival) -> None:
        self._frames += 1
        arrival = self._timed(arrival)
        try:
            if self._arrivals and not self._belongs(arrival):
                self._next_part()
        finally:
            self._arrivals.append(arrival)
            if math.isfinite(time_s := _pose_time_s(arrival)):
                self._time_s = time_s
        if len(self._arrivals) % FRAMES_BETWEEN == 0:
            self._write()
        maximum = min(FRAMES_OF_A_PART, BYTES_OF_A_PART // arrival.stream.frame_bytes)
        if len(self._arrivals) >= maximum:
            self._next_part()

    def close(self) -> None:
        with self._locked:
            if self._arrivals:
                self._write()

    def _timed(self, arrival: Arrival) -> Arrival:
        """A frame, without its pose if this has no time of its own, and may begin no part."""
        time_s = _pose_time_s(arrival)
        if not self._arrivals or arrival.stream is not self._arrivals[-1].stream:
            return arrival
        back = time_s < self._time_s
        if back and self._returns.take(self._frames, arrival.received_s):
            return arrival
        if back or time_s == self._time_s:
            return arrival._replace(frame=replace(arrival.frame, poses=Poses.none(1)))
        return arrival

    def _belongs(self, arrival: Arrival) -> bool:
        last = self._arrivals[-1]
        if arrival.stream is not last.stream or _pose_time_s(arrival) <= self._time_s:
            return False
        plans = arrival.stream.setup.plans
        return len(plans) == 1 or arrival.message.number == last.message.number + 1

    def _next_part(self) -> None:
        """Begin another part; if this one cannot be written, only its frames are lost."""
        try:
            self._write()
        except (InputError, OSError) as error:
            lost = len(self._arrivals)
            raise InputError(f"{in_words(error)}; its {lost} frames are lost") from None
        finally:
            self._arrivals = []
            self._time_s = -math.inf
            self._locked.close()
            self._begun = False
            self._number += 1

    @property
    def _part(self) -> Path:
        return part_of(self._path, self._number)

    def _output(self) -> AbstractContextManager[None]:
        """Lock of the part."""
        part = self._part
        kinds = [kind for kind in KINDS.values() if part.is_file() and is_marked(part, kind)]
        kind = kinds[0] if kinds else "capture"
        output = Output(part, kind, (".h5", ".hdf5"))
        return output_files([output], self._read, overwrite=self._overwrite)

    def _write(self) -> None:
        if not self._begun:
            self._locked.enter_context(self._output())
        self._begun = True
        write_capture(_capture(self._arrivals), self._part)


def part_of(path: Path, number: int) -> Path:
    """Name of a part, counted from 0, of a recording."""
    return path.with_name(f"{path.stem}-{number + 1}{path.suffix}") if number else path


def _pose_time_s(arrival: Arrival) -> float:
    """Time of a frame's pose, nan if there is none."""
    poses = arrival.frame.poses
    return math.nan if poses is None else float(poses.time_s[0])


def _capture(arrivals: list[Arrival]) -> Capture:
    """Capture of frames of one setup."""
    first, stream = arrivals[0].frame, arrivals[0].stream
    plans = [stream.setup.plan_of(first.first + n) for n in range(len(stream.setup.plans))]
    frames = Frames.joined([arrival.frame for arrival in arrivals])
    now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    return Capture(
        plan=plans[0],
        following_plans=tuple(plans[1 : len(frames)]),
        buckets=frames.buckets,
        spots=frames.spots,
        pattern_taps=frames.pattern_taps,
        poses=frames.poses,
        optics=stream.setup.optics,
        provenance=replace(stream.provenance, created=now),
    )

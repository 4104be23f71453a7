"""Captures as streams, as a rig would send them."""

import zlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

from reconstruction.base.errors import InputError
from reconstruction.capture import Frames, Poses, Provenance, Setup, open_capture

from .framing import Kind, Message, pack
from .links import Ended, Source
from .setups import frame_payload, frame_period_s, setup_payload

SETUP_EVERY_S = 1.0
"""Period with which the setup is repeated, for late receivers."""


class Sender:
    """Messages of a sender, identified by ``run``; 0 does not identify it."""

    def __init__(self, setup: Setup, provenance: Provenance | None = None, run: int = 0) -> None:
        self.number = 0
        self._run = run
        self._has_poses = setup.poses is not None
        self._payload = setup_payload(setup, provenance)
        self._id = zlib.crc32(self._payload)

    def setup(self, time_ns: int = 0) -> bytes:
        """Setup message: send it before the first frame, and repeat it from time to time."""
        return self._message(Kind.SETUP, self._payload, time_ns)

    def frame(self, frame: Frames, time_ns: int = 0) -> bytes:
        """Message of the next frame, recorded at ``time_ns`` of any clock.

        In a stream with poses a frame may have none.
        """
        if self._has_poses and frame.poses is None:
            frame = replace(frame, poses=Poses.none(1))
        message = self._message(Kind.FRAME, frame_payload(frame), time_ns)
        self.number = (self.number + 1) % 2**32
        return message

    def end(self, time_ns: int = 0) -> bytes:
        """End of the stream."""
        return self._message(Kind.END, b"", time_ns)

    def _message(self, kind: Kind, payload: bytes, time_ns: int) -> bytes:
        return pack(Message(kind, payload, self.number, time_ns, self._run, self._id))


class CaptureSource(Source):
    """A capture file, sent as fast as it is read; if ``followed``, on as it grows.

    A growing capture is one that is replaced by a longer one.
    """

    patient = True

    def __init__(self, path: Path, *, followed: bool, wait: Callable[[float], object]) -> None:
        super().__init__(str(path))
        self._path = path
        self._followed = followed
        self._wait = wait
        self._messages: Iterator[bytes] = iter(())

    def check(self) -> None:
        with open_capture(self._path):
            pass

    def open(self) -> None:
        self._messages = self._all()

    def receive(self, timeout_s: float) -> bytes:
        message = next(self._messages, None)
        if message is None:
            raise Ended
        if not message:
            self._wait(timeout_s)
        return message

    def _all(self) -> Iterator[bytes]:
        """Messages, empty ones while there is nothing new."""
        sender: Sender | None = None
        sent, seen = 0, None
        while sender is None or self._followed:
            now = self._path.stat()
            state = (now.st_ino, now.st_size, now.st_mtime_ns)
            if state == seen:
                yield b""
                continue
            seen = state
            with open_capture(self._path) as file:
                if sender is None:
                    sender = Sender(file.setup, file.provenance)
                    yield sender.setup()
                if file.frames < sent:
                    raise InputError(f"{self._path} has become shorter: it is another capture")
                for number in range(sent, file.frames):
                    yield sender.frame(file.frame(number), _stamp(file.setup, number))
                sent = file.frames


def _stamp(setup: Setup, number: int) -> int:
    """Time of a frame since the first one; 0 if unknown."""
    period_s = frame_period_s(setup)
    return round(1e9 * number * period_s) if period_s > 0 else 0

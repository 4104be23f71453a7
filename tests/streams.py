"""Streams of bytes, sources and clocks that tests have in hand, shared by them."""

from collections import deque
from dataclasses import replace

import numpy as np

from reconstruction.capture.schema import present_fields
from spisim_live import Sender
from spisim_live.links import Ended, Source


def film(capture, frames):
    """A capture of so many frames, each with readings of its own."""

    def varied(part):
        if part is None:
            return None
        reported = {}
        for name, stored in present_fields(part):
            if stored.by_frame:
                values = np.repeat(getattr(part, name)[:1], frames, axis=0)
                if values.dtype.kind != "b":
                    gain = 1 + np.arange(frames).reshape(-1, *[1] * (values.ndim - 1)) / 100
                    values = (values * gain).astype(values.dtype)
                reported[name] = values
        return replace(part, **reported)

    parts = {name: varied(getattr(capture, name)) for name in ("buckets", "spots", "pattern_taps")}
    return replace(capture, truth=None, **parts)


def messages(capture, run=1):
    """The setup, then every frame, then the end."""
    sender = Sender(capture.setup, capture.provenance, run)
    reported = [sender.setup()]
    reported += [sender.frame(capture.frame(n), time_ns=1000 * n) for n in range(capture.frames)]
    return [*reported, sender.end()]


class Clock:
    """Time that passes only when it is told to."""

    def __init__(self):
        self.now_s = 1000.0

    def __call__(self):
        return self.now_s

    def wait(self, seconds):
        self.now_s += seconds


class Script(Source):
    """A source that does what it is told: gives bytes, raises what it is given, waits for None.

    Bytes may come with the name of their sender in front, as a pair.
    """

    def __init__(self, *acts, clock=None, patient=False):
        super().__init__("script")
        self.acts = deque(acts)
        self.opened = 0
        self.refusals = 0
        self.patient = patient
        self._clock = clock or Clock()

    def open(self):
        if self.refusals:
            self.refusals -= 1
            raise ConnectionRefusedError(111, "Connection refused")
        self.opened += 1

    def receive(self, timeout_s):
        if not self.acts:
            raise Ended
        act = self.acts.popleft()
        if isinstance(act, Exception):
            raise act
        if act is None:
            self._clock.wait(timeout_s)
            return b""
        self.sender, content = act if isinstance(act, tuple) else ("", act)
        return content

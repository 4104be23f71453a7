"""A live stream in the viewer."""

from __future__ import annotations

from collections import deque

from reconstruction.exports import Shot
from spisim_app.report.viewer.recording import Recording
from spisim_app.report.viewer.views import View
from spisim_live import Arrival, Outcome
from spisim_live.sinks import Sink

#: Frames whose readings may wait for their results.
REMEMBERED = 64


class StreamViewer(Sink):
    """Adds frames to a recording as their results arrive, the drone at the origin."""

    def __init__(self, recording: Recording, title: str) -> None:
        self._recording = recording
        self._title = title
        self._arrivals: deque[Arrival] = deque(maxlen=REMEMBERED)

    def frame(self, arrival: Arrival) -> None:
        """Store the readings of a frame."""
        self._arrivals.append(arrival)

    def result(self, outcome: Outcome) -> None:
        """Display a result."""
        setup, number = outcome.stream.setup, outcome.result.frame
        given = (each for each in self._arrivals if each.frame.first == number)
        arrival = next(given, None)
        stamp_ns = outcome.time_ns
        if not stamp_ns and arrival is not None:
            stamp_ns = round(1e9 * arrival.received_s)
        self._recording.add(
            View(
                self._title,
                Shot.of(outcome.result, setup, stamp_ns),
                outcome.result,
                setup,
                None if arrival is None else arrival.frame,
            )
        )

    def close(self) -> None:
        """Write pending data."""
        self._recording.close()

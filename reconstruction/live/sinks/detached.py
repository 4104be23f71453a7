"""Sinks that may stall without anything else waiting for them."""

import threading
from collections.abc import Callable
from functools import partial

from ...errors import InputError, explain, naming
from ..queues import Waiting
from ..reception import Arrival
from ..results import Outcome, State
from .sink import Sink

CLOSING_S = 5.0
"""For what still waits, once the stream has ended."""


class Detached:
    """A sink in a thread of its own.

    ``trouble`` is what goes wrong, None if nothing does; so many frames and results are ``lost``,
    the last one for ``why``.
    """

    def __init__(self, sink: Sink, name: str) -> None:
        self.trouble: str | None = None
        self.lost = 0
        self.why = ""
        self._sink = sink
        self.name = name
        self._work: Waiting[Callable[[], None]] = Waiting(sink.waiting)
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    @property
    def dropped(self) -> int:
        """What it was too slow to take, and misses."""
        return 0 if self._sink.skips else self._work.dropped

    def start(self) -> None:
        """Begin to take."""
        self._thread.start()

    def frame(self, arrival: Arrival) -> None:
        """One more frame."""
        self._work.put(partial(self._keep, partial(self._sink.frame, arrival)))

    def result(self, outcome: Outcome) -> None:
        """One more result."""
        self._work.put(partial(self._keep, partial(self._sink.result, outcome)))

    def state(self, state: State) -> None:
        """How the stream is."""
        self._work.put(partial(self._try, partial(self._sink.state, state)))

    def close(self) -> None:
        """Take what still waits, for a while."""
        self._work.close()
        self._thread.join(CLOSING_S)
        self._sink.abandon()
        self._thread.join(CLOSING_S)

    def _run(self) -> None:
        while not self._work.over:
            work = self._work.get(1.0)
            if work is not None:
                work()
        self._try(self._sink.close)

    def _keep(self, work: Callable[[], None]) -> None:
        """Take a frame or a result, of which it is told how many are lost."""
        self._try(work)
        if self.trouble is not None:
            self.lost += 1
            self.why = self.trouble

    def _try(self, work: Callable[[], None]) -> None:
        try:
            with naming(self.name):
                _told(work)
        except InputError as error:
            self.trouble = str(error)
        else:
            self.trouble = None


def _told(work: Callable[[], None]) -> None:
    try:
        work()
    except OSError as error:
        raise InputError(explain(error)) from None

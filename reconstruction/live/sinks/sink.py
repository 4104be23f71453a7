"""What all sinks share, and the thread in which each works."""

import logging
import threading
from collections.abc import Callable
from functools import partial
from typing import ClassVar

from ...base.errors import InputError, in_words, naming
from ..counts import Counts
from ..queues import BoundedQueue
from ..reception import Arrival
from ..results import Outcome, State

logger = logging.getLogger(__name__)

COUNTING = threading.Lock()
"""Several sinks may fail at once."""
CLOSING_S = 5.0
"""For what still waits, once the stream has ended."""


class Sink:
    """Takes what it is there for, and ignores the rest; what it raises costs that alone."""

    waiting: ClassVar[int] = 16
    """How many may wait for it, before the oldest are dropped."""
    skips: ClassVar[bool] = False
    """Whether it is there for the newest alone, and the others are not missed."""
    fleeting: ClassVar[bool] = False
    """Whether what cannot be sent is no failure, as nobody need be there to take it."""

    def check(self) -> None:
        """Raise InputError where it can never take anything."""

    def frame(self, arrival: Arrival) -> None:
        """One more frame, as it came."""

    def result(self, outcome: Outcome) -> None:
        """One more result."""

    def state(self, state: State) -> None:
        """How the stream is, once a second."""

    def close(self) -> None:
        """Nothing more will come."""

    def abandon(self) -> None:
        """Let go of whatever it waits for; called from another thread."""


class Detached:
    """A sink in a thread of its own: an error of any kind costs what it was to take alone.

    ``trouble`` is what goes wrong, None if nothing does; so many frames and results are ``lost``.
    ``why`` it went wrong last stays; it ``failed`` where that is not just that nobody listens.
    ``counts`` are those of the stream.
    """

    def __init__(self, sink: Sink, name: str, counts: Counts | None = None) -> None:
        self.trouble: str | None = None
        self.lost = 0
        self.why = ""
        self.failed = False
        self.name = name
        self._sink = sink
        self._counts = counts or Counts()
        self._work: BoundedQueue[Callable[[], None]] = BoundedQueue(sink.waiting)
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    @property
    def dropped(self) -> int:
        """What it was too slow to take, and misses."""
        return 0 if self._sink.skips else self._work.dropped

    @property
    def alive(self) -> bool:
        """Whether it takes what comes."""
        return self._thread.is_alive()

    def start(self) -> None:
        """Begin to take."""
        self._thread.start()

    def frame(self, arrival: Arrival) -> None:
        """One more frame."""
        size = len(arrival.message.payload or b"")
        self._work.put(partial(self._keep, partial(self._sink.frame, arrival)), size)

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
        if self.alive:
            self._work.clear()
            self._sink.abandon()
            self._thread.join(CLOSING_S)
        if self.alive:
            self._note(TimeoutError(f"it does not come to an end within {2 * CLOSING_S:g} s"))

    def _run(self) -> None:
        while not self._work.over:
            work = self._work.get(1.0)
            if work is not None:
                work()
        self._try(self._sink.close)

    def _keep(self, work: Callable[[], None]) -> None:
        """Take a frame or a result, of which it is told how many are lost."""
        self._try(work)
        self.lost += self.trouble is not None

    def _try(self, work: Callable[[], None]) -> None:
        try:
            work()
        except Exception as error:
            self._note(error)
        else:
            self.trouble = None

    def _note(self, error: Exception) -> None:
        try:
            with naming(self.name):
                raise InputError(in_words(error))
        except InputError as named:
            self.trouble = self.why = str(named)
        if self._sink.fleeting and isinstance(error, OSError):
            return
        self.failed = True
        logger.error("%s", self.why, exc_info=error)
        with COUNTING:
            self._counts.sink_failures += 1

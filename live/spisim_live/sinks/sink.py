"""Base class of sinks, and the thread in which each runs."""

import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import ClassVar

from reconstruction.base.errors import InputError, in_words, naming

from ..counts import Counts
from ..queues import BoundedQueue
from ..reception import Arrival
from ..results import Outcome, State

logger = logging.getLogger(__name__)

COUNTING = threading.Lock()
"""Guards the counts, as several sinks may fail at once."""
CLOSING_S = 5.0
"""Time for queued work once the stream has ended."""


class Sink:
    """Takes frames, results or states, and ignores the others; an error costs that item only."""

    waiting: ClassVar[int] = 16
    """Maximum number of queued items, before the oldest are dropped."""
    skips: ClassVar[bool] = False
    """Whether only the newest item matters, so that dropped ones are not counted."""
    fleeting: ClassVar[bool] = False
    """Whether unsent items are no failure, as nobody need listen."""

    @contextmanager
    def ready(self) -> Iterator[None]:
        """Lock its files while it is used; raises InputError if it can never take anything."""
        yield

    def frame(self, arrival: Arrival) -> None:
        """Take a received frame."""

    def result(self, outcome: Outcome) -> None:
        """Take a result."""

    def state(self, state: State) -> None:
        """Take the state of the stream, once a second."""

    def close(self) -> None:
        """Finish: nothing more will come."""

    def abandon(self) -> None:
        """Release whatever blocks it; called from another thread."""


class Detached:
    """A sink in its own thread, where an error costs the item only.

    ``trouble`` is the current problem, None if there is none; ``lost`` counts frames and results,
    ``why`` keeps the last problem, and ``failed`` is set unless nobody just listened. ``counts``
    are those of the stream.
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
        """Items it was too slow to take."""
        return 0 if self._sink.skips else self._work.dropped

    @property
    def alive(self) -> bool:
        """Whether it takes items."""
        return self._thread.is_alive()

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def frame(self, arrival: Arrival) -> None:
        """Queue a frame."""
        size = len(arrival.message.payload or b"")
        self._work.put(partial(self._keep, partial(self._sink.frame, arrival)), size)

    def result(self, outcome: Outcome) -> None:
        """Queue a result."""
        self._work.put(partial(self._keep, partial(self._sink.result, outcome)))

    def state(self, state: State) -> None:
        """Queue a state."""
        self._work.put(partial(self._try, partial(self._sink.state, state)))

    def close(self) -> None:
        """Work off the queue, for a while."""
        self._work.close()
        self._thread.join(CLOSING_S)
        if self.alive:
            self._work.clear()
            self._sink.abandon()
            self._thread.join(CLOSING_S)
        if self.alive:
            self._note(TimeoutError(f"it does not finish within {2 * CLOSING_S:g} s"))

    def _run(self) -> None:
        while not self._work.over:
            work = self._work.get(1.0)
            if work is not None:
                work()
        self._try(self._sink.close)

    def _keep(self, work: Callable[[], None]) -> None:
        """Take a frame or a result, counting lost ones."""
        self._try(work)
        self.lost += self.trouble is not None

    def _try(self, work: Callable[[], None]) -> None:
        try:
            work()
        except BaseException as error:  # of a thread that nobody else sees end
            self._note(error)
        else:
            self.trouble = None

    def _note(self, error: BaseException) -> None:
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

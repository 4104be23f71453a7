"""From a source to frames in turn, whatever becomes of the source meanwhile."""

import logging
import threading
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

from ..capture import Frames
from ..errors import InputError
from .counts import Counts
from .framing import VERSION, Kind, Message, Parser
from .links import Ended, Source
from .queues import Waiting
from .sequence import Sequence as InTurn
from .setups import StreamSetup

logger = logging.getLogger(__name__)

POLL_S = 0.05
"""Most that a source is waited for at a time."""
FIRST_DELAY_S, MOST_DELAY_S = 0.1, 5.0
"""Until a broken source is tried again: twice as long after each time in vain."""


class Arrival(NamedTuple):
    """A frame and the message that it came in, at ``received_s`` of the monotonic clock."""

    stream: StreamSetup
    frame: Frames
    message: Message
    received_s: float


class Reception:
    """Receives frames into a queue, in a thread of its own or step by step.

    ``counts`` tell what has become of them and ``troubles`` what is wrong at present. The queue
    drops its oldest frames where the source does not wait. Raises InputError for a source that can
    never be opened; `run` ends, with ``failure``, where the source speaks another language.
    """

    def __init__(
        self,
        source: Source,
        *,
        waiting: int = 16,
        window: int = 1,
        recorders: Sequence[Callable[[Arrival], None]] = (),
        clock: Callable[[], float] = time.monotonic,
        wait: Callable[[float], object] | None = None,
    ) -> None:
        source.check()
        self.counts = Counts()
        self.queue: Waiting[Arrival] = Waiting(waiting)
        self.stream: StreamSetup | None = None
        self.trouble: str | None = f"waiting for {source.address}"
        self.failure: Exception | None = None
        self._source = source
        self._parser = Parser()
        self._turn: InTurn[Arrival] = InTurn(self.counts, window)
        self._recorders = recorders
        self._clock = clock
        self._stopped = threading.Event()
        self._wait = wait or self._stopped.wait
        self._open = False
        self._delay_s = FIRST_DELAY_S
        self._again_s = -float("inf")

    def run(self) -> None:
        """Receive until the stream has ended, or `stop`."""
        try:
            while not self._stopped.is_set():
                self.step()
        except Exception as error:  # of a thread that nobody else would hear of
            self.failure = error
        finally:
            self._stopped.set()
            self._parser.reset()
            self.counts.discarded_bytes = self._parser.discarded_bytes
            self._give(self._turn.flush())
            self.queue.close()
            self._source.close()

    def stop(self) -> None:
        """End, from any thread."""
        self._stopped.set()
        self.queue.close()
        self._source.close()

    @property
    def over(self) -> bool:
        """Whether nothing more will come."""
        return self._stopped.is_set()

    def step(self) -> None:
        """Open the source where it is not open, or take what comes within `POLL_S`."""
        if not self._open:
            self._connect()
            return
        try:
            self.take(self._source.receive(POLL_S))
        except Ended:
            self._stopped.set()
        except OSError as error:
            self._break(error)

    def take(self, piece: bytes) -> None:
        """Take some bytes."""
        now_s = self._clock()
        for message in self._parser.feed(piece):
            self._message(message, now_s)
        self.counts.discarded_bytes = self._parser.discarded_bytes
        self._give(self._turn.overdue(now_s))

    def _connect(self) -> None:
        now_s = self._clock()
        if now_s < self._again_s:
            self._wait(min(self._again_s - now_s, POLL_S))
            return
        try:
            self._source.open()
        except OSError as error:
            self._break(error)
            return
        self._open = True
        self.counts.connections += 1
        self.trouble = None
        logger.info("%s is open", self._source.address)

    def _break(self, error: OSError) -> None:
        """Try again later, sooner if it was open; what ends when all does is no trouble."""
        if self._stopped.is_set():
            return
        if self._open:
            self._delay_s = FIRST_DELAY_S
            self._parser.reset()
        self._open = False
        self.trouble = f"waiting for {self._source.address}: {(error.strerror or str(error))}"
        logger.warning("%s", self.trouble)
        self._again_s = self._clock() + self._delay_s
        self._delay_s = min(2 * self._delay_s, MOST_DELAY_S)

    def _message(self, message: Message, now_s: float) -> None:
        if message.version != VERSION:
            self.counts.foreign += 1
            self._refuse(
                f"messages of version {message.version}; this program reads version {VERSION}"
            )
        elif message.kind == Kind.SETUP and message.payload is not None:
            self._set_up(message)
        elif message.kind == Kind.FRAME:
            self._frame(message, now_s)
        elif message.kind == Kind.END and message.payload is not None:
            self._stopped.set()

    def _set_up(self, message: Message) -> None:
        assert message.payload is not None
        if self.stream is not None and message.setup == self.stream.id:
            return
        try:
            self.stream = StreamSetup(message.payload)
        except InputError as error:
            self._refuse(f"its setup cannot be used: {error}")

    def _frame(self, message: Message, now_s: float) -> None:
        arrival = self._arrival(message, now_s)
        self._give(self._turn.take(message.run, message.number, arrival, now_s))

    def _arrival(self, message: Message, now_s: float) -> Arrival | None:
        """A frame, None where it cannot be used."""
        if message.payload is None:
            self.counts.corrupted += 1
            return None
        if self.stream is None or message.setup != self.stream.id:
            self.counts.strangers += 1
            return None
        try:
            frame = self.stream.frames(message.payload, message.number)
        except InputError as error:
            self.counts.refused += 1
            self.trouble = f"frame {message.number}: {error}"
            return None
        return Arrival(self.stream, frame, message, now_s)

    def _give(self, arrivals: list[Arrival]) -> None:
        put = self.queue.put_in_turn if self._source.patient else self.queue.put
        for arrival in arrivals:
            self.counts.received += 1
            self.trouble = None
            for recorder in self._recorders:
                recorder(arrival)
            put(arrival)
        self.counts.dropped = self.queue.dropped

    def _refuse(self, why: str) -> None:
        """What is not understood at all is an error, later on a trouble that may pass."""
        told = f"{self._source.address}: {why}"
        if self.stream is None:
            raise InputError(told)
        self.trouble = told

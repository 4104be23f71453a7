"""From a source to frames in turn, whatever becomes of the source meanwhile."""

import logging
import threading
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

from ..base.errors import InputError, in_words
from ..capture import Frames
from .counts import Counts
from .framing import VERSION, Kind, Message
from .links import Ended, Source
from .queues import BoundedQueue
from .senders import Allowance, Senders
from .sequence import Sequence as InTurn
from .setups import StreamSetup, length_error

logger = logging.getLogger(__name__)

POLL_S = 0.05
"""Most that a source is waited for at a time."""
FIRST_DELAY_S, MAX_DELAY_S = 0.1, 5.0
"""Until a broken source is tried again: twice as long after each time in vain."""
ENDING_S = 1.0
"""After an end that may be forged, nothing of use comes for so long if it is true."""


class Arrival(NamedTuple):
    """A frame and the message that it came in, at ``received_s`` of the monotonic clock."""

    stream: StreamSetup
    frame: Frames
    message: Message
    received_s: float


class Reception:
    """Receives frames into a queue, in a thread of its own or step by step.

    ``counts`` tell what has become of them, ``troubles`` what is wrong at present, `awaited` what
    it waits for. The queue drops its oldest frames where the source does not wait. Raises
    InputError for a source that can never be opened; `run` ends, with ``failure``, where a file or
    pipe speaks another language. From a link nothing ends it but the end that its sender tells.
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
        counts: Counts | None = None,
    ) -> None:
        source.check()
        self.counts = counts or Counts()
        self.queue: BoundedQueue[Arrival] = BoundedQueue(waiting)
        self.stream: StreamSetup | None = None
        self.trouble: str | None = f"waiting for {source.address}"
        self.failure: Exception | None = None
        self._source = source
        self._senders = Senders(self._fits)
        self._changes = Allowance()
        self._turn: InTurn[Arrival] = InTurn(self.counts, window)
        self._recorders = recorders
        self._clock = clock
        self._stopped = threading.Event()
        self._wait = wait or self._stopped.wait
        self._open = False
        self._delay_s = FIRST_DELAY_S
        self._again_s = -float("inf")
        self._awaited = (source.address, clock())
        self._ended_s: float | None = None

    def run(self) -> None:
        """Receive until the stream has ended, or `stop`."""
        try:
            while not self._stopped.is_set():
                self.step()
        except Exception as error:  # of a thread that nobody else would hear of
            self.failure = error
        finally:
            self._stopped.set()
            self._senders.reset(self._clock())
            self._count()
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

    @property
    def final(self) -> bool:
        """Whether what its source gives is all there will be, as of a file or pipe."""
        return self._source.patient

    @property
    def awaited(self) -> tuple[str, float]:
        """What is waited for, and since when by the monotonic clock."""
        return self._awaited

    def step(self) -> None:
        """Open the source where it is not open, or take what comes within `POLL_S`."""
        if not self._open:
            self._connect()
            return
        try:
            self.take(self._source.receive(POLL_S))
        except Ended:
            self._stopped.set()
        except InputError:
            raise
        except Exception as error:
            if self._source.patient and not isinstance(error, OSError):
                raise
            self._break(error)

    def take(self, piece: bytes) -> None:
        """Take some bytes."""
        now_s = self._clock()
        if piece:
            for message in self._senders.feed(self._source.sender, piece, now_s):
                self._contained(message, now_s)
        if not self._source.patient:
            self._senders.give_up(now_s)
            if self._senders.quiet(now_s) and self._source.wanted:
                self._break(TimeoutError(f"{self._sender} is quiet, and somebody else calls"))
            if self._ended_s is not None and now_s - self._ended_s > ENDING_S:
                self._stopped.set()
        self._count()
        self._give(self._turn.overdue(now_s))

    @property
    def _sender(self) -> str:
        """Who sent what came last."""
        return self._source.sender or self._source.address

    @property
    def _heard(self) -> str:
        """Who is listened to."""
        return self._senders.heard or self._sender

    def _count(self) -> None:
        self.counts.discarded_bytes = self._senders.discarded_bytes
        self.counts.ignored_bytes = self._senders.ignored_bytes
        self.counts.given_up = self._senders.given_up

    def _connect(self) -> None:
        now_s = self._clock()
        if now_s < self._again_s:
            self._wait(min(self._again_s - now_s, POLL_S))
            return
        try:
            self._source.open()
        except InputError:
            raise
        except Exception as error:
            self._break(error)
            return
        self._open = True
        self.counts.connections += 1
        self.trouble = None
        now_s = self._clock()
        self._senders.reset(now_s)
        what = "a setup" if self.stream is None else "a frame"
        self._awaited = (f"{what} from {self._sender}", now_s)
        logger.info("%s is open", self._source.address)

    def _break(self, error: Exception) -> None:
        """Try again later, sooner if it was open; what ends when all does is no trouble."""
        if self._stopped.is_set():
            return
        now_s = self._clock()
        if self._open:
            self._delay_s = FIRST_DELAY_S
            self._senders.reset(now_s)
            self._awaited = (self._source.address, now_s)
        self._open = False
        self.trouble = f"waiting for {self._source.address}: {in_words(error)}"
        logger.warning("%s", self.trouble)
        self._again_s = now_s + self._delay_s
        self._delay_s = min(2 * self._delay_s, MAX_DELAY_S)

    def _fits(self, message: Message, length: int) -> bool:
        """Whether a message may be as its header says: what cannot be of use is not waited for."""
        why = length_error(message, length, self.stream)
        if why is not None:
            self.counts.refused += 1
            self.trouble = f"{self._sender}: {why}"
        return why is None

    def _contained(self, message: Message, now_s: float) -> None:
        """Take a message; what nobody has foreseen of it costs it alone."""
        try:
            self._message(message, now_s)
        except InputError:
            raise
        except Exception as error:
            logger.exception("a message of kind %d", message.kind)
            self.counts.refused += 1
            self.trouble = f"{self._sender}: message {message.number}: {in_words(error)}"

    def _message(self, message: Message, now_s: float) -> None:
        if message.version != VERSION:
            self.counts.foreign += 1
            self._refuse(
                f"messages of version {message.version}; this program reads version {VERSION}"
            )
        elif message.kind == Kind.SETUP and message.payload is not None:
            self._set_up(message, now_s)
        elif message.kind == Kind.FRAME:
            self._frame(message, now_s)
        elif message.kind == Kind.END and message.payload is not None:
            self._end(now_s)

    def _set_up(self, message: Message, now_s: float) -> None:
        assert message.payload is not None
        if self.stream is None or message.setup != self.stream.id:
            if not self._changes.take(self.counts.received, now_s):
                self.counts.refused += 1
                self.trouble = f"{self._sender}: its setup changes too often"
                return
            try:
                self.stream = StreamSetup(message.payload)
            except InputError as error:
                self.counts.refused += 1
                self._refuse(f"its setup cannot be used: {error}")
                return
            self._senders.expect(self.stream.frame_period_s)
            self._awaited = (f"a frame from {self._sender}", now_s)
        self._accept(now_s)

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
        self._accept(now_s)
        return Arrival(self.stream, frame, message, now_s)

    def _accept(self, now_s: float) -> None:
        """Hear who has sent something of use, which has not ended."""
        self._senders.accept(now_s)
        self._ended_s = None

    def _end(self, now_s: float) -> None:
        """Nobody ends a stream that is another's."""
        if not self._source.patient and self._senders.heard != self._source.sender:
            self.counts.strangers += 1
        elif self._source.forgeable:
            self._ended_s = now_s
        else:
            self._stopped.set()

    def _give(self, arrivals: list[Arrival]) -> None:
        put = self.queue.put_in_turn if self._source.patient else self.queue.put
        for arrival in arrivals:
            self.counts.received += 1
            self.trouble = None
            self._awaited = (f"a frame from {self._heard}", arrival.received_s)
            for recorder in self._recorders:
                recorder(arrival)
            put(arrival, len(arrival.message.payload or b""))
        self.counts.dropped = self.queue.dropped

    def _refuse(self, why: str) -> None:
        """What is not understood at all: nothing better comes from a file, but from others."""
        text = f"{self._sender}: {why}"
        if self.stream is None and self._source.patient:
            raise InputError(text)
        self.trouble = text

"""From a source to frames in order, whatever happens to the source."""

import logging
import math
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

from reconstruction.base.errors import InputError, in_words
from reconstruction.capture import Frames, Poses

from .counts import Counts
from .framing import VERSION, Kind, Message
from .links import Ended, Source
from .queues import BoundedQueue
from .senders import Allowance, Senders
from .sequence import HOLD_S
from .sequence import Sequence as InTurn
from .setups import StreamSetup, length_error

logger = logging.getLogger(__name__)

POLL_S = 0.05
"""Maximum wait for a source."""
FIRST_DELAY_S, MAX_DELAY_S = 0.1, 5.0
"""Delay before a broken source is tried again, doubled after each failure."""
ENDING_S = 1.0
"""Silence that confirms an end that may be forged."""
MAX_SETUPS = 4
"""Setups whose frames are read: one may be forged, and change nothing until a frame needs it."""


class Arrival(NamedTuple):
    """A frame and its message, received at ``received_s`` of the monotonic clock."""

    stream: StreamSetup
    frame: Frames
    message: Message
    received_s: float


class Reception:
    """Receives frames into a queue, in a thread of its own or step by step.

    ``counts`` are of the frames, ``trouble`` is the current problem, `awaited` what it waits for.
    The queue drops its oldest frames if the source does not wait. `run` ends, with ``failure``, if
    a file or pipe has another format; a link is only ended by its sender. Raises InputError if the
    source can never be opened.

    Parameters
    ----------
    source : Source
        Where bytes come from.
    waiting : int
        Maximum number of queued frames.
    window : int
        Frames held while an earlier one is missing.
    poses : callable, optional
        Pose of a frame, in place of that of the stream.
    recorders : sequence of callable
        Receivers of each arrival, before it is queued.
    clock, wait : callable
        Monotonic seconds, and sleep.
    counts : Counts, optional
        Counts to continue.
    """

    def __init__(
        self,
        source: Source,
        *,
        waiting: int = 16,
        window: int = 1,
        poses: Callable[[Arrival], Poses] | None = None,
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
        self._setups: dict[int, StreamSetup] = {}
        self._changes = Allowance()
        self._turn: InTurn[Arrival] = InTurn(self.counts, window)
        self._poses = poses
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
        """Receive until the stream has ended, or `stop` is called."""
        try:
            while not self._stopped.is_set():
                self.step()
        except BaseException as error:  # nobody else sees errors of this thread
            contained = InputError(in_words(error))
            self.failure = error if isinstance(error, Exception) else contained
        finally:
            self._stopped.set()
            self._senders.reset(self._clock())
            self._count()
            self._give(self._turn.flush())
            self.queue.close()
            self._source.close()

    def stop(self) -> None:
        """Stop, from any thread."""
        self._stopped.set()
        self.queue.close()
        self._source.close()

    @property
    def over(self) -> bool:
        """Whether nothing more will come."""
        return self._stopped.is_set()

    @property
    def final(self) -> bool:
        """Whether the source is a file or pipe, which gives all there will be."""
        return self._source.patient

    @property
    def awaited(self) -> tuple[str, float]:
        """What is awaited, and since when by the monotonic clock."""
        return self._awaited

    def step(self) -> None:
        """Open the source, or take what comes within `POLL_S`."""
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
        """Take bytes."""
        now_s = self._clock()
        if piece:
            for message in self._senders.feed(self._source.sender, piece, now_s):
                self._contained(message, now_s)
        if not self._source.patient:
            self._senders.give_up(now_s)
            if self._senders.quiet(now_s) and self._source.wanted:
                self._break(TimeoutError(f"{self._sender} is quiet, and another sender calls"))
            if self._ended_s is not None and now_s - self._ended_s > ENDING_S:
                self._stopped.set()
        self._count()
        self._give(self._turn.overdue(now_s))

    @property
    def _sender(self) -> str:
        """Sender of what came last."""
        return self._source.sender or self._source.address

    @property
    def _heard(self) -> str:
        """Sender that is heard."""
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
        """Schedule a retry, sooner if the source was open."""
        if self._stopped.is_set():
            return
        now_s = self._clock()
        called = self._open and self._source.wanted
        if self._open:
            self._delay_s = FIRST_DELAY_S
            self._senders.reset(now_s)
            self._awaited = (self._source.address, now_s)
        self._open = False
        self.trouble = f"waiting for {self._source.address}: {in_words(error)}"
        logger.warning("%s", self.trouble)
        self._again_s = now_s if called else now_s + self._delay_s
        self._delay_s = min(2 * self._delay_s, MAX_DELAY_S)

    def _fits(self, message: Message, length: int) -> bool:
        """Whether a message can be what its header says; others are not waited for."""
        why = length_error(message, length, self._setups.get(message.setup))
        if why is not None:
            self.counts.refused += 1
            self.trouble = f"{self._sender}: {why}"
        return why is None

    def _contained(self, message: Message, now_s: float) -> None:
        """Handle a message; an unexpected error costs this message only."""
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
        if message.setup not in self._setups:
            if not self._changes.take(self.counts.received, now_s):
                self.counts.refused += 1
                self.trouble = f"{self._sender}: its setup changes too often"
                return
            try:
                stream = StreamSetup(message.payload)
            except InputError as error:
                self.counts.refused += 1
                self._refuse(f"its setup cannot be used: {error}")
                return
            self._setups.setdefault(stream.id, stream)
            if len(self._setups) > MAX_SETUPS:
                del self._setups[next(iter(self._setups))]
            if self.stream is None:
                self._follow(stream)
            self._awaited = (f"a frame from {self._sender}", now_s)
        if self._senders.heard != self._source.sender:  # who sends setups alone is quiet
            self._senders.accept(now_s)
        self._ended_s = None

    def _follow(self, stream: StreamSetup) -> None:
        """Go on with the setup of a frame; the one used last is forgotten last."""
        self._setups[stream.id] = self._setups.pop(stream.id, stream)
        if stream is not self.stream:
            self.stream = stream
            self._senders.expect(stream.frame_period_s)
            period_s = stream.frame_period_s
            self._turn.hold_s = max(HOLD_S, 2 * period_s if math.isfinite(period_s) else 0.0)

    def _frame(self, message: Message, now_s: float) -> None:
        arrival = self._arrival(message, now_s)
        self._give(self._turn.take(message.run, message.number, arrival, now_s))

    def _arrival(self, message: Message, now_s: float) -> Arrival | None:
        """A frame, None if it is unusable."""
        if message.payload is None:
            self.counts.corrupted += 1
            return None
        stream = self._setups.get(message.setup)
        if stream is None:
            self.counts.strangers += 1
            return None
        try:
            frame = stream.frames(message.payload, message.number)
        except InputError as error:
            self.counts.refused += 1
            self.trouble = f"frame {message.number}: {error}"
            return None
        self._follow(stream)
        self._senders.accept(now_s)
        self._ended_s = None
        return Arrival(stream, frame, message, now_s)

    def _end(self, now_s: float) -> None:
        """End the stream, unless it belongs to another sender."""
        if not self._source.patient and self._senders.heard != self._source.sender:
            self.counts.strangers += 1
        elif self._source.forgeable:
            self._ended_s = now_s
        else:
            self._stopped.set()

    def _give(self, arrivals: list[Arrival]) -> None:
        put = self.queue.put_in_turn if self._source.patient else self.queue.put
        for arrival in map(self._located, arrivals):
            self.counts.received += 1
            self.trouble = None
            self._awaited = (f"a frame from {self._heard}", arrival.received_s)
            for recorder in self._recorders:
                recorder(arrival)
            put(arrival, len(arrival.message.payload or b""))
        self.counts.dropped = self.queue.dropped

    def _located(self, arrival: Arrival) -> Arrival:
        """Add the pose from beside the stream, if any come from there."""
        if self._poses is None:
            return arrival
        return arrival._replace(frame=replace(arrival.frame, poses=self._poses(arrival)))

    def _refuse(self, why: str) -> None:
        """Reject an unintelligible message: fatal for a file, not for a link."""
        text = f"{self._sender}: {why}"
        if self.stream is None and self._source.patient:
            raise InputError(text)
        self.trouble = text

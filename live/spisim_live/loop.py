"""From received frames to results, with a reconstructor compiled once per setup."""

import logging
import time
from collections.abc import Callable, Sequence
from typing import Any

from reconstruction.base.errors import InputError, in_words
from reconstruction.capture import Setup
from reconstruction.chosen_methods import Methods, check_methods
from reconstruction.depth import DEPTH_METHODS, MIN_FREE, check_min_free, lacks
from reconstruction.reconstructor import Reconstructor

from .counts import Latencies
from .reception import POLL_S, Arrival, Reception
from .results import Outcome, State
from .setups import StreamSetup

logger = logging.getLogger(__name__)

STATE_EVERY_S = 1.0
FAILURES = (Exception, SystemExit, GeneratorExit)
"""What a method raises costs a frame; only an interrupt is the user's."""
FAST_DEPTH = "anchored"
"""Depth method fast enough for video rate."""


def fast_depth(setup: Setup) -> Methods:
    """`FAST_DEPTH`, or None for the default method if the setup does not suit it."""
    return None if lacks(DEPTH_METHODS[FAST_DEPTH], setup) else FAST_DEPTH


class Loop:
    """Reconstructs received frames and passes on ``results`` and ``states``.

    An error of a method costs its part of a frame, an error of a setup or a frame costs these; all
    are counted and reported. Raises InputError for unknown methods, for methods that do not suit
    the first setup of a file or pipe, and if the reception has failed. ``ended`` says which method
    would have ended the program.

    Parameters
    ----------
    reception : Reception
        Source of frames.
    image, ranging, depth, weather, min_free
        As for a `Reconstructor`; depth defaults to `fast_depth`.
    results, states : sequence of callable
        Receivers of outcomes and states.
    clock : callable
        Monotonic seconds.
    """

    def __init__(
        self,
        reception: Reception,
        *,
        image: Methods = None,
        ranging: Methods = None,
        depth: Methods = None,
        weather: str | None = None,
        min_free: float = MIN_FREE,
        results: Sequence[Callable[[Outcome], None]] = (),
        states: Sequence[Callable[[State], None]] = (),
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        check_methods(image, ranging, depth)
        check_min_free(min_free)
        self.latencies = Latencies()
        self._reception = reception
        self._methods: dict[str, Any] = {
            "image": image,
            "ranging": ranging,
            "weather": weather,
            "min_free": min_free,
            "failed": self._method_failed,
        }
        self._depth = depth
        self._results = results
        self._states = states
        self._clock = clock
        self._stream: StreamSetup | None = None
        self._reconstruct: Reconstructor | None = None
        self._trouble: str | None = None
        self.ended: str | None = None
        self._logged = ""
        self._last_s = float("nan")
        self._state_s = clock()
        self._state_frames = 0
        self._state_dropped = 0

    def run(self, maximum: int | None = None) -> None:
        """Run until the stream ends, or there are ``maximum`` results."""
        counts = self._reception.counts
        while not self._reception.queue.over and (
            maximum is None or counts.reconstructed < maximum
        ):
            self.step(POLL_S)
        if self._reception.failure is not None:
            raise self._reception.failure
        self._publish_state()

    def step(self, timeout_s: float) -> None:
        """Take a frame, if one comes in time, and publish the state when due."""
        arrival = self._reception.queue.get(timeout_s)
        if arrival is not None:
            self._frame(arrival)
        elif self._reception.stream is not None:
            self._compile(self._reception.stream)
        if self._clock() - self._state_s >= STATE_EVERY_S:
            self._publish_state()

    def _compile(self, stream: StreamSetup) -> None:
        """Compile for a new setup; an unsuitable first setup of a file is an error."""
        if stream is self._stream:
            return
        first, self._stream, self._reconstruct = self._stream is None, stream, None
        try:
            methods = self._methods | {"depth": self._depth or fast_depth(stream.setup)}
            self._reconstruct = Reconstructor(stream.setup, **methods)
            self._trouble = None
        except FAILURES as error:
            if first and self._reception.final and isinstance(error, InputError):
                raise
            self._trouble = f"the setup cannot be used: {self._in_words(error)}"

    def _frame(self, arrival: Arrival) -> None:
        self._compile(arrival.stream)
        counts = self._reception.counts
        if self._reconstruct is None:
            counts.failed += 1
            return
        self._trouble = None
        try:
            result = self._reconstruct(arrival.frame)
        except FAILURES as error:
            counts.failed += 1
            self._trouble = self._in_words(error)
            return
        counts.reconstructed += 1
        self._last_s = arrival.received_s
        latency_s = self._clock() - arrival.received_s
        self.latencies.add(latency_s)
        outcome = Outcome(arrival.stream, result, arrival.message.time_ns, latency_s)
        for publish in self._results:
            publish(outcome)

    def _method_failed(self, method: str, error: Exception) -> None:
        self._reception.counts.method_failures += 1
        self._trouble = f"{method}: {self._in_words(error)}"

    def _in_words(self, error: BaseException) -> str:
        """Describe an unexpected error, and log it once however often it recurs."""
        words = in_words(error)
        if not isinstance(error, Exception):
            self.ended = words
        if not isinstance(error, InputError) and words != self._logged:
            self._logged = words
            logger.error("%s", words, exc_info=error)
        return words

    def state(self) -> State:
        """Current state of the stream."""
        now_s, counts = self._clock(), self._reception.counts
        awaited, since_s = self._reception.awaited
        period_s = max(now_s - self._state_s, 1e-9)
        return State(
            counts=counts,
            age_s=now_s - self._last_s,
            latency_s=self.latencies.percentile(50),
            latency_99_s=self.latencies.percentile(99),
            frames_per_s=(counts.reconstructed - self._state_frames) / period_s,
            trouble=self._trouble or self._reception.trouble or self._overload(),
            waiting_for=awaited,
            waiting_s=now_s - since_s,
        )

    def _overload(self) -> str:
        """Advice if frames come faster than they are reconstructed, else empty."""
        dropped = self._reception.counts.dropped - self._state_dropped
        if not dropped:
            return ""
        return (
            f"{dropped} frames dropped: they come faster than this machine reconstructs them; "
            "depth anchored and weather clear take less time than others"
        )

    def _publish_state(self) -> None:
        state, counts = self.state(), self._reception.counts
        self._state_s = self._clock()
        self._state_frames, self._state_dropped = counts.reconstructed, counts.dropped
        for publish in self._states:
            publish(state)

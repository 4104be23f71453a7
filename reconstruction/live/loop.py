"""From frames as they come to results, with a reconstructor that is compiled once for a setup."""

import logging
import time
from collections.abc import Callable, Sequence
from typing import Any

from ..base.errors import InputError, in_words
from ..capture import Setup
from ..chosen_methods import Methods, check_methods
from ..depth import DEPTH_METHODS, MIN_FREE, check_min_free, lacks
from ..reconstructor import Reconstructor
from .counts import Latencies
from .reception import POLL_S, Arrival, Reception
from .results import Outcome, State
from .setups import StreamSetup

logger = logging.getLogger(__name__)

STATE_EVERY_S = 1.0
FAST_DEPTH = "anchored"
"""The depth method that leaves time for the rest of a frame at video rate."""


def fast_depth(setup: Setup) -> Methods:
    """Return `FAST_DEPTH`, or None, the default one, where the setup does not suit it."""
    return None if lacks(DEPTH_METHODS[FAST_DEPTH], setup) else FAST_DEPTH


class Loop:
    """Reconstructs what a reception gives, and tells ``results`` and ``states`` of it.

    Methods are named as for a `Reconstructor`, but depth is by `fast_depth` unless it is named;
    ``min_free`` is that of one, too. Whatever a method raises costs its own part of a frame, and
    what a setup or a frame raises costs these alone: it is counted and reported. Raises InputError
    for unknown methods, for those that the first setup of a file or pipe does not suit, and where
    the reception has failed.
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
        self._logged = ""
        self._last_s = float("nan")
        self._reported_s = clock()
        self._reported_frames = 0
        self._reported_dropped = 0

    def run(self, maximum: int | None = None) -> None:
        """Go on until the stream is over, or there are so many results."""
        counts = self._reception.counts
        while not self._reception.queue.over and (
            maximum is None or counts.reconstructed < maximum
        ):
            self.step(POLL_S)
        if self._reception.failure is not None:
            raise self._reception.failure
        self._tell()

    def step(self, timeout_s: float) -> None:
        """Take one frame, if one comes in time, and tell the state where it is time to."""
        arrival = self._reception.queue.get(timeout_s)
        if arrival is not None:
            self._frame(arrival)
        elif self._reception.stream is not None:
            self._compile(self._reception.stream)
        if self._clock() - self._reported_s >= STATE_EVERY_S:
            self._tell()

    def _compile(self, stream: StreamSetup) -> None:
        """For another setup than the last; what the first one of a file lacks is an error."""
        if stream is self._stream:
            return
        first, self._stream, self._reconstruct = self._stream is None, stream, None
        try:
            methods = self._methods | {"depth": self._depth or fast_depth(stream.setup)}
            self._reconstruct = Reconstructor(stream.setup, **methods)
            self._trouble = None
        except Exception as error:
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
        except Exception as error:
            counts.failed += 1
            self._trouble = self._in_words(error)
            return
        counts.reconstructed += 1
        self._last_s = arrival.received_s
        latency_s = self._clock() - arrival.received_s
        self.latencies.add(latency_s)
        outcome = Outcome(arrival.stream, result, arrival.message.time_ns, latency_s)
        for tell in self._results:
            tell(outcome)

    def _method_failed(self, method: str, error: Exception) -> None:
        self._reception.counts.method_failures += 1
        self._trouble = f"{method}: {self._in_words(error)}"

    def _in_words(self, error: Exception) -> str:
        """An error that nobody else will hear of; in the log once, however often it comes again."""
        words = in_words(error)
        if not isinstance(error, InputError) and words != self._logged:
            self._logged = words
            logger.error("%s", words, exc_info=error)
        return words

    def state(self) -> State:
        """How the stream is."""
        now_s, counts = self._clock(), self._reception.counts
        awaited, since_s = self._reception.awaited
        period_s = max(now_s - self._reported_s, 1e-9)
        return State(
            counts=counts,
            age_s=now_s - self._last_s,
            latency_s=self.latencies.percentile(50),
            latency_99_s=self.latencies.percentile(99),
            frames_per_s=(counts.reconstructed - self._reported_frames) / period_s,
            trouble=self._trouble or self._reception.trouble or self._overload(),
            waiting_for=awaited,
            waiting_s=now_s - since_s,
        )

    def _overload(self) -> str:
        """What to do where frames come faster than they are reconstructed; empty where not."""
        dropped = self._reception.counts.dropped - self._reported_dropped
        if not dropped:
            return ""
        return (
            f"{dropped} frames dropped: they come faster than this machine reconstructs them; "
            "depth anchored and weather clear take less time than others"
        )

    def _tell(self) -> None:
        state, counts = self.state(), self._reception.counts
        self._reported_s = self._clock()
        self._reported_frames, self._reported_dropped = counts.reconstructed, counts.dropped
        for tell in self._states:
            tell(state)

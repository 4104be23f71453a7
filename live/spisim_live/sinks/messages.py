"""Results as messages of the stream's framing."""

import time
from collections.abc import Callable

from ..framing import Kind, Message, pack
from ..links import Outlet
from ..reception import FIRST_DELAY_S, MAX_DELAY_S
from ..results import Outcome, State, result_entries, state_entries
from ..tables import packed
from .sink import Sink


class MessageSink(Sink):
    """Sends each result and state; without a receiver they are gone."""

    fleeting = True

    def __init__(self, outlet: Outlet, clock: Callable[[], float] = time.monotonic) -> None:
        self._outlet = outlet
        self._clock = clock
        self._open = False
        self._broken: OSError | None = None
        self._delay_s = FIRST_DELAY_S
        self._again_s = -float("inf")

    def check(self) -> None:
        self._outlet.check()

    def result(self, outcome: Outcome) -> None:
        payload = packed(result_entries(outcome))
        number, setup = outcome.result.frame, outcome.stream.id
        self._send(Message(Kind.RESULT, payload, number, outcome.time_ns, 0, setup))

    def state(self, state: State) -> None:
        self._send(Message(Kind.STATUS, packed(state_entries(state))))

    def close(self) -> None:
        if self._open:
            self._send(Message(Kind.END))
        self._outlet.close()

    def abandon(self) -> None:
        self._outlet.close()

    def _send(self, message: Message) -> None:
        """Send a message; raises OSError without a receiver."""
        if self._broken is not None and self._clock() < self._again_s:
            raise self._broken
        try:
            if not self._open:
                self._outlet.open()
                self._open, self._broken, self._delay_s = True, None, FIRST_DELAY_S
            self._outlet.send(pack(message))
        except OSError as error:
            self._open, self._broken = False, error
            self._again_s = self._clock() + self._delay_s
            self._delay_s = min(2 * self._delay_s, MAX_DELAY_S)
            raise

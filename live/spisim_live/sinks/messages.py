"""Results as messages of the stream's framing."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from ..framing import Kind, Message, pack
from ..links import Outlet
from ..results import Outcome, State, result_entries, state_entries
from ..tables import packed
from .channel import Channel
from .sink import Sink


class MessageSink(Sink):
    """Sends each result and state; without a receiver they are gone."""

    fleeting = True

    def __init__(self, outlet: Outlet, clock: Callable[[], float] = time.monotonic) -> None:
        self._channel = Channel(outlet, clock)

    @contextmanager
    def ready(self) -> Iterator[None]:
        self._channel.check()
        yield

    def result(self, outcome: Outcome) -> None:
        payload = packed(result_entries(outcome))
        number, setup = outcome.result.frame, outcome.stream.id
        self._send(Message(Kind.RESULT, payload, number, outcome.time_ns, 0, setup))

    def state(self, state: State) -> None:
        self._send(Message(Kind.STATUS, packed(state_entries(state))))

    def close(self) -> None:
        if self._channel.is_open:
            self._send(Message(Kind.END))
        self._channel.close()

    def abandon(self) -> None:
        self._channel.close()

    def _send(self, message: Message) -> None:
        self._channel.send(pack(message))

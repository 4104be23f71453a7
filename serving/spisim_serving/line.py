"""The line over which frames leave and commands come back."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress

from spisim_live import Kind, Message
from spisim_live.links import Ended, Outlet, Source
from spisim_live.poses import POSE
from spisim_live.senders import Senders

AGAIN_S = 0.5
POLL_S = 0.05


class Line:
    """Opens an outlet for frames and a source of commands, and reopens them when they break.

    Commands are accepted from one sender at a time.

    Parameters
    ----------
    outlet, source
        Where frames go and commands come from, which may be the same; None without commands.
    lasting
        Whether to wait for a new peer when one has gone; otherwise OSError is raised.
    say, wait, clock
        Print a sentence, sleep for seconds, and return the time in seconds.
    """

    def __init__(
        self,
        outlet: Outlet,
        source: Source | None,
        *,
        lasting: bool,
        say: Callable[[str], None],
        wait: Callable[[float], object],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        outlet.check()
        if source is not None and source is not outlet:
            source.check()
        self.over = False
        self.senders = Senders(_fits)
        self._outlet = outlet
        self._source = source
        self._lasting = lasting
        self._say = say
        self._wait = wait
        self._clock = clock
        self._open = False

    @property
    def address(self) -> str:
        """Address that frames go to."""
        return self._outlet.address

    def open(self) -> bool:
        """Wait for a peer; return whether the line was closed before."""
        announced = False
        was_open = self._open
        while not self._open:
            try:
                self._outlet.open()
                if self._source is not None and self._source is not self._outlet:
                    self._source.open()
                self._open = True
                self.senders.reset(self._clock())
            except OSError as error:
                if not self._lasting:
                    raise
                if not announced:
                    self._say(f"Waiting for somebody at {self.address}.")
                announced = True
                if not isinstance(error, TimeoutError):
                    self._wait(AGAIN_S)
        return not was_open

    def send(self, content: bytes) -> bool:
        """Send a message; False if the peer has gone."""
        try:
            self._outlet.send(content)
        except OSError as error:
            self._break(error)
            return False
        return True

    def messages(self, timeout_s: float) -> list[Message]:
        """Messages that arrive within the timeout; sets `over` when no more will come."""
        if self._source is None or self.over:
            return []
        try:
            piece = self._source.receive(timeout_s)
        except Ended:
            self.over = True
            return []
        except OSError as error:
            self._break(error)
            return []
        now_s = self._clock()
        messages = self.senders.feed(self._source.sender, piece, now_s)
        if any(each.kind == Kind.COMMAND and each.payload is not None for each in messages):
            self.senders.accept(now_s)
        connected = self._source is self._outlet or self.senders.heard == self._source.sender
        return [each for each in messages if connected or each.kind != Kind.END]

    def give_way(self) -> None:
        """Disconnect a silent peer if another one is waiting."""
        if self._open and self._outlet.wanted and self.senders.quiet(self._clock()):
            self._break(TimeoutError("no command arrives, and another peer is waiting"))

    @property
    def is_open(self) -> bool:
        """Whether a peer is connected, as far as is known."""
        return self._open

    def close(self) -> None:
        """Close both ends."""
        for link in (self._outlet, self._source):
            if link is not None:
                with suppress(OSError):
                    link.close()

    def _break(self, error: OSError) -> None:
        self._open = False
        self.senders.reset(self._clock())
        if not self._lasting:
            raise error
        self._say(f"{self.address}: {(error.strerror or str(error)).lower()}.")


def _fits(message: Message, length: int) -> bool:
    """Whether the header is that of a command or an end."""
    return length <= {Kind.COMMAND: POSE.size, Kind.END: 0}.get(Kind(message.kind), -1)

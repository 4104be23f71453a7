"""Those who send into a source, told apart: one at a time is heard."""

from collections.abc import Callable

from .framing import Message, Parser

QUIET_S, MAX_QUIET_S = 2.0, 60.0
"""After so long without anything of use, whoever sends loses its place to another one."""
QUIET_FRAMES = 4
"""... or after so many frames, if these last longer."""
MAX_SENDERS = 4
"""Whose messages are put together at a time: any datagram may have an address of its own."""
AT_ONCE = 8
"""Changes, before any has to wait."""
FRAMES_A_CHANGE, SECONDS_A_CHANGE = 256, 10.0
"""After which there may be one more, whichever comes first."""


class Senders:
    """Puts the messages of each sender together for itself, and listens to one at a time.

    Who has sent something of use, as `accept` tells, is heard alone until `quiet`: bytes of others
    are ``ignored_bytes`` meanwhile. What has begun and does not come on is given up, too. ``fits``
    is that of a `Parser`.
    """

    def __init__(self, fits: Callable[[Message, int], bool]) -> None:
        self.ignored_bytes = 0
        self.heard: str | None = None
        self._heard_s = -float("inf")
        self._quiet_s = QUIET_S
        self._last = ""
        self._fits = fits
        self._parsers: dict[str, Parser] = {}
        self._came_s: dict[str, float] = {}
        self._over = Parser()
        """Counts for all senders that are forgotten."""

    def feed(self, sender: str, piece: bytes, now_s: float) -> list[Message]:
        """Messages that a piece completes; none of somebody who is not heard now."""
        if self.heard not in (None, sender) and not self.quiet(now_s):
            self.ignored_bytes += len(piece)
            return []
        self._last = sender
        parser = self._parsers.pop(sender, None) or Parser(self._fits)
        self._parsers[sender] = parser
        self._came_s[sender] = now_s
        if len(self._parsers) > MAX_SENDERS:
            self._forget(next(iter(self._parsers)))
        return parser.feed(piece)

    def expect(self, period_s: float) -> None:
        """Something of use each so long; nan where that is not known."""
        self._quiet_s = min(max(QUIET_S, QUIET_FRAMES * period_s), MAX_QUIET_S)

    def accept(self, now_s: float) -> None:
        """What came last is of use: its sender is heard from now on."""
        self.heard, self._heard_s = self._last, now_s

    def quiet(self, now_s: float) -> bool:
        """Whether nothing of use has come for so long that another one may be heard."""
        return now_s - self._heard_s > self._quiet_s

    def give_up(self, now_s: float) -> None:
        """Do not wait for messages any more that do not come on."""
        for sender, came_s in list(self._came_s.items()):
            if now_s - came_s > self._quiet_s:
                self._forget(sender)

    def reset(self, now_s: float) -> None:
        """Hear whoever comes next."""
        for sender in list(self._parsers):
            self._forget(sender)
        self.heard, self._heard_s = None, now_s

    @property
    def discarded_bytes(self) -> int:
        """Those that belong to no sound message."""
        return sum(each.discarded_bytes for each in (self._over, *self._parsers.values()))

    @property
    def given_up(self) -> int:
        """Messages that had begun and did not come on."""
        return sum(each.given_up for each in (self._over, *self._parsers.values()))

    def _forget(self, sender: str) -> None:
        parser = self._parsers.pop(sender)
        del self._came_s[sender]
        parser.reset()
        self._over.discarded_bytes += parser.discarded_bytes
        self._over.given_up += parser.given_up


class Allowance:
    """Bounds what each change of the setup costs, in methods compiled and files begun.

    There may be `AT_ONCE` changes, and then one more for so many frames or seconds.
    """

    def __init__(self) -> None:
        self._left = float(AT_ONCE)
        self._frames = 0
        self._seen_s: float | None = None

    def take(self, frames: int, now_s: float) -> bool:
        """Whether there may be a change now, after so many frames: then it is taken."""
        waited_s = 0.0 if self._seen_s is None else now_s - self._seen_s
        earned = (frames - self._frames) / FRAMES_A_CHANGE + waited_s / SECONDS_A_CHANGE
        self._left = min(self._left + earned, AT_ONCE)
        self._frames, self._seen_s = frames, now_s
        allowed = self._left >= 1
        self._left -= allowed
        return allowed

"""Senders into a source, one of which is heard at a time, and the limit of their setup changes."""

from collections.abc import Callable

from .framing import Message, Parser

QUIET_S, MAX_QUIET_S = 2.0, 60.0
"""Silence after which another sender may be heard,"""
QUIET_FRAMES = 4
"""or so many frames, if these last longer."""
MAX_SENDERS = 4
"""Maximum number of senders whose messages are assembled: every datagram may have its own."""
AT_ONCE = 8
"""Changes allowed at once,"""
FRAMES_A_CHANGE, SECONDS_A_CHANGE = 256, 10.0
"""and frames or seconds that earn another one, whichever comes first."""


class Senders:
    """Assembles the messages of each sender separately, and hears one at a time.

    A sender that has sent something useful (`accept`) is heard alone until `quiet`; bytes of others
    are ``ignored_bytes`` meanwhile. Incomplete messages are given up, too. ``fits`` is that of a
    `Parser`.
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
        """Messages that a piece completes; none of a sender that is not heard."""
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
        """Expect something useful each period; nan if unknown."""
        self._quiet_s = min(max(QUIET_S, QUIET_FRAMES * period_s), MAX_QUIET_S)

    def accept(self, now_s: float) -> None:
        """Hear the sender of what came last."""
        self.heard, self._heard_s = self._last, now_s

    def quiet(self, now_s: float) -> bool:
        """Whether nothing useful has come for so long that another sender may be heard."""
        return now_s - self._heard_s > self._quiet_s

    def give_up(self, now_s: float) -> None:
        """Give up incomplete messages of silent senders."""
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
        """Bytes that belong to no sound message."""
        return sum(each.discarded_bytes for each in (self._over, *self._parsers.values()))

    @property
    def given_up(self) -> int:
        """Messages that began but did not end."""
        return sum(each.given_up for each in (self._over, *self._parsers.values()))

    def _forget(self, sender: str) -> None:
        parser = self._parsers.pop(sender)
        del self._came_s[sender]
        parser.reset()
        self._over.discarded_bytes += parser.discarded_bytes
        self._over.given_up += parser.given_up


class Allowance:
    """Limits setup changes, each of which costs compiled methods and new files.

    There may be `AT_ONCE` changes, and then one more per so many frames or seconds.
    """

    def __init__(self) -> None:
        self._left = float(AT_ONCE)
        self._frames = 0
        self._seen_s: float | None = None

    def take(self, frames: int, now_s: float) -> bool:
        """Whether a change is allowed now, after so many frames; if so, it is used up."""
        waited_s = 0.0 if self._seen_s is None else now_s - self._seen_s
        earned = (frames - self._frames) / FRAMES_A_CHANGE + waited_s / SECONDS_A_CHANGE
        self._left = min(self._left + earned, AT_ONCE)
        self._frames, self._seen_s = frames, now_s
        allowed = self._left >= 1
        self._left -= allowed
        return allowed

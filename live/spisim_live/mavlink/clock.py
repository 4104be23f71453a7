"""Time stamps of other machines in the time of this one."""

import math
from collections import deque
from typing import NamedTuple

WINDOW_S = 10.0
"""Messages of one to two windows decide; clocks drift apart by a millisecond in that time."""
RECENT = 8
"""Messages whose least delay but one shows where the offset is now."""
WITNESSES = 3
"""Messages in a row that agree on another delay and so confirm it; one alone may be forged."""
FIRST_SPREAD_S, AVERAGED = 5e-3, 64
"""Mean delay beyond the least one, before messages show it, and how many of them show it."""
SPREADS, MIN_LIMIT_S = 5.0, 0.03
"""Delays within so many spreads of the usual ones, but at least within this, are usual."""


class Instant(NamedTuple):
    """Time of a message by this machine's clock, and the sigma of that.

    ``confirmed`` unless its stamp contradicts those before it.
    """

    time_s: float
    sigma_s: float
    confirmed: bool = True


class Clock:
    """Estimates the offset of a sender's clock from the delays of its messages.

    Delays on the way only ever add to a message's arrival, so that the offset lies between the
    least delay of the window (a minimum filter) and that of the last few messages, which differ
    where messages queue up or the clock has stepped back by less than shows. A message outside
    these waits for `WITNESSES` of its delay. If they come before their time, or with stamps that go
    back, the sender's clock has stepped, and the estimate begins anew.
    """

    def __init__(self) -> None:
        self._spread_s = FIRST_SPREAD_S
        self._waiting: list[float] = []
        self._stepped = True
        self._begin([], -math.inf)

    def _begin(self, delays_s: list[float], stamp_s: float) -> None:
        """Begin with the delays of a few messages, of which this is the last stamp."""
        self._recent = deque(delays_s, RECENT)
        self._least_s = self._least_before_s = min(delays_s, default=math.inf)
        self._since_s = math.inf
        self._newest_s = stamp_s
        self._messages = max(len(delays_s) - 1, 0)

    def at(self, stamp_s: float, arrival_s: float) -> Instant:
        """Return when a message was stamped, by this machine's clock; not after its arrival."""
        delay_s = arrival_s - stamp_s
        if not self._recent:
            self._begin([delay_s], stamp_s)
        low_s, high_s = self._bounds()
        limit_s = max(MIN_LIMIT_S, SPREADS * self._spread_s)
        change_s = min(abs(delay_s - high_s), limit_s) - self._spread_s
        self._spread_s += change_s / min(self._messages + 2, AVERAGED)
        if low_s - limit_s <= delay_s <= high_s + limit_s:
            self._waiting.clear()
            self._recent.append(delay_s)
        elif not self._agreed(delay_s, stamp_s, low_s, limit_s):
            late_s = 0.0 if self._stepped else (delay_s - low_s) / 2
            return Instant(arrival_s - late_s, math.hypot(self._spread_s, late_s), confirmed=False)
        return self._placed(stamp_s, arrival_s)

    def _bounds(self) -> tuple[float, float]:
        """Least delay of the window, and of the last few messages: all but one agree on that."""
        return min(self._least_s, self._least_before_s), sorted(self._recent)[:2][-1]

    def _agreed(self, delay_s: float, stamp_s: float, low_s: float, limit_s: float) -> bool:
        """Add an unusual delay to those that wait; whether they are believed now."""
        alike = [each for each in self._waiting if abs(each - delay_s) < limit_s]
        self._waiting = [*alike, delay_s]
        steps = delay_s < low_s or stamp_s < self._newest_s - MIN_LIMIT_S
        self._stepped = steps or (self._stepped and bool(alike))
        if len(self._waiting) < WITNESSES:
            return False
        if self._stepped:
            self._begin(self._waiting, stamp_s)
        self._recent = deque(self._waiting, RECENT)
        self._waiting = []
        return True

    def _placed(self, stamp_s: float, arrival_s: float) -> Instant:
        """Time of a message whose delay is usual."""
        self._messages += 1
        self._newest_s = max(self._newest_s, stamp_s)
        self._since_s = min(self._since_s, arrival_s)
        if arrival_s - self._since_s > WINDOW_S:
            self._least_before_s, self._least_s = self._least_s, math.inf
            self._since_s = arrival_s
        self._least_s = min(self._least_s, *self._recent)
        low_s, high_s = self._bounds()
        half_s = (high_s - low_s) / 2
        sigma_s = math.hypot(self._spread_s / math.sqrt(min(self._messages, AVERAGED)), half_s)
        return Instant(min(stamp_s + low_s + half_s, arrival_s), sigma_s)

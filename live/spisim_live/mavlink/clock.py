"""Time stamps of other machines in the time of this one."""

BACK_S = 1.0
"""Time going back further than this shows that the sender has restarted."""
WINDOW_S = 30.0
"""Messages of one to two windows decide; clocks drift apart by a millisecond in that time."""


class Clock:
    """Estimates the offset of a sender's clock as the least delay of its recent messages.

    Delays on the way only ever add to a message's arrival, so that the least is nearest to the
    truth (a minimum filter).
    """

    def __init__(self) -> None:
        self._restart()

    def _restart(self) -> None:
        self._last_s = -float("inf")
        self._since_s = -float("inf")
        self._least_s = self._least_before_s = float("inf")

    def local_s(self, stamp_s: float, arrival_s: float) -> float:
        """Return a message's time stamp by this machine's clock; never later than its arrival."""
        if stamp_s < self._last_s - BACK_S:
            self._restart()
        self._last_s = max(self._last_s, stamp_s)
        if arrival_s - self._since_s > WINDOW_S:
            self._least_before_s, self._least_s = self._least_s, float("inf")
            self._since_s = arrival_s
        self._least_s = min(self._least_s, arrival_s - stamp_s)
        return stamp_s + min(self._least_s, self._least_before_s)

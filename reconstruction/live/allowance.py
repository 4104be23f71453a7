"""How often a stream may change its setup."""

AT_ONCE = 8
"""Changes, before any has to wait."""
FRAMES_A_CHANGE, SECONDS_A_CHANGE = 256, 10.0
"""After which there may be one more, whichever comes first."""


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

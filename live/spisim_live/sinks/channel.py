"""An outlet that is opened again after it broke."""

import time
from collections.abc import Callable

from ..links import Outlet
from ..reception import FIRST_DELAY_S, MAX_DELAY_S


class Channel:
    """Sends to an outlet, and opens it again after an error, with a growing delay."""

    def __init__(self, outlet: Outlet, clock: Callable[[], float] = time.monotonic) -> None:
        self.is_open = False
        self._outlet = outlet
        self._clock = clock
        self._broken: OSError | None = None
        self._delay_s = FIRST_DELAY_S
        self._again_s = -float("inf")

    def check(self) -> None:
        """Raise InputError if it can never be opened."""
        self._outlet.check()

    def send(self, content: bytes) -> None:
        """Send all bytes; raises OSError without a receiver."""
        if self._broken is not None and self._clock() < self._again_s:
            raise self._broken
        try:
            if not self.is_open:
                self._outlet.open()
                self.is_open, self._broken, self._delay_s = True, None, FIRST_DELAY_S
            self._outlet.send(content)
        except OSError as error:
            self.is_open, self._broken = False, error
            self._again_s = self._clock() + self._delay_s
            self._delay_s = min(2 * self._delay_s, MAX_DELAY_S)
            raise

    def close(self) -> None:
        """Close the outlet, from any thread."""
        self._outlet.close()

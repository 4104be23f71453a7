"""Frames in order: lost, late, reordered and duplicated ones."""

from typing import Generic, TypeVar

from .counts import Counts

MODULUS = 2**32
REMEMBERED = 64
"""Frames back to which a lost frame may be late."""
ASTRAY = 16
"""So many usable frames in a row, each farther back, show the last number to be wrong."""
HOLD_S = 0.1
"""Maximum time that an early frame is held."""

Item = TypeVar("Item")


class Sequence(Generic[Item]):
    """Restores the order of frames by their numbers, which wrap from 2^32 - 1 to 0.

    An early frame is held until those before it have come, more than ``window`` are held, or for
    `HOLD_S`: then those before it are lost. Unusable frames keep their turn. A sender restarts if
    its ``run`` changes, or `ASTRAY` numbers in a row are more than `REMEMBERED` back; without a
    run, 0, if a single one is.
    """

    def __init__(self, counts: Counts, window: int) -> None:
        self._counts = counts
        self._window = window
        self._run: int | None = None
        self._next = 0
        self._held: dict[int, Item | None] = {}
        self._since_s = 0.0
        self._missing: dict[int, bool] = {}
        self._astray = 0

    def take(self, run: int, number: int, item: Item | None, now_s: float) -> list[Item]:
        """Frames that are due once this one has come, None for an unusable one."""
        ahead = self._ahead(number)
        given: list[Item] = []
        self._astray = self._astray + (item is not None) if ahead < -REMEMBERED else 0
        if run != self._run or self._astray >= (ASTRAY if run else 1):
            given = self.flush()
            self._counts.restarts += self._run is not None
            self._run, self._next, ahead = run, number, 0
            self._missing.clear()
            self._astray = 0
        if ahead < 0:
            self._behind(number, usable=item is not None)
            return given
        if self._held.get(number) is not None:
            self._counts.duplicated += item is not None
            return given
        if any(self._ahead(held) > ahead for held in self._held):
            self._counts.reordered += 1
        if not self._held:
            self._since_s = now_s
        self._held[number] = item
        given += self._due()
        if len(self._held) > self._window:
            given += self._give_up(now_s)
        return given

    def overdue(self, now_s: float) -> list[Item]:
        """Frames held for too long."""
        late = bool(self._held) and now_s - self._since_s > HOLD_S
        return self._give_up(now_s) if late else []

    def flush(self) -> list[Item]:
        """All frames that are held."""
        given: list[Item] = []
        while self._held:
            given += self._give_up(0.0)
        return given

    def _ahead(self, number: int) -> int:
        """Distance from the next number."""
        return (number - self._next + MODULUS // 2) % MODULUS - MODULUS // 2

    def _behind(self, number: int, *, usable: bool) -> None:
        """Handle a frame whose turn is over."""
        if number in self._missing:
            self._counts.lost -= self._missing[number]
            self._counts.late += usable
            if usable:
                del self._missing[number]
            else:
                self._missing[number] = False
        elif usable:
            self._counts.duplicated += 1

    def _due(self) -> list[Item]:
        """Held frames whose turn it is."""
        given: list[Item] = []
        while self._next in self._held:
            item = self._held.pop(self._next)
            if item is None:
                self._miss(self._next, lost=False)
            else:
                given.append(item)
            self._next = (self._next + 1) % MODULUS
        return given

    def _give_up(self, now_s: float) -> list[Item]:
        """The first held frames, without those missing before them."""
        first = min(self._held, key=self._ahead)
        missing = self._ahead(first)
        self._counts.lost += missing
        for back in range(min(missing, REMEMBERED), 0, -1):
            self._miss((first - back) % MODULUS, lost=True)
        self._next = first
        self._since_s = now_s
        return self._due()

    def _miss(self, number: int, *, lost: bool) -> None:
        self._missing[number] = lost
        if len(self._missing) > REMEMBERED:
            del self._missing[next(iter(self._missing))]

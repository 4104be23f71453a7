"""Frames in order: lost, late, reordered and duplicated ones."""

from typing import Generic, TypeVar

from .counts import Counts

MODULUS = 2**32
REMEMBERED = 64
"""Frames back to which a lost frame may be late."""
ASTRAY = 16
"""So many usable frames in a row, each farther back, show the last number to be wrong."""
HOLD_S = 0.1
"""Maximum time that an early frame is held, unless frames are rarer."""

Item = TypeVar("Item")


class Sequence(Generic[Item]):
    """Restores the order of frames by their numbers, which wrap from 2^32 - 1 to 0.

    An early frame is held until those before it have come, more than ``window`` are held, or none
    has come in turn for ``hold_s``: then those before it are lost. One more than `REMEMBERED` ahead
    waits for another one there, as its number may be false. An unusable frame has its turn once a
    usable one follows, as it may be a false copy. A sender restarts if its ``run`` changes, or
    `ASTRAY` numbers in a row are more than `REMEMBERED` back; without a run, 0, if a single one is.
    """

    def __init__(self, counts: Counts, window: int) -> None:
        self.hold_s = HOLD_S
        self._counts = counts
        self._window = window
        self._run: int | None = None
        self._next = 0
        self._held: dict[int, Item] = {}
        self._unusable: set[int] = set()
        self._far: tuple[int, Item] | None = None
        self._since_s = 0.0
        self._missing: dict[int, bool] = {}
        self._astray = 0

    def take(self, run: int, number: int, item: Item | None, now_s: float) -> list[Item]:
        """Frames that are due once this one has come, None for an unusable one."""
        ahead = self._ahead(number)
        if item is None:
            return self._mark(run, number, ahead)
        given: list[Item] = []
        self._astray = self._astray + 1 if ahead < -REMEMBERED else 0
        if run != self._run or self._astray >= (ASTRAY if run else 1):
            given = self.flush()
            self._counts.restarts += self._run is not None
            self._begin(run, number)
            ahead = 0
        if ahead < 0:
            self._behind(number)
            return given
        if ahead > REMEMBERED:
            return self._jump(number, item, now_s)
        return given + self._hold(number, item, now_s)

    def _hold(self, number: int, item: Item, now_s: float) -> list[Item]:
        """Hold a frame until its turn; those that are due now."""
        self._counts.refused += self._far is not None
        self._far = None
        if number in self._held:
            self._counts.duplicated += 1
            return []
        ahead = self._ahead(number)
        if any(self._ahead(held) > ahead for held in self._held):
            self._counts.reordered += 1
        if not self._held:
            self._since_s = now_s
        self._held[number] = item
        if given := self._due():
            self._since_s = now_s
        if len(self._held) > self._window:
            given += self._give_up(now_s)
        return given

    def overdue(self, now_s: float) -> list[Item]:
        """Frames held for too long."""
        late = bool(self._held) and now_s - self._since_s > self.hold_s
        return self._give_up(now_s) if late else []

    def flush(self) -> list[Item]:
        """All frames that are held."""
        given: list[Item] = []
        while self._held:
            given += self._give_up(0.0)
        if self._far is not None:
            (number, item), self._far = self._far, None
            self._held[number] = item
            given += self._give_up(0.0)
        return given

    def _begin(self, run: int, number: int) -> None:
        """Begin with a number."""
        self._run, self._next, self._astray = run, number, 0
        self._missing.clear()
        self._unusable.clear()

    def _jump(self, number: int, item: Item, now_s: float) -> list[Item]:
        """Go on far ahead if another frame has come from there."""
        if self._far is None or abs(self._ahead(self._far[0]) - self._ahead(number)) > REMEMBERED:
            self._counts.refused += self._far is not None
            self._far = (number, item)
            return []
        if number == self._far[0]:
            self._counts.duplicated += 1
            return []
        given = self.flush()
        return [*given, *self.take(self._run or 0, number, item, now_s)]

    def _mark(self, run: int, number: int, ahead: int) -> list[Item]:
        """Note an unusable frame, whose turn it is once a usable one follows."""
        if run != self._run:
            return []
        if self._missing.get(number):
            self._counts.lost -= 1
            self._missing[number] = False
        elif 0 <= ahead <= self._window and number not in self._held:
            self._unusable.add(number)
        return self._due()

    def _ahead(self, number: int) -> int:
        """Distance from the next number."""
        return (number - self._next + MODULUS // 2) % MODULUS - MODULUS // 2

    def _behind(self, number: int) -> None:
        """Count a usable frame whose turn is over."""
        lost = self._missing.pop(number, None)
        self._counts.lost -= bool(lost)
        self._counts.late += lost is not None
        self._counts.duplicated += lost is None

    def _due(self) -> list[Item]:
        """Held frames whose turn it is; that of unusable ones has passed once others are held."""
        given: list[Item] = []
        while self._next in self._held or (self._held and self._next in self._unusable):
            if self._next in self._held:
                given.append(self._held.pop(self._next))
            else:
                self._miss(self._next, lost=False)
            self._unusable.discard(self._next)
            self._next = (self._next + 1) % MODULUS
        return given

    def _give_up(self, now_s: float) -> list[Item]:
        """The first held frames, without those missing before them."""
        first = min(self._held, key=self._ahead)
        missing = self._ahead(first)
        unusable = {each for each in self._unusable if self._ahead(each) < missing}
        self._counts.lost += missing - len(unusable)
        for back in range(min(missing, REMEMBERED), 0, -1):
            number = (first - back) % MODULUS
            self._miss(number, lost=number not in unusable)
        self._unusable -= unusable
        self._next = first
        self._since_s = now_s
        return self._due()

    def _miss(self, number: int, *, lost: bool) -> None:
        self._missing[number] = lost
        if len(self._missing) > REMEMBERED:
            del self._missing[next(iter(self._missing))]

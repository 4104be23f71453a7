"""What waits between threads: a bounded number, of which the oldest gives way."""

import threading
from collections import deque
from typing import Generic, TypeVar

Item = TypeVar("Item")


class Waiting(Generic[Item]):
    """At most so many ``items`` that wait; ``dropped`` gave way to newer ones."""

    def __init__(self, items: int) -> None:
        self.dropped = 0
        self._items: deque[Item] = deque()
        self._most = items
        self._closed = False
        self._changed = threading.Condition()

    def put(self, item: Item) -> None:
        """One more; where there are too many, the oldest is dropped."""
        with self._changed:
            if len(self._items) >= self._most:
                self._items.popleft()
                self.dropped += 1
            self._items.append(item)
            self._changed.notify_all()

    def put_in_turn(self, item: Item) -> None:
        """One more, as soon as there is room for it or nobody takes any."""
        with self._changed:
            self._changed.wait_for(lambda: len(self._items) < self._most or self._closed)
            self._items.append(item)
            self._changed.notify_all()

    def get(self, timeout_s: float) -> Item | None:
        """The oldest; None where there is none for so long, or none any more."""
        with self._changed:
            self._changed.wait_for(lambda: self._items or self._closed, timeout_s)
            if not self._items:
                return None
            item = self._items.popleft()
            self._changed.notify_all()
            return item

    def close(self) -> None:
        """Nothing more will come: what waits can still be taken."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    @property
    def over(self) -> bool:
        """Whether it is closed and empty."""
        with self._changed:
            return self._closed and not self._items

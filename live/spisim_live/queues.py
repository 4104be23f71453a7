"""Bounded queue between threads, which drops its oldest items."""

import threading
from collections import deque
from typing import Generic, TypeVar

Item = TypeVar("Item")


MAX_BYTES = 2**25
"""Maximum size of all queued items."""


class BoundedQueue(Generic[Item]):
    """Queue of at most ``items``; ``dropped`` counts those that gave way to newer ones."""

    def __init__(self, items: int) -> None:
        self.dropped = 0
        self._items: deque[tuple[Item, int]] = deque()
        self._bytes = 0
        self._maximum = items
        self._closed = False
        self._changed = threading.Condition()

    def put(self, item: Item, size: int = 0) -> None:
        """Append an item of so many bytes, dropping the oldest if the queue is full."""
        with self._changed:
            while self._items and self._full(size):
                self._taken()
                self.dropped += 1
            self._put(item, size)

    def put_in_turn(self, item: Item, size: int = 0) -> None:
        """Append an item as soon as there is room, or the queue is closed."""
        with self._changed:
            self._changed.wait_for(lambda: not (self._items and self._full(size)) or self._closed)
            self._put(item, size)

    def get(self, timeout_s: float) -> Item | None:
        """Take the oldest item; None after the timeout, or if the queue is closed and empty."""
        with self._changed:
            self._changed.wait_for(lambda: self._items or self._closed, timeout_s)
            if not self._items:
                return None
            item = self._taken()
            self._changed.notify_all()
            return item

    def clear(self) -> None:
        """Drop all items."""
        with self._changed:
            self.dropped += len(self._items)
            while self._items:
                self._taken()
            self._changed.notify_all()

    def close(self) -> None:
        """Accept that nothing more will come; queued items can still be taken."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    @property
    def empty(self) -> bool:
        """Whether no item is queued."""
        with self._changed:
            return not self._items

    @property
    def over(self) -> bool:
        """Whether it is closed and empty."""
        with self._changed:
            return self._closed and not self._items

    def _full(self, size: int) -> bool:
        """Whether there is no room for an item of so many bytes."""
        return len(self._items) >= self._maximum or self._bytes + size > MAX_BYTES

    def _put(self, item: Item, size: int) -> None:
        self._items.append((item, size))
        self._bytes += size
        self._changed.notify_all()

    def _taken(self) -> Item:
        item, size = self._items.popleft()
        self._bytes -= size
        return item

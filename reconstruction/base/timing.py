"""Timing of steps."""

from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter


@contextmanager
def timed(seconds: dict[str, float], step: str) -> Iterator[None]:
    """Record how long a step takes."""
    started = perf_counter()
    yield
    seconds[step] = perf_counter() - started

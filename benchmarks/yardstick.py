"""How slow this machine is right now, by a fixed piece of work: times are promised of a reference.

A promise in seconds is one of a machine. Work like ours is timed beside what is judged, and a time
is divided by how much longer that took than on the machine that the promises were made on.
"""

from collections.abc import Callable
from functools import partial
from multiprocessing import get_context
from time import perf_counter, thread_time

import numpy as np

from spisim_paper.checks import Interval

REFERENCE_S = 3.25e-3
"""What the work takes on one core of the AMD EPYC of the docs, with nothing beside it."""
LAGGING = 1.3
"""Slowness from which on work that keeps up on the reference may not."""
LAPS = 31
SIZE, CALLS = 96, 300
MATRIX = np.random.default_rng(0).standard_normal((SIZE, SIZE))


def work() -> float:
    """Small products and Fourier transforms, and much Python between them, on one core."""
    total = 0.0
    for n in range(CALLS):
        row = MATRIX[n % SIZE]
        total += float((MATRIX @ row) @ row) + abs(np.fft.rfft(row)[1])
        total += sum(each * each for each in range(100))
    return total


class Yardstick:
    """Slowness of the machine, as often as it was looked at while something else was measured.

    With several workers it is that of so many cores at once, on the clock.
    """

    def __init__(
        self, clock: Callable[[], float] = perf_counter, *, laps: int = LAPS, workers: int = 1
    ) -> None:
        self._lap = partial(_mean_lap_s, clock, laps)
        self._workers = workers
        self._slowness: list[float] = []
        work()

    def look(self) -> None:
        """Time the work, on average over some laps."""
        if self._workers == 1:
            took_s = self._lap()
        else:
            with get_context("spawn").Pool(self._workers) as pool:
                calls = [pool.apply_async(self._lap) for _ in range(self._workers)]
                took_s = float(np.mean([each.get() for each in calls]))
        self._slowness.append(took_s / REFERENCE_S)

    @property
    def slowness(self) -> float:
        """Median of all looks."""
        return float(np.median(self._slowness))

    def on_reference(self, time: float, interval: Interval | None = None) -> tuple[float, Interval]:
        """A time as it would be on the reference; an `interval` of the time itself adds to its own.

        The machine was as slow as at one of the looks, nobody knows at which.
        """

        def ends(confidence: float) -> tuple[float, float]:
            low, high = interval(confidence) if interval else (time, time)
            return low / max(self._slowness), high / min(self._slowness)

        return time / self.slowness, ends

    def of_lateness(self, value: float) -> Interval | None:
        """Of what comes of being late: where the machine lags, the reference may be on time."""
        if max(self._slowness) < LAGGING:
            return None
        return lambda confidence: (0.0, value)

    def of_ratio(self, ratio: float) -> Interval:
        """Of two times one after the other, while the machine may have been slowed."""
        drift = max(self._slowness) / min(self._slowness)
        return lambda confidence: (ratio / drift, ratio * drift)


def _mean_lap_s(clock: Callable[[], float], laps: int) -> float:
    began = clock()
    for _ in range(laps):
        work()
    return (clock() - began) / laps


def processor() -> Yardstick:
    """For processor times of one thread."""
    return Yardstick(thread_time)

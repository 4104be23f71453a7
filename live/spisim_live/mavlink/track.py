"""Values over time, interpolated."""

from bisect import bisect_left
from collections.abc import Callable
from typing import Any

import numpy as np

from reconstruction.base.arrays import Floats

MAX_GAP_S = 0.25
"""Farthest value in time that still says something."""

RATE_S = 0.1
"""Time over which rates are taken."""

Blend = Callable[[Floats, Floats, float], Floats]
Difference = Callable[[Floats, Floats], Floats]


def linear(before: Floats, after: Floats, fraction: float) -> Floats:
    """Interpolate linearly."""
    return np.asarray((1 - fraction) * before + fraction * after)


def slerp(before: Floats, after: Floats, fraction: float) -> Floats:
    """Interpolate unit quaternions at constant angular velocity, the shorter way."""
    cosine = float(before @ after)
    after, cosine = (-after, -cosine) if cosine < 0 else (after, cosine)
    angle = np.arccos(min(cosine, 1.0))
    if angle < 1e-6:
        blended = linear(before, after, fraction)
    else:
        blended = np.sin((1 - fraction) * angle) * before + np.sin(fraction * angle) * after
    return np.asarray(blended / np.linalg.norm(blended))


def shift(after: Floats, before: Floats) -> Floats:
    """Return how far values have moved."""
    return np.asarray(after - before)


def rotation_vector(after: Floats, before: Floats) -> Floats:
    """Rotation vector, in the axes before, between unit quaternions (x, y, z, w)."""
    (*vector, w), (x, y, z) = before, after[:3]
    part = w * after[:3] - after[3] * np.array(vector) - np.cross(vector, (x, y, z))
    sine, cosine = float(np.linalg.norm(part)), float(after @ before)
    angle = 2 * np.arctan2(sine, abs(cosine))
    return np.asarray(part * np.copysign(angle / sine if sine > 0 else 2.0, cosine))


class Track:
    """Values in the order of their times, whatever order they come in, for ``horizon_s``."""

    def __init__(self, horizon_s: float, blend: Blend = linear, change: Difference = shift) -> None:
        self._blend = blend
        self._change = change
        self._horizon_s = horizon_s
        self._times_s: list[float] = []
        self._values: list[Any] = []

    def add(self, time_s: float, value: Floats) -> None:
        """Add a value, in place of one of the same time."""
        at = bisect_left(self._times_s, time_s)
        same = self._times_s[at : at + 1] == [time_s]
        self._times_s[at : at + same] = [time_s]
        self._values[at : at + same] = [value]
        old = bisect_left(self._times_s, self._times_s[-1] - self._horizon_s)
        del self._times_s[:old], self._values[:old]

    def held_s(self, time_s: float) -> float:
        """Return for how long the last value is held at a time."""
        return max(time_s - self._times_s[-1], 0.0) if self._times_s else 0.0

    def rate(self, time_s: float) -> Floats | None:
        """Return the change per second before a time, that of the last value beyond it."""
        end_s = time_s - self.held_s(time_s)
        before, after = self.at(end_s - RATE_S), self.at(end_s)
        return None if before is None or after is None else self._change(after, before) / RATE_S

    def at(self, time_s: float) -> Floats | None:
        """Return the value at a time, that of the nearest end beyond, None beyond MAX_GAP_S."""
        after = bisect_left(self._times_s, time_s)
        near = range(max(after - 1, 0), min(after + 1, len(self._times_s)))
        gaps_s = [abs(self._times_s[index] - time_s) for index in near]
        if not gaps_s or min(gaps_s) > MAX_GAP_S:
            return None
        if len(near) == 1:
            return np.asarray(self._values[near[0]])
        before, beyond = (self._values[index] for index in near)
        return self._blend(before, beyond, gaps_s[0] / sum(gaps_s))

"""Ranges of the next frame, predicted from the points of a flight: what a sensor ought to see.

The nearest points along a direction give its range. A sensor's own error, such as the offset of a
zone, stays from frame to frame: a fraction of the last deviation from the prediction is predicted
to return, the one with the smallest errors over the last frames.
"""

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.capture.motion import PoseAt
from reconstruction.depth.memory.points import RangeMemory

RETURNING = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
"""Fractions of a deviation that may return."""
FORGETTING = 0.9
"""Weight of the errors of a frame relative to those of the next."""
MAX_DEVIATION = 0.1
"""Deviation of ln range that counts as another surface, and no more than that."""


class RangePrediction:
    """Predicts the ranges along ``directions`` (S, 3), which are the same in all frames."""

    def __init__(self, memory: RangeMemory, directions: Floats) -> None:
        self.memory, self._directions = memory, directions
        self._last = np.full(len(directions), np.nan)
        self._errors = np.zeros(RETURNING.size)

    def at(self, pose: PoseAt) -> Floats:
        """Ranges (S,) that are to be expected at a pose, nan where no point is near."""
        returning = RETURNING[self._errors.argmin()] * np.nan_to_num(self._last)
        return np.asarray(self.memory.along(pose, self._directions) * np.exp(returning))

    def take(self, pose: PoseAt, range_m: Floats, sigma_m: Floats) -> None:
        """Learn from the ranges (S,) at a pose, nan where there is none, and remember them."""
        now = self._deviation(pose, range_m)
        both = np.isfinite(now) & np.isfinite(self._last)
        left = np.abs(now[both] - RETURNING[:, None] * self._last[both])
        self._errors *= FORGETTING
        self._errors += np.minimum(left, MAX_DEVIATION).sum(axis=1)
        self.memory.add(pose, self._directions, range_m, sigma_m)
        self._last = self._deviation(pose, range_m)

    def _deviation(self, pose: PoseAt, range_m: Floats) -> Floats:
        """Of ln ranges (S,) from the points as they are; nan where there is none."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(np.log(range_m / self.memory.along(pose, self._directions)))

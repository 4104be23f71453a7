"""The constant by which the clock of the poses differs from that of the frames.

A pose that is late by d is that of the time t − d. Where speed or rate of turn change, successive
images fit with the poses of t + d alone; while these are constant, no d fits better, and nothing is
lost. The posterior of d is kept on a grid. Most rigs are synchronous: `SYNCHRONOUS` of the prior
lies within `TOLERANCE_S`, the rest is Gaussian.
"""

from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from ...base.arrays import Floats
from ...capture import Optics
from ...capture.motion import CORRELATION_S, USUAL_SIGMA_M, USUAL_SIGMA_RAD, PoseAt
from .registration import Evidence, Keyframe, Registration

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

MAX_OFFSET_S, GRID_S = 0.3, 0.01
SYNCHRONOUS, TOLERANCE_S, SIGMA_S = 0.7, 0.015, 0.15
START, STOP = 0.05, 0.3
"""Poses are corrected from where the probability that they are synchronous falls below the first
until it rises above the second."""
APART_S, EVERY_S = 0.25, 0.033
"""Time between the two frames of a pair, and between pairs."""
MAX_STEP_S = 0.12
"""Time between poses beyond which nothing is known of the motion between them."""
MAX_DEVIANCE = 25.0
DAMPING = 9.0
"""Variance of a relative pose, while images are aligned, over what is stated of it."""
FORGET_S = 30.0
"""Time in which evidence loses all but 1/e of its weight."""
LEVER_S = 0.1
"""Time over which the velocity is measured that carries the last pose on."""


class ClockOffset:
    """Estimates the delay of the poses from a flight's frames, and corrects poses by it.

    Attributes
    ----------
    offset_s
        Mean of d, positive where poses are late; 0 while nothing speaks against synchronous clocks.
    sigma_s
        Standard deviation of d.
    """

    def __init__(self, optics: Optics, shape: tuple[int, int]) -> None:
        self._registration = Registration(optics, shape)
        count = round(MAX_OFFSET_S / GRID_S)
        self._grid_s = GRID_S * np.arange(-count, count + 1)
        wide = np.exp(-((self._grid_s / SIGMA_S) ** 2) / 2)
        self._near = np.abs(self._grid_s) < TOLERANCE_S
        self._log_prior = np.log(
            (1 - SYNCHRONOUS) * wide / wide.sum() + SYNCHRONOUS * self._near / self._near.sum()
        )
        self._log_likelihood = np.zeros_like(self._grid_s)
        self._corrects = False
        self._describe()
        self.begin()

    def begin(self) -> None:
        """Forget the frames, not the clock: poses begin anew."""
        self._poses: deque[PoseAt] = deque()
        self._keyframes: deque[Keyframe] = deque()
        self._learned_s: float | None = None

    def take(self, pose: PoseAt, image: Floats, log_depth: Floats | None) -> None:
        """Add a frame's stated pose, image (H, W) and map of ln depth."""
        self._poses.append(pose)
        while pose.time_s - self._poses[0].time_s > 2 * MAX_OFFSET_S + 2 * APART_S:
            self._poses.popleft()
        keys = self._keyframes
        if log_depth is None or (keys and pose.time_s - keys[-1].time_s < EVERY_S):
            return
        keys.append(self._registration.keyframe(pose.time_s, image, log_depth))
        while pose.time_s - keys[0].time_s > MAX_OFFSET_S + 2 * APART_S:
            keys.popleft()
        pair = self._pair(pose.time_s - MAX_OFFSET_S)
        if pair is not None:
            self._learn(*pair)

    def _pair(self, until_s: float) -> tuple[Keyframe, Keyframe] | None:
        """The last frame whose poses of all offsets are known, if new, and one `APART_S` before."""
        late = [each for each in self._keyframes if each.time_s <= until_s]
        if not late or late[-1].time_s == self._learned_s:
            return None
        start_s = late[-1].time_s - APART_S
        before = min(late, key=lambda each: abs(each.time_s - start_s))
        steps_s = np.diff([each.time_s for each in self._poses])
        if (
            self._poses[0].time_s > start_s - MAX_OFFSET_S
            or abs(before.time_s - start_s) > MAX_STEP_S
            or steps_s.max() > MAX_STEP_S
        ):
            return None
        return late[-1], before

    def _learn(self, frame: Keyframe, before: Keyframe) -> None:
        turns, shifts_m = self._relative(frame.time_s, before.time_s)
        precision = self._precision(frame.time_s - before.time_s)
        zero = len(self._grid_s) // 2
        turn, shift_m = turns[zero], shifts_m[zero]
        evidence = self._registration.evidence(
            frame, before, turn.as_matrix(), shift_m, precision / DAMPING
        )
        passed_s = EVERY_S if self._learned_s is None else frame.time_s - self._learned_s
        self._learned_s = frame.time_s
        if evidence is None:
            return
        back = turn.inv()
        errors = np.hstack([(back * turns).as_rotvec(), back.apply(shifts_m - shift_m)])
        deviance = np.minimum(_deviance(evidence.marginalized(precision), errors), MAX_DEVIANCE)
        weight = min(passed_s / CORRELATION_S, 1.0)
        self._log_likelihood *= np.exp(-passed_s / FORGET_S)
        self._log_likelihood -= weight * deviance / 2
        self._describe()

    def _relative(self, time_s: float, before_s: float) -> "tuple[Rotation, Floats]":
        """Poses at a time in axes of those at an earlier one, for each offset of the grid.

        The nearest ones, as interpolated ones have less noise, which would speak for their offset.
        """
        from scipy.spatial.transform import Rotation  # slow to load

        times_s = np.array([each.time_s for each in self._poses])
        positions_m = np.array([each.position_m for each in self._poses])
        turns = Rotation.from_matrix(np.array([each.axes for each in self._poses]))
        middles_s = (times_s[1:] + times_s[:-1]) / 2
        now, then = (np.searchsorted(middles_s, at + self._grid_s) for at in (time_s, before_s))
        back = turns[then].inv()
        return back * turns[now], back.apply(positions_m[now] - positions_m[then])

    def _precision(self, apart_s: float) -> Floats:
        """Inverse variances (6,) of a relative pose, by what the last pose states of its error."""
        last = self._poses[-1]
        part = 2 * (1 - np.exp(-apart_s / CORRELATION_S))
        rad2 = max(last.variance_rad2, USUAL_SIGMA_RAD**2)
        m2 = max(last.variance_m2, USUAL_SIGMA_M**2)
        return 1 / (part * np.repeat([rad2, m2], 3))

    def _describe(self) -> None:
        log_posterior = self._log_prior + self._log_likelihood
        weight = np.exp(log_posterior - log_posterior.max())
        weight /= weight.sum()
        mean_s = float(weight @ self._grid_s)
        self.sigma_s = float(np.sqrt(weight @ (self._grid_s - mean_s) ** 2))
        self._corrects = weight[self._near].sum() < (STOP if self._corrects else START)
        self.offset_s = mean_s if self._corrects and abs(mean_s) > TOLERANCE_S else 0.0

    def corrected(self) -> PoseAt:
        """The last frame's pose at its own time: between two stated ones, or carried on."""
        last = self._poses[-1]
        if not self.offset_s:
            return last
        at_s, early = last.time_s + self.offset_s, self.offset_s < 0
        earlier = [p for p in self._poses if p.time_s <= (at_s if early else last.time_s - LEVER_S)]
        if not earlier:
            return last
        from scipy.spatial.transform import Rotation

        before, after = earlier[-1], self._poses[len(earlier)] if early else last
        step_s = after.time_s - before.time_s
        part = (at_s - before.time_s) / step_s
        way_m = after.position_m - before.position_m
        turn = Rotation.from_matrix(before.axes.T @ after.axes).as_rotvec()
        grown, unsure = _growth(part, step_s), (self.sigma_s / step_s) ** 2 / 3
        return PoseAt(
            last.time_s,
            before.position_m + part * way_m,
            before.axes @ Rotation.from_rotvec(part * turn).as_matrix(),
            grown * last.variance_m2 + unsure * float(way_m @ way_m),
            grown * last.variance_rad2 + unsure * float(turn @ turn),
        )


def _deviance(evidence: Evidence, errors: Floats) -> Floats:
    """−2 ln p of errors (n, 6), 0 at the likeliest."""
    square = np.einsum("ni,ij,nj->n", errors, evidence.information, errors)
    deviance = square - 2 * errors @ evidence.score
    return np.asarray(deviance - deviance.min())


def _growth(part: float, step_s: float) -> float:
    """Variance at a part of the way from one pose to another, over that of either."""
    common = np.exp(-step_s / CORRELATION_S)
    return float(part**2 + (1 - part) ** 2 + 2 * common * part * (1 - part))

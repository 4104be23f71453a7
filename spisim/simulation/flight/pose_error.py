"""Errors of the poses that a rig states, as of an autopilot's estimate.

The stated position is off by white noise, by a stationary error that is correlated in time (first
order Gauss–Markov: its correlation falls by e in `correlation_s`), and by a random walk that grows
from the flight's start; so is the rotation vector in the optical axes. A stated pose is that of an
earlier time by `delay_s`. The covariance stated with it is that of all three; the delay is not in
it, as a rig that knew it would correct it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field
from scipy.spatial.transform import Rotation

from reconstruction.base.arrays import Floats
from reconstruction.capture import Poses
from spisim.base.config import NonNegative, Positive, Section
from spisim.scene import Trajectory

MAX_DELAY_S = 10.0
"""Maximum age of a stated pose."""


class PoseError(Section):
    """Standard deviations per axis; all zero for the true poses."""

    white_m: NonNegative = 0.0
    """Position, independent from frame to frame."""
    white_deg: NonNegative = 0.0
    """Rotation, independent from frame to frame."""
    correlated_m: NonNegative = 0.0
    """Position, correlated in time."""
    correlated_deg: NonNegative = 0.0
    """Rotation, correlated in time."""
    correlation_s: Positive = 0.3
    """Time in which the correlation falls by e."""
    drift_m_per_sqrt_s: NonNegative = 0.0
    """Position, random walk after one second; it grows with the root of time."""
    drift_deg_per_sqrt_s: NonNegative = 0.0
    """Rotation, random walk after one second."""
    delay_s: Annotated[NonNegative, Field(le=MAX_DELAY_S)] = 0.0
    """Age of the stated pose."""


EXACT = PoseError()


@dataclass(frozen=True, eq=False)
class StatedPoses:
    """Poses that a rig states at successive times (frames,), with errors (frames, 6)."""

    path: Trajectory
    times_s: Floats
    delay_s: float
    errors: Floats
    variances: Floats

    @classmethod
    def drawn(
        cls, path: Trajectory, times_s: Floats, model: PoseError, seed: np.random.SeedSequence
    ) -> StatedPoses:
        """Draw the errors of a flight; those of its first frames do not depend on its length."""
        white, correlated, walk = (
            np.repeat([metres, np.radians(degrees)], 3)
            for metres, degrees in (
                (model.white_m, model.white_deg),
                (model.correlated_m, model.correlated_deg),
                (model.drift_m_per_sqrt_s, model.drift_deg_per_sqrt_s),
            )
        )
        noise = np.random.default_rng(seed).standard_normal((len(times_s), 3, 6))
        steps_s = np.diff(times_s, prepend=0.0)
        errors, kept, walked = np.empty((len(times_s), 6)), noise[0, 1], np.zeros(6)
        for frame, (now, step_s) in enumerate(zip(noise, steps_s, strict=True)):
            if frame:
                fading = np.exp(-step_s / model.correlation_s)
                kept = fading * kept + np.sqrt(1 - fading**2) * now[1]
            walked = walked + np.sqrt(step_s) * now[2]
            errors[frame] = white * now[0] + correlated * kept + walk * walked
        variances = white**2 + correlated**2 + walk**2 * times_s[:, None]
        return cls(path, times_s, model.delay_s, errors, variances)

    def rows(self, start: int, stop: int) -> Poses:
        """Poses of frames `start` to `stop`, exclusive."""
        times_s = self.times_s[start:stop]
        poses = [self.path.pose(max(time_s - self.delay_s, 0.0)) for time_s in times_s]
        errors = self.errors[start:stop]
        turns = Rotation.from_matrix(np.array([pose[:3, :3] for pose in poses]))
        return Poses(
            time_s=times_s,
            position_m=np.array([pose[:3, 3] for pose in poses]) + errors[:, :3],
            orientation=(turns * Rotation.from_rotvec(errors[:, 3:])).as_quat(),
            covariance=self.variances[start:stop, :, None] * np.eye(6),
        )

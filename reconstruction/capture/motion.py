"""Poses of a flight as the frames state them, and what lies between two of them.

The error of a stated pose is taken to be correlated over `CORRELATION_S`, as an autopilot's
estimate is: two poses close in time share most of it.
"""

from typing import NamedTuple

import numpy as np

from ..base.arrays import Floats
from .poses import Poses

CORRELATION_S = 0.3
USUAL_SIGMA_M, USUAL_SIGMA_RAD = 0.02, np.radians(0.3)
"""Errors of poses that state none."""
MAX_SPEED_M_S, MAX_SPIN_RAD_S = 50.0, 30.0
"""Motion beyond which a pose is a jump: another origin, or a failure of the estimate."""
MIN_STEP_S = 0.1
"""Time within which a jump is judged as if that had passed, as poses have errors."""
MAX_GAP_S = 5.0
"""Time without a pose after which the flight begins anew."""


class PoseAt(NamedTuple):
    """A pose: ``axes`` (3, 3) turn the optical frame into the world; variances are per axis."""

    time_s: float
    position_m: Floats
    axes: Floats
    variance_m2: float
    variance_rad2: float

    def since(
        self, time_s: Floats, variance_m2: Floats, variance_rad2: Floats
    ) -> tuple[Floats, Floats]:
        """Variances of position and rotation between this pose and earlier ones (N,)."""
        apart = 1 - np.exp(-np.abs(self.time_s - time_s) / CORRELATION_S)
        return (
            apart * (variance_m2 + self.variance_m2),
            apart * (variance_rad2 + self.variance_rad2),
        )


def pose_at(poses: Poses | None, row: int = 0) -> PoseAt | None:
    """Pose of a frame; None without one."""
    if poses is None or not poses.known[row]:
        return None
    from scipy.spatial.transform import Rotation  # slow to load

    variances = np.diagonal(poses.covariance[row])
    metres2, rad2 = variances[:3].mean(), variances[3:].mean()
    return PoseAt(
        float(poses.time_s[row]),
        poses.position_m[row],
        Rotation.from_quat(poses.orientation[row]).as_matrix(),
        float(metres2) if np.isfinite(metres2) else USUAL_SIGMA_M**2,
        float(rad2) if np.isfinite(rad2) else float(USUAL_SIGMA_RAD**2),
    )


def break_between(before: PoseAt, pose: PoseAt) -> str | None:
    """Why a pose does not follow another one, None if it does."""
    step_s = pose.time_s - before.time_s
    if step_s <= 0:
        return f"time {pose.time_s:.6g} s is not after {before.time_s:.6g} s, of the frame before"
    if step_s > MAX_GAP_S:
        return f"{step_s:.3g} s without a pose"
    moved_m = float(np.linalg.norm(pose.position_m - before.position_m))
    turned_rad = np.arccos(np.clip(((before.axes * pose.axes).sum() - 1) / 2, -1, 1))
    allowed_s = max(step_s, MIN_STEP_S)
    if moved_m > MAX_SPEED_M_S * allowed_s:
        return f"the position jumps by {moved_m:.3g} m in {step_s:.3g} s"
    if turned_rad > MAX_SPIN_RAD_S * allowed_s:
        return f"the attitude jumps by {np.degrees(turned_rad):.3g}° in {step_s:.3g} s"
    return None

"""Poses of the instrument during a flight, one for each frame, or none."""

from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import InputError
from .schema import FRAMES, Stored

UNIT_TOLERANCE = 0.01
"""Tolerance of a quaternion's length, for rounding."""
COVARIANCE_TOLERANCE = 1e-3
"""Tolerance of a correlation, for rounding."""


@dataclass(frozen=True, eq=False)
class Poses:
    """Pose at the middle of each frame, as the rig states it.

    A frame without a pose has nan for position and orientation.

    Parameters
    ----------
    time_s
        Times (frames,), rising; nan may stand for one without a pose.
    position_m
        Positions (frames, 3) of the projector's pinhole in the world.
    orientation
        Unit quaternions (frames, 4), x, y, z, w, that turn the optical frame into the world.
    covariance
        Covariance (frames, 6, 6) of position in the world's axes, m, and rotation vector in the
        optical axes, rad; nan if unknown.
    """

    time_s: Annotated[Floats, Stored("s", (FRAMES,), nan=True)]
    position_m: Annotated[Floats, Stored("m", (FRAMES, 3), nan=True)]
    orientation: Annotated[Floats, Stored("1", (FRAMES, 4), nan=True)]
    covariance: Annotated[Floats, Stored("1", (FRAMES, 6, 6), nan=True)]

    @classmethod
    def none(cls, frames: int) -> Self:
        """Frames without a pose."""
        shapes = ((), (3,), (4,), (6, 6))
        return cls(*(np.full((frames, *shape), np.nan) for shape in shapes))

    @property
    def known(self) -> NDArray[np.bool_]:
        """Mask (frames,) of frames with a pose."""
        return np.asarray(np.isfinite(self.orientation).all(axis=1))

    def check(self) -> None:
        """Raise InputError unless times rise, quaternions have length 1 and variances are valid."""
        missing = np.isnan(np.column_stack([self.position_m, self.orientation]))
        partial = missing.any(axis=1) & ~missing.all(axis=1) | self.known & np.isnan(self.time_s)
        if partial.any():
            raise InputError(
                f"poses of frame {np.flatnonzero(partial)[0]} are nan in part; a frame without a "
                "pose has nan for all of position_m and orientation, others for none and a time_s"
            )
        timed = np.flatnonzero(np.isfinite(self.time_s))
        late = np.flatnonzero(np.diff(self.time_s[timed]) <= 0)
        if late.size:
            before, after = timed[late[0] : late[0] + 2]
            raise InputError(
                f"poses/time_s of frame {after} is {self.time_s[after]:g}, must be later than that "
                f"of the last frame with one before, {self.time_s[before]:g}"
            )
        lengths = np.linalg.norm(self.orientation, axis=1)
        wrong = np.flatnonzero(np.abs(lengths - 1) > UNIT_TOLERANCE)
        if wrong.size:
            raise InputError(
                f"poses/orientation of frame {wrong[0]} has length {lengths[wrong[0]]:.4g}, must "
                "be a quaternion of length 1"
            )
        check_covariances("poses/covariance", self.covariance)


def check_covariances(name: str, covariances: Floats) -> None:
    """Raise InputError unless matrices (..., 6, 6) are symmetric and not negative, nan aside."""
    variances = np.diagonal(covariances, axis1=-2, axis2=-1)
    if (variances < 0).any():
        raise InputError(f"{name} has a variance of {np.nanmin(variances):g}; must be 0 or more")
    sigmas = np.sqrt(variances)
    scale = sigmas[..., :, None] * sigmas[..., None, :]
    turned = np.swapaxes(covariances, -1, -2)
    if (np.abs(covariances - turned) > COVARIANCE_TOLERANCE * scale).any():
        raise InputError(f"{name} differs from its transpose; must be symmetric")
    known = np.isfinite(covariances).all(axis=(-2, -1))
    with np.errstate(invalid="ignore", divide="ignore"):
        correlations = np.where(scale > 0, covariances / scale, covariances)[known]
    if (least := np.linalg.eigvalsh(correlations).min(initial=0.0)) < -6 * COVARIANCE_TOLERANCE:
        raise InputError(
            f"{name} has correlations with an eigenvalue of {least:.3g}; must be 0 or more"
        )

"""Poses of the instrument during a flight, one for each frame."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from ..base.arrays import Floats
from ..base.errors import InputError
from .schema import FRAMES, Stored

UNIT_TOLERANCE = 0.01
"""Tolerance of a quaternion's length, for rounding."""


@dataclass(frozen=True, eq=False)
class Poses:
    """Pose at the middle of each frame, as the rig states it.

    Parameters
    ----------
    time_s
        Times (frames,), rising.
    position_m
        Positions (frames, 3) of the projector's pinhole in the world.
    orientation
        Unit quaternions (frames, 4), x, y, z, w, that turn the optical frame into the world.
    covariance
        Covariance (frames, 6, 6) of position in the world's axes, m, and rotation vector in the
        optical axes, rad; nan if unknown.
    """

    time_s: Annotated[Floats, Stored("s", (FRAMES,))]
    position_m: Annotated[Floats, Stored("m", (FRAMES, 3))]
    orientation: Annotated[Floats, Stored("1", (FRAMES, 4))]
    covariance: Annotated[Floats, Stored("1", (FRAMES, 6, 6), nan=True)]

    def check(self) -> None:
        """Raise InputError unless times rise, quaternions have length 1 and variances are valid."""
        late = np.flatnonzero(np.diff(self.time_s) <= 0)
        if late.size:
            before, after = self.time_s[late[0] : late[0] + 2]
            raise InputError(
                f"poses/time_s of frame {late[0] + 1} is {after:g}, must be later than that of the "
                f"frame before, {before:g}"
            )
        lengths = np.linalg.norm(self.orientation, axis=1)
        wrong = np.flatnonzero(np.abs(lengths - 1) > UNIT_TOLERANCE)
        if wrong.size:
            raise InputError(
                f"poses/orientation of frame {wrong[0]} has length {lengths[wrong[0]]:.4g}, must "
                "be a quaternion of length 1"
            )
        variances = np.diagonal(self.covariance, axis1=1, axis2=2)
        if (variances < 0).any():
            raise InputError(
                f"poses/covariance has a variance of {np.nanmin(variances):g}; must be 0 or more"
            )

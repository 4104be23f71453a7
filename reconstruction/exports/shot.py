"""A frame as export formats need it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import InputError
from ..capture import Optics, Setup, Spots
from ..depth import pixel_rays
from ..ranging import Ranges
from ..result import Result


class Intrinsics(NamedTuple):
    """Pinhole camera in pixels; (0, 0) is the centre of the first, as in OpenCV."""

    fx: float
    fy: float
    cx: float
    cy: float

    @classmethod
    def of(cls, optics: Optics, shape: tuple[int, int]) -> Self:
        """Intrinsics of the projector, treated as a camera of ``shape`` (rows, columns)."""
        height, width = shape
        return cls(
            fx=width / (2 * optics.tan_half_width),
            fy=height / (2 * optics.tan_half_height),
            cx=(width - 1) / 2,
            cy=(height - 1) / 2,
        )

    @property
    def matrix(self) -> Floats:
        """Matrix (3, 3) from directions to pixels (column, row, 1)."""
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1.0]])


@dataclass(frozen=True, eq=False)
class Shot:
    """A frame with its image, depth and pose.

    ``image`` (H, W) in any unit; ``depth_m`` (H, W) along the optical axis, nan if unknown;
    ``stamp_ns`` of any clock; ``pose`` (4, 4) takes the optical frame (x right, y down, z forward)
    to the world (z up), None if unknown. ``ranges`` belong to the ``spots`` of time of flight.
    """

    stamp_ns: int
    image: NDArray[np.float32]
    depth_m: NDArray[np.float32] | None
    optics: Optics | None
    pose: Floats | None = None
    ranges: Ranges | None = None
    spots: Spots | None = None
    warnings: Sequence[str] = ()

    @classmethod
    def of(cls, result: Result, setup: Setup, stamp_ns: int, pose: Floats | None = None) -> Self:
        """Shot of the default methods of a result."""
        return cls(
            stamp_ns=stamp_ns,
            image=result.image,
            depth_m=result.depth_m,
            optics=setup.optics,
            pose=pose,
            ranges=result.ranges,
            spots=result.aimed(setup).spots,
            warnings=result.warnings,
        )

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        height, width = self.image.shape
        return height, width

    @property
    def stamp_s(self) -> float:
        """Time stamp in seconds."""
        return self.stamp_ns / 1e9

    @property
    def intrinsics(self) -> Intrinsics:
        """Intrinsics of the projector; raises InputError if unknown."""
        return Intrinsics.of(self.complete_optics, self.shape)

    @property
    def complete_optics(self) -> Optics:
        """The optics; raises InputError if unknown."""
        if self.optics is None:
            raise InputError("the capture states no optics, which the camera model needs")
        return self.optics

    @property
    def points_m(self) -> Floats:
        """Points (H, W, 3) in the optical frame, nan without depth."""
        depth_m: NDArray[Any] = np.full(self.shape, np.nan)
        if self.depth_m is not None:
            depth_m = self.depth_m
        return np.asarray(pixel_rays(self.complete_optics, self.shape) * depth_m[..., None])

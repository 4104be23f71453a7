"""True quantities of a simulation; only evaluation reads them."""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import InputError
from .schema import TRUTHS, Stored
from .spots import SPOTS_AXIS, UNKNOWN

Image = NDArray[np.float32]

TRUE_MAP = (TRUTHS, "height", "width")


@dataclass(frozen=True, eq=False)
class FrameTruth:
    """True quantities of one simulated frame; nan where nothing is hit.

    ``image`` (H, W) is the electrons per exposure that each virtual pixel alone, fully on,
    contributes, ``image_error`` the standard error of the light transport; ``spot_range_m``
    (spots,) is nan where a laser hits nothing. ``corridor_m`` is the distance along the optical
    axis to the first surface in the corridor ahead (`reconstruction.depth.Corridor`), nan for none.
    The pose, ``position_m`` (3,) and ``orientation`` (4,), is as in `Poses`.
    """

    image: Image
    image_error: Image
    range_m: Image
    depth_m: Image
    reflectance: Image
    spot_range_m: Floats
    corridor_m: float = np.nan
    position_m: Floats = field(default_factory=lambda: np.full(3, np.nan))
    orientation: Floats = field(default_factory=lambda: np.full(4, np.nan))


@dataclass(frozen=True, eq=False)
class Truth:
    """True quantities of simulated frames; only evaluation reads them.

    ``frame`` (T,) are the frame numbers of the other fields, (T, ...) as in `FrameTruth`. With
    ``still`` nothing moves, and a single truth holds for every frame.
    """

    frame: Annotated[NDArray[np.int64], Stored("1", (TRUTHS,), "int64", sign="not negative")]
    still: Annotated[bool, Stored("1", dtype="bool")]
    image: Annotated[Image, Stored("electron", TRUE_MAP, "float32", nan=True)]
    image_error: Annotated[Image, Stored("electron", TRUE_MAP, "float32", nan=True)]
    range_m: Annotated[Image, Stored("m", TRUE_MAP, "float32", "not negative", nan=True)]
    depth_m: Annotated[Image, Stored("m", TRUE_MAP, "float32", "not negative", nan=True)]
    reflectance: Annotated[Image, Stored("1", TRUE_MAP, "float32", "not negative", nan=True)]
    spot_range_m: Annotated[
        Floats, Stored("m", (TRUTHS, SPOTS_AXIS), sign="not negative", nan=True)
    ]
    corridor_m: Annotated[Floats, Stored("m", (TRUTHS,), sign="not negative", nan=True)] = UNKNOWN
    position_m: Annotated[Floats, Stored("m", (TRUTHS, 3), nan=True)] = UNKNOWN
    orientation: Annotated[Floats, Stored("1", (TRUTHS, 4), nan=True)] = UNKNOWN

    def __post_init__(self) -> None:
        for name, shape in (("corridor_m", ()), ("position_m", (3,)), ("orientation", (4,))):
            if np.ndim(getattr(self, name)) == 0:
                object.__setattr__(self, name, np.full((len(self.frame), *shape), np.nan))

    @classmethod
    def of(cls, frames: Sequence[FrameTruth], *, still: bool = False) -> Self:
        """Stack the truth of the first frames; with ``still``, of one that holds for all."""
        names = [field.name for field in fields(FrameTruth)]
        stacked = {name: np.stack([getattr(each, name) for each in frames]) for name in names}
        return cls(np.arange(len(frames)), still, **stacked)

    def knows(self, frame: int) -> bool:
        """Whether the truth of a frame is known."""
        return bool(self._indices(frame).size)

    def at(self, frame: int) -> FrameTruth:
        """Truth of one frame; raises InputError if it is unknown."""
        indices = self._indices(frame)
        if not indices.size:
            available = ", ".join(map(str, self.frame.tolist()))
            raise InputError(
                f"frame {frame} has no truth; the capture holds that of frames {available}"
            )
        names = (field.name for field in fields(FrameTruth))
        return FrameTruth(**{name: getattr(self, name)[indices[0]] for name in names})

    def _indices(self, frame: int) -> NDArray[np.intp]:
        return np.flatnonzero((self.frame == frame) | self.still)

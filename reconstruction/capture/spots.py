"""Time-of-flight readings of the four laser spots: what all methods of measuring share.

The lasers leave from the projector's pinhole; L is the whole optical path from there over the spot
to the detector.
"""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..errors import InputError
from .schema import Stored


@dataclass(frozen=True, eq=False)
class Spots:
    """What all methods share: unit vectors from the pinhole to the spots, and their detectors."""

    method: ClassVar[str]

    directions: Annotated[Floats, Stored("1", (4, 3))]
    detector_positions_m: Annotated[Floats, Stored("m", (4, 3))]

    @property
    def readings(self) -> NDArray[Any]:
        """What the detectors have recorded, frames first."""
        raise NotImplementedError

    @property
    def summary(self) -> str:
        """How they were measured, in a few words."""
        return f"{self.method}, {self.readings.shape[-1]} readings of each spot"

    def check(self) -> None:
        """Raise InputError unless the numbers fit together."""
        lengths = np.linalg.norm(self.directions, axis=1)
        if np.abs(lengths - 1).max() > 1e-3 or self.directions[:, 2].min() <= 0:
            raise InputError(
                "spots/directions must be unit vectors that point forward (z > 0); "
                f"their lengths are {np.round(lengths, 4).tolist()}"
            )

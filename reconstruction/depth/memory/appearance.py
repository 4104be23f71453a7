"""Whether a place still looks as it did: the sign, in every pixel, that something moved there.

What the projector lights is as bright as its depth to the power of -2 while the camera moves, what
the sun or fog adds less than that. Images are coarse and noisy: a floor is added to what is
compared, and what an error of the pose makes of the image's slope is no change.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from ...base.arrays import Floats, Mask
from ..kriging import BRIGHT
from .maps import sampled

MIN_CHANGE = 0.35
"""Change of ln brightness, over a floor, that says that something else is there."""
FLOOR, FLOOR_SIGMAS = 0.1, 3.0
"""The floor, as a fraction of the image's bright parts, and at least in sigmas of its noise."""
SLOPE_SIGMAS = 2.0


@dataclass(frozen=True, eq=False)
class Appearance:
    """An image (H, W) of the projector's light, and the standard deviation of its pixels."""

    image: Floats
    sigma: float

    @classmethod
    def of(cls, image: Floats, before: Floats | None) -> Self:
        """An image whose noise is what differs from the one before, in half of the pixels."""
        differences = np.zeros(1) if before is None else np.abs(image - before)
        return cls(image, float(np.median(differences)))

    def at(self, pixel: Floats) -> Floats:
        """Brightness (N,) at pixels (N, 2), never below 0."""
        return np.maximum(sampled(self.image, pixel), 0)

    def differs(
        self,
        pixel: Floats,
        then: Floats,
        nearer: Floats | float = 1.0,
        pixel_variance: Floats | float = 0.0,
    ) -> Mask:
        """Which pixels (N, 2) are not as bright as what lay there ``then`` (N,).

        It was ``nearer`` by a factor. Of what is nan nothing is known.
        """
        floor = max(FLOOR * float(np.percentile(self.image, BRIGHT)), FLOOR_SIGMAS * self.sigma)
        floor = max(floor, np.finfo(float).tiny)
        log = np.log(np.maximum(self.image, 0) + floor)
        slope = np.hypot(*(sampled(each, pixel) for each in np.gradient(log)))
        allowed = MIN_CHANGE + SLOPE_SIGMAS * slope * np.sqrt(pixel_variance)
        now, as_lit = sampled(log, pixel), then * np.asarray(nearer) ** 2
        darker = np.log(np.minimum(then, as_lit) + floor) - now
        brighter = now - np.log(np.maximum(then, as_lit) + floor)
        return np.asarray(np.maximum(darker, brighter) > allowed)

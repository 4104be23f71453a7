"""Whether a place still looks as it did: the sign, in every pixel, that something moved there.

What the projector lights is as bright as its depth to the power of -2 while the camera moves, what
the sun or fog adds less than that. Images are coarse and noisy: a floor is added to what is
compared, and what an error of the pose makes of the image's slope is no change.
"""

from collections import deque
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...base.arrays import Floats, Mask
from ..kriging import BRIGHT
from .maps import sampled

MIN_CHANGE = 0.45
"""Change of ln brightness, over a floor, that says that something else is there."""
FLOOR, FLOOR_SIGMAS = 0.1, 4.0
"""The floor, as a fraction of the image's bright parts, and at least in sigmas of its noise."""
SLOPE_SIGMAS = 2.0
MEDIAN_SIGMAS = 0.6745
"""Median of the size of what is normal, in standard deviations."""
NOISE_FRAMES = 12
"""Frames over which the noise of images is compared: successive ones have much of it in common."""

GROWTH = 1.01
"""Factor by which the noise grows in a frame, at most."""


class Appearances:
    """Images (H, W) of successive frames, and what their noise is."""

    def __init__(self) -> None:
        self._images: deque[Floats] = deque(maxlen=NOISE_FRAMES)
        self._sigma = np.inf

    def take(self, image: Floats) -> "Appearance":
        """An image; its noise is what differs from an earlier one in half of the pixels.

        It grows slowly: what covers half of the view for a moment is no noise.
        """
        whole = len(self._images) == NOISE_FRAMES
        self._images.append(image)
        sigma = float(np.median(np.abs(image - self._images[0])) / MEDIAN_SIGMAS)
        self._sigma = min(sigma, GROWTH * self._sigma) if whole else sigma
        return Appearance(image, self._sigma)


@dataclass(frozen=True, eq=False)
class Appearance:
    """An image (H, W), and the standard deviation of its pixels."""

    image: Floats
    sigma: float

    @cached_property
    def _floor(self) -> float:
        bright = FLOOR * float(np.percentile(self.image, BRIGHT))
        return float(max(bright, FLOOR_SIGMAS * self.sigma, np.finfo(np.float64).tiny))

    @cached_property
    def _log(self) -> Floats:
        """Ln brightness over the floor."""
        return np.asarray(np.log(np.maximum(self.image, 0) + self._floor))

    @cached_property
    def _slope(self) -> Floats:
        """Its slope, per pixel."""
        axes = [axis for axis, side in enumerate(self._log.shape) if side > 1]
        slopes = (np.gradient(self._log, axis=axis) for axis in axes)
        return np.sqrt(sum((each**2 for each in slopes), np.zeros_like(self._log)))

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
        slope = sampled(self._slope, pixel) if np.any(pixel_variance) else 0.0
        allowed = MIN_CHANGE + SLOPE_SIGMAS * slope * np.sqrt(pixel_variance)
        now, as_lit = sampled(self._log, pixel), then * np.asarray(nearer) ** 2
        darker = np.log(np.minimum(then, as_lit) + self._floor) - now
        brighter = now - np.log(np.maximum(then, as_lit) + self._floor)
        return np.asarray(np.maximum(darker, brighter) > allowed)

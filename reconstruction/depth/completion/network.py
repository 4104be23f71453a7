"""Network that corrects the map that points have corrected.

It sees that map, what the points have changed, what is uncertain, the image, and around each pixel
the density of the points, their depths and how much they contradict each other. It says how far the
map is off, in standard deviations of the map, and how uncertain it is. It is trained on frames of
many worlds with points drawn as flights would have met them, by `tools/completion_network.py`.
"""

from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...base.arrays import Floats
from ...base.layers import Channels, Layers, load_weights
from ...capture import Optics
from ..kriging import BRIGHT
from ..method import DepthEstimate
from ..network import LAYER_AXES, LOG_SIGMA, evaluated
from ..network_input import log_brightness
from ..pixels import pixel_rays
from .correction import ROWS, Correction, fitted
from .points import Seen

WEIGHTS = Path(__file__).with_name("network.npz")
VERSION = 1
MAPS = 17
SCALES_PX = 1.2, 4.0
"""Standard deviations of the neighbourhoods of points, in pixels of a map of 64 rows."""
SURE = 0.05
"""Sigma of ln depth at which a point counts half."""
MIN_SIGMA = 0.01
FEW = 0.02
"""Density of points below which a neighbourhood fades."""
FARTHEST, OFF_PIXELS2 = 1.5, 4.0
"""Limits of differences of ln depth, and of the variance of a point's pixel."""


class CompletionInput(NamedTuple):
    """Maps (C, H, W) that the network sees, and the ln depth and sigma (H, W) that it corrects."""

    maps: Channels
    log_depth: Floats
    sigma: Floats


class CompletionNetwork:
    """The network for views of one camera.

    A part of what it says is taken, and sigma has a factor: those of flights not learned from.
    """

    def __init__(self, optics: Optics, shape: tuple[int, int]) -> None:
        self._rays, self._layers = pixel_rays(optics, shape), shipped()
        self._part, self._sigma_factor = (fitted()["network"][k] for k in ("part", "sigma_factor"))

    def __call__(
        self, brightness: Floats, estimate: DepthEstimate, correction: Correction
    ) -> tuple[Floats, Floats]:
        """Ln depth and its sigma, (H, W), of an ``estimate`` before its ``correction``."""
        inputs = completion_input(brightness, self._rays, estimate, correction)
        off, log_factor = self._part * evaluated(self._layers, inputs.maps).astype(np.float64)
        sigma = np.exp(np.clip(np.log(inputs.sigma) + log_factor, *LOG_SIGMA))
        return inputs.log_depth + inputs.sigma * off, self._sigma_factor * sigma


def brightness_of(image: Floats) -> Floats | None:
    """Ln brightness (H, W) over that of the bright parts of an image; None if these are dark."""
    bright = float(np.percentile(image, BRIGHT))
    return log_brightness(image, bright) if bright > 0 else None


def completion_input(
    brightness: Floats, rays: Floats, estimate: DepthEstimate, correction: Correction
) -> CompletionInput:
    """What the network sees: ln brightness (H, W), a map of all its pixels, its correction."""
    assert estimate.sigma is not None
    assert estimate.no_return is not None
    log_depth = np.log(estimate.depth_m) + correction.error
    sigma = np.maximum(estimate.sigma * np.sqrt(correction.remaining), MIN_SIGMA)
    mean = float(log_depth.mean())
    maps = [
        log_depth - mean,
        np.clip(correction.error, -FARTHEST, FARTHEST),
        np.log(estimate.sigma),
        np.log(sigma),
        brightness,
        estimate.no_return,
        4 * rays[..., 0],
        4 * rays[..., 1],
        *_neighbourhoods(log_depth - mean, correction, mean),
    ]
    return CompletionInput(np.array(maps, np.float32), log_depth, sigma)


def _neighbourhoods(relative: Floats, correction: Correction, mean: float) -> list[Floats]:
    """Of the points around each pixel of a map of ln depth over its ``mean``, at two scales.

    Density, mean difference from the map and spread; near ones' mean contradiction, and of a wider
    neighbourhood the mean size of contradictions and variance of the points' pixels.
    """
    points, shape = correction.points, relative.shape
    weight = SURE**2 / (SURE**2 + points.log_variance)
    depth, off = points.log_depth - mean, np.clip(correction.contradiction, -1, 1)
    pixel_variance = np.minimum(points.pixel_variance * (ROWS / shape[0]) ** 2, OFF_PIXELS2)
    near, wide = [off], [np.abs(off), pixel_variance]
    result = []
    for scale, of_scale in zip(SCALES_PX, (near, wide), strict=True):
        moments = weight * np.array([np.ones_like(depth), depth, depth**2, *of_scale])
        density, first, second, *others = _blurred(points, moments, scale * shape[0] / ROWS, shape)
        faded = density + FEW
        inside = density / faded
        usual = first / np.maximum(density, 1e-9)
        variance = np.maximum(second / np.maximum(density, 1e-9) - usual**2, 0) * inside
        result += [
            np.log1p(density),
            np.clip(first / faded - relative * inside, -FARTHEST, FARTHEST),
            np.minimum(np.sqrt(variance), FARTHEST),
            *(each / faded for each in others),
        ]
    return result


def _blurred(points: Seen, values: Floats, scale_px: float, shape: tuple[int, int]) -> Floats:
    """Sums (K, H, W) of values (K, n) of points about each pixel, by Gaussians."""
    down, along = (
        np.exp(((np.arange(side)[:, None] - pixel) ** 2 / (-2 * scale_px**2)).astype(np.float32))
        for side, pixel in zip(shape, points.pixel.T, strict=True)
    )
    return np.asarray((down * values.astype(np.float32)[:, None]) @ along.T)


@lru_cache(maxsize=1)
def shipped() -> Layers:
    """Layers of this package."""
    return Layers(load_weights(WEIGHTS, VERSION, LAYER_AXES))

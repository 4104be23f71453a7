"""Small network that predicts the error of an image and its uncertainty.

It works at half the resolution of the image, with the pixels of each square as channels (K. Zhang,
W. Zuo, L. Zhang, IEEE Trans. Image Process. 27, 4608 (2018)), goes down to a quarter and back once,
and is evaluated as matrix products.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.layers import (
    Channels,
    Layers,
    axes_of,
    channels_as_squares,
    filled,
    load_weights,
    positive,
    squares_as_channels,
)

VERSION = 1
"""Version of weights, inputs and layers that `load` accepts."""
MULTIPLE = 4
"""Sides are mirrored up to multiples of this."""
WIDE_LAYERS = 4
NOISE = 1e-3, 1e3
"""Limits of the noise over the contrast."""
FEATURES = (
    *("patterns over pixels", "noise over contrast", "sigma over contrast"),
    *("change by edges", "steepness", "peak over contrast"),
)
MIN_SIGMA = 1e-3
"""Minimum standard deviation, relative to the contrast."""


@dataclass(frozen=True, eq=False)
class NetworkInput:
    """Input of the network for one frame, without the DC coefficient.

    ``first`` and ``better`` (H, W) are estimates of the image, ``sigma`` (H, W) the standard
    deviation of the better one; ``fraction`` is the number of coefficients over pixels, ``noise``
    that of a coefficient of a row of length 1.
    """

    first: Floats
    better: Floats
    sigma: Floats
    fraction: float
    noise: float

    @property
    def contrast(self) -> float:
        """Estimated rms of the image."""
        return float(np.sqrt(np.mean(self.better**2) + np.mean(self.sigma**2)))

    def maps(self) -> Channels:
        """Input channels (3, H, W)."""
        contrast = self.contrast
        sigma = np.maximum(self.sigma, MIN_SIGMA * contrast)
        change = (self.better - self.first) / sigma
        return np.array([self.better / contrast, change, np.log(sigma / contrast)], np.float32)

    def numbers(self) -> Channels:
        """Inputs that are the same for all pixels, (2,)."""
        return np.log(np.array([self.fraction, self._relative_noise], np.float32))

    def features(self) -> Channels:
        """Values of `FEATURES`, which decide whether a frame is in distribution."""
        contrast = self.contrast
        change = np.sqrt(np.mean((self.better - self.first) ** 2) / np.mean(self.sigma**2))
        slopes = np.mean(np.diff(self.better, axis=0) ** 2)
        slopes += np.mean(np.diff(self.better, axis=1) ** 2)
        # Relative to the finest details that the patterns resolve.
        steepness = np.sqrt(slopes / self.fraction) / contrast
        peak = np.abs(self.better).max() / contrast
        unsure = np.sqrt(np.mean(self.sigma**2)) / contrast
        features = [self.fraction, self._relative_noise, unsure, change, steepness, peak]
        return np.array(features, np.float32)

    @property
    def _relative_noise(self) -> float:
        return float(np.clip(self.noise / self.contrast, *NOISE))


class Network:
    """Network trained by `tools/learned_network.py`: weights by layer, ``limits`` (2, features)."""

    def __init__(self, weights: dict[str, NDArray[Any]], limits: NDArray[Any]) -> None:
        self._limits, self._layers = limits, Layers(weights)

    def __call__(self, inputs: NetworkInput) -> tuple[Channels, Channels]:
        """Correction over standard deviation, and log factor of that deviation, (H, W) each."""
        maps = inputs.maps()
        height, width = maps.shape[1:]
        out = self._evaluated(filled(maps, MULTIPLE), inputs.numbers())
        return out[0, :height, :width], out[1, :height, :width]

    def out_of_distribution(self, inputs: NetworkInput) -> str | None:
        """First feature outside its training range, as a message; None if there is none."""
        limits = zip(FEATURES, inputs.features(), *self._limits, strict=True)
        for name, value, minimum, maximum in limits:
            if not minimum <= value <= maximum:
                return f"{name} = {value:.3g}, trained for {minimum:.3g} to {maximum:.3g}"
        return None

    def _evaluated(self, maps: Channels, numbers: Channels) -> Channels:
        half, layer = squares_as_channels(maps), self._layers
        features = positive(layer("enter", half, numbers))
        features = positive(layer("before", features))
        quarter = positive(layer("down", squares_as_channels(features)))
        quarter = layer.changed("wide", quarter, WIDE_LAYERS // 2)
        features = positive(features + channels_as_squares(layer("up", quarter)))
        return channels_as_squares(layer("leave", positive(layer("after", features))))


def load(file: Path) -> Network:
    """Network of a file; InputError if it has no weights, or those of another version."""
    weights = load_weights(file, VERSION, {"limits": 2} | axes_of(_LAYERS))
    return Network(weights, weights.pop("limits"))


_LAYERS = (
    *("enter", "before", "down", "up", "after", "leave"),
    *(f"wide.{number}" for number in range(WIDE_LAYERS)),
)

"""A small network that says what is wrong with an image, and how sure of it one may be.

It sees an image at half its resolution, the pixels of each square as channels (K. Zhang, W. Zuo, L.
Zhang, IEEE Trans. Image Process. 27, 4608 (2018)), goes once to a quarter and back, and is
evaluated as products of matrices.
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
"""Of weights, inputs and layers together: what `load` takes."""
MULTIPLE = 4
"""Sides of what is evaluated; others are mirrored up to one."""
WIDE_LAYERS = 4
NOISE = 1e-3, 1e3
"""Over the contrast: what lies farther is not told apart."""
FEATURES = (
    *("share of patterns", "noise over contrast", "deviation over contrast"),
    *("change by edges", "steepness", "peak over contrast"),
)
MIN_SIGMA = 1e-3
"""Of the contrast: what is surer than that is not told apart."""


@dataclass(frozen=True, eq=False)
class NetworkInput:
    """What the network sees of one frame, its level left out.

    ``first`` and ``better`` (H, W) are estimates of the image, ``sigma`` (H, W) that of the
    better one; ``fraction`` is the number of coefficients over that of pixels, ``noise`` that of a
    coefficient of a row of length 1.
    """

    first: Floats
    better: Floats
    sigma: Floats
    fraction: float
    noise: float

    @property
    def contrast(self) -> float:
        """Rms of the image, as far as it is known."""
        return float(np.sqrt(np.mean(self.better**2) + np.mean(self.sigma**2)))

    def maps(self) -> Channels:
        """Channels (3, H, W)."""
        contrast = self.contrast
        sigma = np.maximum(self.sigma, MIN_SIGMA * contrast)
        change = (self.better - self.first) / sigma
        return np.array([self.better / contrast, change, np.log(sigma / contrast)], np.float32)

    def numbers(self) -> Channels:
        """What is the same for all pixels (2,)."""
        return np.log(np.array([self.fraction, self._relative_noise], np.float32))

    def features(self) -> Channels:
        """What `FEATURES` names: by these a frame is like those learned from, or not."""
        contrast = self.contrast
        change = np.sqrt(np.mean((self.better - self.first) ** 2) / np.mean(self.sigma**2))
        slopes = np.mean(np.diff(self.better, axis=0) ** 2)
        slopes += np.mean(np.diff(self.better, axis=1) ** 2)
        # Of the finest details that so many patterns see.
        steepness = np.sqrt(slopes / self.fraction) / contrast
        peak = np.abs(self.better).max() / contrast
        unsure = np.sqrt(np.mean(self.sigma**2)) / contrast
        reported = [self.fraction, self._relative_noise, unsure, change, steepness, peak]
        return np.array(reported, np.float32)

    @property
    def _relative_noise(self) -> float:
        return float(np.clip(self.noise / self.contrast, *NOISE))


class Network:
    """What `tools/learned_network.py` trained: weights by the names of its layers.

    ``limits`` (2, features): the least and the most of each of the `FEATURES` that it saw.
    """

    def __init__(self, weights: dict[str, NDArray[Any]], limits: NDArray[Any]) -> None:
        self._limits, self._layers = limits, Layers(weights)

    def __call__(self, displayed: NetworkInput) -> tuple[Channels, Channels]:
        """Correction over deviation, and log of its deviation over the one shown, (H, W) each."""
        maps = displayed.maps()
        height, width = maps.shape[1:]
        out = self._evaluated(filled(maps, MULTIPLE), displayed.numbers())
        return out[0, :height, :width], out[1, :height, :width]

    def out_of_distribution(self, displayed: NetworkInput) -> str | None:
        """In what a frame is unlike all that the network has seen, in words; None if in nothing."""
        limits = zip(FEATURES, displayed.features(), *self._limits, strict=True)
        for name, value, minimum, maximum in limits:
            if not minimum <= value <= maximum:
                return f"{name} = {value:.3g}, learned from {minimum:.3g} to {maximum:.3g}"
        return None

    def _evaluated(self, maps: Channels, numbers: Channels) -> Channels:
        half, layer = squares_as_channels(maps), self._layers
        retained = positive(layer("enter", half, numbers))
        retained = positive(layer("before", retained))
        quarter = positive(layer("down", squares_as_channels(retained)))
        quarter = layer.changed("wide", quarter, WIDE_LAYERS // 2)
        retained = positive(retained + channels_as_squares(layer("up", quarter)))
        return channels_as_squares(layer("leave", positive(layer("after", retained))))


def load(file: Path) -> Network:
    """The network of a file; InputError where that holds none, or one of another version."""
    weights = load_weights(file, VERSION, {"limits": 2} | axes_of(_LAYERS))
    return Network(weights, weights.pop("limits"))


_LAYERS = (
    *("enter", "before", "down", "up", "after", "leave"),
    *(f"wide.{number}" for number in range(WIDE_LAYERS)),
)

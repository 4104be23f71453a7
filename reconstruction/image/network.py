"""A small network that says what is wrong with an image, and how sure of it one may be.

It sees an image at half its resolution, the pixels of each square as channels (K. Zhang, W. Zuo, L.
Zhang, IEEE Trans. Image Process. 27, 4608 (2018)), goes once to a quarter and back, and is evaluated
as products of matrices.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats

Channels = NDArray[np.float32]

MULTIPLE = 4
"""Sides of what is evaluated; others are mirrored up to one."""
WIDE_LAYERS = 4
LEAST_DEVIATION = 1e-3
"""Of the contrast: what is surer than that is not told apart."""


@dataclass(frozen=True, eq=False)
class Shown:
    """What the network sees of one frame, its level left out.

    ``first`` and ``better`` (H, W) are estimates of the image, ``deviation`` (H, W) that of the
    better one; ``share`` is the number of coefficients over that of pixels, ``noise`` that of a
    coefficient of a row of length 1.
    """

    first: Floats
    better: Floats
    deviation: Floats
    share: float
    noise: float

    @property
    def contrast(self) -> float:
        """Rms of the image, as far as it is known."""
        return float(np.sqrt(np.mean(self.better**2) + np.mean(self.deviation**2)))

    def maps(self) -> Channels:
        """Channels (3, H, W)."""
        contrast = self.contrast
        deviation = np.maximum(self.deviation, LEAST_DEVIATION * contrast)
        change = (self.better - self.first) / deviation
        return np.array([self.better / contrast, change, np.log(deviation / contrast)], np.float32)

    def numbers(self) -> Channels:
        """What is the same for all pixels (2,)."""
        noise = np.clip(self.noise / self.contrast, 1e-3, 1e3)
        return np.array([np.log(self.share), np.log(noise)], np.float32)


class Network:
    """What `tools/learned_network.py` trained: weights by the names of its layers."""

    def __init__(self, weights: dict[str, NDArray[np.generic]]) -> None:
        self._layers = {
            name.removesuffix(".weight"): (
                np.ascontiguousarray(_flat(weight.astype(np.float32))),
                weights[name.replace("weight", "bias")].astype(np.float32)[:, None],
            )
            for name, weight in weights.items()
            if name.endswith(".weight")
        }

    def __call__(self, shown: Shown) -> tuple[Channels, Channels]:
        """Correction over deviation, and log of its deviation over the one shown, (H, W) each."""
        maps = shown.maps()
        height, width = maps.shape[1:]
        fill = (-height % MULTIPLE, -width % MULTIPLE)
        if any(fill):
            maps = np.pad(maps, ((0, 0), (0, fill[0]), (0, fill[1])), mode="symmetric")
        out = self._evaluated(maps, shown.numbers())
        return out[0, :height, :width], out[1, :height, :width]

    def _evaluated(self, maps: Channels, numbers: Channels) -> Channels:
        half = _squares_as_channels(maps)
        constant = np.broadcast_to(numbers[:, None, None], (len(numbers), *half.shape[1:]))
        kept = _positive(self._layer("enter", np.concatenate([half, constant])))
        kept = _positive(self._layer("before", kept))
        quarter = _positive(self._layer("down", _squares_as_channels(kept)))
        for number in range(0, WIDE_LAYERS, 2):
            change = _positive(self._layer(f"wide.{number}", quarter))
            quarter = quarter + self._layer(f"wide.{number + 1}", change)
        kept = _positive(kept + _channels_as_squares(self._layer("up", quarter)))
        kept = _positive(self._layer("after", kept))
        return _channels_as_squares(self._layer("leave", kept))

    def _layer(self, name: str, channels: Channels) -> Channels:
        """A convolution (C, H, W), with zeros around it: of 3 x 3 pixels, or of each by itself."""
        weight, bias = self._layers[name]
        count, height, width = channels.shape
        if weight.shape[1] == count:
            out = weight @ channels.reshape(count, -1) + bias
            return out.reshape(-1, height, width)
        # As rows of the padded image follow each other, each of the nine shifts is a slice.
        padded = np.zeros((count, height + 2, width + 2), np.float32)
        padded[:, 1:-1, 1:-1] = channels
        flat = padded.reshape(count, -1)
        length = height * (width + 2) - 2
        starts = [down * (width + 2) + along for down in range(3) for along in range(3)]
        columns = np.concatenate([flat[:, start : start + length] for start in starts])
        out = np.empty((len(weight), height * (width + 2)), np.float32)
        out[:, :length] = weight @ columns + bias
        return out.reshape(-1, height, width + 2)[:, :, :width]


def _flat(weight: NDArray[np.float32]) -> NDArray[np.float32]:
    """Weights (out, in, 3, 3) or (out, in, 1, 1) as (out, shifts x in)."""
    return weight.transpose(0, 2, 3, 1).reshape(len(weight), -1)


def _positive(channels: Channels) -> Channels:
    return np.maximum(channels, 0)


def _squares_as_channels(channels: Channels) -> Channels:
    """(C, H, W) to (4 C, H / 2, W / 2)."""
    count, height, width = channels.shape
    squares = channels.reshape(count, height // 2, 2, width // 2, 2)
    return squares.transpose(0, 2, 4, 1, 3).reshape(4 * count, height // 2, width // 2)


def _channels_as_squares(channels: Channels) -> Channels:
    """(4 C, H, W) to (C, 2 H, 2 W)."""
    count, height, width = channels.shape
    squares = channels.reshape(count // 4, 2, 2, height, width)
    return squares.transpose(0, 3, 1, 4, 2).reshape(count // 4, 2 * height, 2 * width)

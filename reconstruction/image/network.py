"""A small network that says what is wrong with an image, and how sure of it one may be.

It sees an image at half its resolution, the pixels of each square as channels (K. Zhang, W. Zuo, L.
Zhang, IEEE Trans. Image Process. 27, 4608 (2018)), goes once to a quarter and back, and is
evaluated as products of matrices.
"""

import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..errors import InputError

Channels = NDArray[np.float32]

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
        return np.log(np.array([self.share, self._relative_noise], np.float32))

    def features(self) -> Channels:
        """What `FEATURES` names: by these a frame is like those learned from, or not."""
        contrast = self.contrast
        change = np.sqrt(np.mean((self.better - self.first) ** 2) / np.mean(self.deviation**2))
        slopes = np.mean(np.diff(self.better, axis=0) ** 2)
        slopes += np.mean(np.diff(self.better, axis=1) ** 2)
        # Of the finest details that so many patterns see.
        steepness = np.sqrt(slopes / self.share) / contrast
        peak = np.abs(self.better).max() / contrast
        unsure = np.sqrt(np.mean(self.deviation**2)) / contrast
        told = [self.share, self._relative_noise, unsure, change, steepness, peak]
        return np.array(told, np.float32)

    @property
    def _relative_noise(self) -> float:
        return float(np.clip(self.noise / self.contrast, *NOISE))


class Network:
    """What `tools/learned_network.py` trained: weights by the names of its layers.

    ``limits`` (2, features): the least and the most of each of the `FEATURES` that it saw.
    """

    def __init__(self, weights: dict[str, NDArray[Any]], limits: NDArray[Any]) -> None:
        self._limits = limits
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

    def unlike(self, shown: Shown) -> str | None:
        """In what a frame is unlike all that the network has seen, in words; None if in nothing."""
        limits = zip(FEATURES, shown.features(), *self._limits, strict=True)
        for name, value, least, most in limits:
            if not least <= value <= most:
                return f"{name} = {value:.3g}, learned from {least:.3g} to {most:.3g}"
        return None

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


def load(file: Path) -> Network:
    """The network of a file; InputError where that holds none, or one of another version."""
    try:
        with np.load(file, allow_pickle=False) as told:
            weights = dict(told)
    except (OSError, ValueError, zipfile.BadZipFile) as error:
        raise InputError(f"{file} holds no weights of a network: {error}") from None
    version = weights.pop("version", None)
    if version is None or version != VERSION:
        raise InputError(f"{file}: version of the weights = {version}, must be {VERSION}")
    missing = [name for name in _SHAPES if name not in weights]
    if missing:
        raise InputError(f"{file}: weights without {', '.join(missing)}")
    for name, axes in _SHAPES.items():
        values = weights[name]
        if values.dtype.kind != "f" or values.ndim != axes or not np.isfinite(values).all():
            raise InputError(f"{file}: {name} must be finite numbers along {axes} axes")
    return Network(weights, weights.pop("limits"))


_LAYERS = (
    *("enter", "before", "down", "up", "after", "leave"),
    *(f"wide.{number}" for number in range(WIDE_LAYERS)),
)
_SHAPES = (
    {"limits": 2}
    | {f"{layer}.weight": 4 for layer in _LAYERS}
    | {f"{layer}.bias": 1 for layer in _LAYERS}
)
"""What a file has, and along how many axes."""


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

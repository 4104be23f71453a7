"""Small network that predicts depth, its uncertainty and the probability of no return.

A U-net (O. Ronneberger, P. Fischer, T. Brox, MICCAI 2015) from half the resolution, with the pixels
of each square as channels, to an eighth, where 3 x 3 pixels cover a large part of the image. See
`inputs_of` for its input.
"""

from collections.abc import Mapping
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
from ..capture import Optics
from .network_input import NUMBERS, Inputs, NetworkInput, in_units
from .pixels import pixel_of

VERSION = 2
"""Version of weights, inputs and layers that `load` accepts."""
MULTIPLE = 8
"""Sides are mirrored up to multiples of this."""
MIDDLE_BLOCKS, DEEP_BLOCKS = 1, 2
LOG_SIGMA = -4.5, 1.0
"""Limits of the log standard deviation."""


@dataclass(frozen=True, eq=False)
class Prediction:
    """Output of the network, each (H, W): log depth, its sigma, probability of no return."""

    log_depth: Floats
    sigma: Floats
    no_return: Floats


class DepthNetwork:
    """Network trained by `tools/depth_network.py`: weights by layer, ``limits`` (2, features)."""

    def __init__(self, weights: dict[str, NDArray[Any]]) -> None:
        self._limits, self._calibration = weights["limits"], float(weights["calibration"][0])
        self._layers = Layers(weights)

    def __call__(self, inputs: Inputs) -> Prediction:
        """Prediction for one frame."""
        out = evaluated(self._layers, inputs.maps, inputs.numbers).astype(np.float64)
        log_sigma = np.clip(out[1], *LOG_SIGMA) + self._calibration
        start = inputs.start + logistic(out[3]) * (inputs.plain - inputs.start)
        return Prediction(start + out[0], np.exp(log_sigma), logistic(out[2]))

    def out_of_distribution(self, inputs: Inputs) -> str | None:
        """First feature of a frame outside its training range, as a message; None if all are in."""
        return self.outside(of_frame(inputs))

    def outside(self, values: Mapping[str, float]) -> str | None:
        """First of some `FEATURES` outside its training range, as a message; None if all are in."""
        for name, minimum, maximum in zip(FEATURES, *self._limits.tolist(), strict=True):
            if name in values and not minimum <= values[name] <= maximum:
                value, *limits = (in_units(name, each) for each in (values[name], minimum, maximum))
                return f"{name} = {value}, trained for {' to '.join(limits)}"
        return None


def evaluated(layer: Layers, maps: Channels, numbers: Channels | None = None) -> Channels:
    """Output (D, H, W) of the U-net for maps (C, H, W) and numbers (N,)."""
    height, width = maps.shape[1:]
    half = squares_as_channels(filled(maps, MULTIPLE))
    features = positive(layer("enter", half, numbers))
    features = positive(layer("before", features))
    quarter = positive(layer("down", squares_as_channels(features)))
    quarter = layer.changed("middle", quarter, MIDDLE_BLOCKS)
    eighth = positive(layer("deeper", squares_as_channels(quarter)))
    eighth = layer.changed("deep", eighth, DEEP_BLOCKS)
    quarter = positive(quarter + channels_as_squares(layer("rise", eighth)))
    quarter = layer.changed("again", quarter, MIDDLE_BLOCKS)
    features = positive(features + channels_as_squares(layer("up", quarter)))
    out = channels_as_squares(layer("leave", positive(layer("after", features))))
    return out[:, :height, :width]


def logistic(values: Floats) -> Floats:
    """Probability of log odds."""
    return 0.5 + 0.5 * np.tanh(values / 2)


FEATURES = (
    *NUMBERS,
    *("half width", "half height", "rows", "columns", "spread of log brightness", "steepness"),
    *("farthest spot", "spots off a line"),
)
"""Features that decide whether a frame is in distribution."""


def features(frame: NetworkInput, inputs: Inputs) -> Channels:
    """Values of `FEATURES`."""
    rows, columns = frame.image.shape
    values = of_frame(inputs) | of_view((rows, columns), frame.optics, frame.directions)
    return np.array([values[name] for name in FEATURES], np.float32)


def of_frame(inputs: Inputs) -> dict[str, float]:
    """The `FEATURES` that vary from frame to frame."""
    bright = inputs.maps[0]
    down, along = bright[1:] - bright[:-1], bright[:, 1:] - bright[:, :-1]
    slopes = np.mean(down**2) + np.mean(along**2)
    values = dict(zip(NUMBERS, inputs.numbers.tolist(), strict=True))
    return values | {
        "spread of log brightness": float(bright.std()),
        "steepness": float(np.sqrt(slopes)),
    }


def of_view(shape: tuple[int, int], optics: Optics, directions: Floats) -> dict[str, float]:
    """The `FEATURES` of field of view, image size and positions of the spots."""
    positions = 2 * (pixel_of(directions, optics, shape) + 0.5) / np.array(shape) - 1
    extent = np.linalg.svd(positions - positions.mean(axis=0), compute_uv=False)
    return {
        "half width": optics.tan_half_width,
        "half height": optics.tan_half_height,
        "rows": shape[0],
        "columns": shape[1],
        "farthest spot": float(np.abs(positions).max()),
        "spots off a line": round(float(extent[1:].sum()), 9),
    }


def load(file: Path) -> DepthNetwork:
    """Network of a file; InputError if it has no weights, or those of another version."""
    return DepthNetwork(load_weights(file, VERSION, _AXES))


_PAIRS = {"middle": MIDDLE_BLOCKS, "deep": DEEP_BLOCKS, "again": MIDDLE_BLOCKS}
LAYER_AXES = axes_of(
    (
        *("enter", "before", "down", "deeper", "rise", "up", "after", "leave"),
        *(f"{name}.{number}" for name, blocks in _PAIRS.items() for number in range(2 * blocks)),
    )
)
"""Arrays of layers, and their numbers of axes."""
_AXES = {"limits": 2, "calibration": 1} | LAYER_AXES

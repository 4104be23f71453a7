"""A small network that says how deep a view is, how sure that is, and where there is nothing.

A U-net (O. Ronneberger, P. Fischer, T. Brox, MICCAI 2015) from half the resolution, the pixels of
each square as channels, to an eighth, where its 3 x 3 pixels see a good part of the image. See
`inputs_of` for what it is given.
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
"""Of weights, inputs and layers together: what `load` takes."""
MULTIPLE = 8
"""Sides of what is evaluated; others are mirrored up to one."""
MIDDLE_BLOCKS, DEEP_BLOCKS = 1, 2
LOG_SIGMA = -4.5, 1.0
"""What is surer or less sure is not told apart."""


@dataclass(frozen=True, eq=False)
class Prediction:
    """What the network says, each (H, W): log depth, its deviation, probability of nothing."""

    log_depth: Floats
    sigma: Floats
    no_return: Floats


class DepthNetwork:
    """What `tools/depth_network.py` trained: weights by the names of its layers.

    ``limits`` (2, features): the least and the most of each of the `FEATURES` that it saw;
    ``calibration`` (1,): log of what its deviations are to be multiplied by.
    """

    def __init__(self, weights: dict[str, NDArray[Any]]) -> None:
        self._limits, self._calibration = weights["limits"], float(weights["calibration"][0])
        self._layers = Layers(weights)

    def __call__(self, inputs: Inputs) -> Prediction:
        """What is told of a frame."""
        height, width = inputs.start.shape
        out = self._evaluated(filled(inputs.maps, MULTIPLE), inputs.numbers)
        out = out[:, :height, :width].astype(np.float64)
        log_sigma = np.clip(out[1], *LOG_SIGMA) + self._calibration
        start = inputs.start + logistic(out[3]) * (inputs.plain - inputs.start)
        return Prediction(start + out[0], np.exp(log_sigma), logistic(out[2]))

    def out_of_distribution(self, inputs: Inputs) -> str | None:
        """In what a frame is unlike all that the network has seen, in words; None if in nothing.

        `of_view` tells what its recording is unlike in.
        """
        return self.outside(of_frame(inputs))

    def outside(self, values: Mapping[str, float]) -> str | None:
        """The first of some `FEATURES` that is not as they were, in words; None if all are."""
        for name, minimum, maximum in zip(FEATURES, *self._limits.tolist(), strict=True):
            if name in values and not minimum <= values[name] <= maximum:
                value, *limits = (in_units(name, each) for each in (values[name], minimum, maximum))
                return f"{name} = {value}, learned from {' to '.join(limits)}"
        return None

    def _evaluated(self, maps: Channels, numbers: Channels) -> Channels:
        half, layer = squares_as_channels(maps), self._layers
        retained = positive(layer("enter", half, numbers))
        retained = positive(layer("before", retained))
        quarter = positive(layer("down", squares_as_channels(retained)))
        quarter = layer.changed("middle", quarter, MIDDLE_BLOCKS)
        eighth = positive(layer("deeper", squares_as_channels(quarter)))
        eighth = layer.changed("deep", eighth, DEEP_BLOCKS)
        quarter = positive(quarter + channels_as_squares(layer("rise", eighth)))
        quarter = layer.changed("again", quarter, MIDDLE_BLOCKS)
        retained = positive(retained + channels_as_squares(layer("up", quarter)))
        return channels_as_squares(layer("leave", positive(layer("after", retained))))


def logistic(values: Floats) -> Floats:
    """Of log odds the probability."""
    return 0.5 + 0.5 * np.tanh(values / 2)


FEATURES = (
    *NUMBERS,
    *("half width", "half height", "rows", "columns", "spread of log brightness", "steepness"),
    *("farthest spot", "spots off a line"),
)
"""By these a frame is like those learned from, or not."""


def features(frame: NetworkInput, inputs: Inputs) -> Channels:
    """What `FEATURES` names."""
    rows, columns = frame.image.shape
    values = of_frame(inputs) | of_view((rows, columns), frame.optics, frame.directions)
    return np.array([values[name] for name in FEATURES], np.float32)


def of_frame(inputs: Inputs) -> dict[str, float]:
    """The `FEATURES` that differ from frame to frame."""
    bright = inputs.maps[0]
    down, along = bright[1:] - bright[:-1], bright[:, 1:] - bright[:, :-1]
    slopes = np.mean(down**2) + np.mean(along**2)
    values = dict(zip(NUMBERS, inputs.numbers.tolist(), strict=True))
    return values | {
        "spread of log brightness": float(bright.std()),
        "steepness": float(np.sqrt(slopes)),
    }


def of_view(shape: tuple[int, int], optics: Optics, directions: Floats) -> dict[str, float]:
    """The `FEATURES` of field, size of the image and places of the spots."""
    positions = 2 * (pixel_of(directions, optics, shape) + 0.5) / np.array(shape) - 1
    extent = np.linalg.svd(positions - positions.mean(axis=0), compute_uv=False)
    return {
        "half width": optics.tan_half_width,
        "half height": optics.tan_half_height,
        "rows": shape[0],
        "columns": shape[1],
        "farthest spot": float(np.abs(positions).max()),
        "spots off a line": float(extent[1]),
    }


def load(file: Path) -> DepthNetwork:
    """The network of a file; InputError where that holds none, or one of another version."""
    return DepthNetwork(load_weights(file, VERSION, _AXES))


_PAIRS = {"middle": MIDDLE_BLOCKS, "deep": DEEP_BLOCKS, "again": MIDDLE_BLOCKS}
_AXES = {"limits": 2, "calibration": 1} | axes_of(
    (
        *("enter", "before", "down", "deeper", "rise", "up", "after", "leave"),
        *(f"{name}.{number}" for name, blocks in _PAIRS.items() for number in range(2 * blocks)),
    )
)
"""What a file has, and along how many axes."""

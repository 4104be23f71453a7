"""Layers of small networks, evaluated as matrix products, and files of their weights."""

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import InputError

Channels = NDArray[np.float32]


class Layers:
    """3 x 3 (zero-padded) and 1 x 1 convolutions, from ``<name>.weight`` and ``<name>.bias``."""

    def __init__(self, weights: Mapping[str, NDArray[Any]]) -> None:
        self._layers = {
            name.removesuffix(".weight"): (
                np.ascontiguousarray(weight.astype(np.float32).transpose(2, 0, 3, 1)),
                weights[name.replace("weight", "bias")].astype(np.float32)[:, None, None],
            )
            for name, weight in weights.items()
            if name.endswith(".weight")
        }

    def __call__(
        self, name: str, channels: Channels, constants: Channels | None = None
    ) -> Channels:
        """Convolution (D, H, W) of channels (C, H, W) and constant maps ``constants`` (N,)."""
        weight, bias = self._layers[name]  # (down, D, along, C + N)
        count, height, width = channels.shape
        down, out, along, _ = weight.shape
        if constants is not None:
            summed = weight[..., count:] @ constants
            weight = np.concatenate([weight[..., :count], summed[..., None]], axis=-1)
        if down == 1:
            result = weight.reshape(out, -1) @ channels.reshape(count, -1)
            return result.reshape(out, height, width) + bias
        # Shifts along rows are columns of one product; shifts down are its slices.
        shifted = np.zeros((along, weight.shape[-1], height + 2, width), np.float32)
        own = shifted[:, :count, 1:-1]
        own[0, :, :, 1:], own[1] = channels[..., :-1], channels
        own[2, :, :, :-1] = channels[..., 1:]
        if constants is not None:
            ones = shifted[:, count, 1:-1]
            ones[0, :, 1:], ones[1], ones[2, :, :-1] = 1, 1, 1
        rows = weight.reshape(down * out, -1) @ shifted.reshape(along * weight.shape[-1], -1)
        above, here, below = rows.reshape(down, out, height + 2, width)
        result = above[:, :-2] + here[:, 1:-1]
        result += below[:, 2:]
        result += bias
        return np.asarray(result)

    def changed(self, name: str, channels: Channels, blocks: int) -> Channels:
        """Residual blocks of two convolutions each, ``<name>.0`` and so on."""
        for number in range(0, 2 * blocks, 2):
            change = positive(self(f"{name}.{number}", channels))
            channels = channels + self(f"{name}.{number + 1}", change)
        return channels


def load_weights(
    file: Path, version: int, axes: Mapping[str, int]
) -> dict[str, NDArray[np.floating[Any]]]:
    """Arrays of a file by name, each with its number of ``axes``; InputError if they do not fit."""
    try:
        with np.load(file, allow_pickle=False) as archive:
            weights = dict(archive)
    except (OSError, ValueError, zipfile.BadZipFile) as error:
        raise InputError(f"{file} contains no network weights: {error}") from None
    stored = weights.pop("version", None)
    if stored is None or stored != version:
        raise InputError(f"{file}: version of the weights = {stored}, must be {version}")
    missing = [name for name in axes if name not in weights]
    if missing:
        raise InputError(f"{file}: missing weights {', '.join(missing)}")
    for name, count in axes.items():
        values = weights[name]
        if values.dtype.kind != "f" or values.ndim != count or not np.isfinite(values).all():
            raise InputError(f"{file}: {name} must be finite numbers with {count} axes")
    return weights


def axes_of(layers: tuple[str, ...]) -> dict[str, int]:
    """Numbers of axes of the weights and biases of layers."""
    return {f"{layer}.weight": 4 for layer in layers} | {f"{layer}.bias": 1 for layer in layers}


def filled(maps: Channels, multiple: int) -> Channels:
    """Maps (C, H, W), mirrored up to sides that are multiples."""
    height, width = maps.shape[1:]
    fill = (-height % multiple, -width % multiple)
    if not any(fill):
        return maps
    return np.pad(maps, ((0, 0), (0, fill[0]), (0, fill[1])), mode="symmetric")


def positive(channels: Channels) -> Channels:
    """Rectified channels, in place."""
    return np.maximum(channels, 0, out=channels)


def squares_as_channels(channels: Channels) -> Channels:
    """(C, H, W) to (4 C, H / 2, W / 2)."""
    count, height, width = channels.shape
    squares = channels.reshape(count, height // 2, 2, width // 2, 2)
    return squares.transpose(0, 2, 4, 1, 3).reshape(4 * count, height // 2, width // 2)


def channels_as_squares(channels: Channels) -> Channels:
    """(4 C, H, W) to (C, 2 H, 2 W)."""
    count, height, width = channels.shape
    squares = channels.reshape(count // 4, 2, 2, height, width)
    return squares.transpose(0, 3, 1, 4, 2).reshape(count // 4, 2 * height, 2 * width)

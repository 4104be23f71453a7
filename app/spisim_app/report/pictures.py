"""Arrays as images: colour scales, and pixels without interpolation."""

import base64
import io
from base64 import b64encode
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.image import imsave
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike, NDArray

from reconstruction.base.arrays import Floats
from reconstruction.base.files import mark, write_atomically
from reconstruction.capture import Setup
from reconstruction.outputs.pictures import NO_RETURN

from .units import Prefix

HORIZON = 10.0
"""Multiple of the first quartile of depth beyond which images do not resolve depth."""
MIN_APART = 11.0
"""Minimum distance between the numbers of a scale, in per cent."""


@dataclass(frozen=True)
class Scale:
    """A colour scale shared by several images.

    `meaning` is "probability", or "ln" of logarithms, if that says more than the unit.
    """

    low: float
    high: float
    colours: str
    unit: str
    exponent: float = 1.0
    meaning: str = ""

    def position(self, values: ArrayLike) -> Floats:
        """Return positions on the scale from 0 to 1; 0 for values that are not finite."""
        span = (self.high - self.low) or 1.0
        fraction = np.nan_to_num((np.asarray(values, float) - self.low) / span)
        return np.asarray(np.clip(fraction, 0, 1) ** self.exponent)

    def rgba(self, image: ArrayLike, no_return: ArrayLike | None = None) -> NDArray[np.uint8]:
        """Return the colours of an image, (H, W, 4); values that are not finite are transparent.

        They are pale blue if the probability of no return (H, W) is 0.5 or more.
        """
        rgba: NDArray[np.uint8] = colormaps[self.colours](self.position(image), bytes=True)
        unknown = ~np.isfinite(np.asarray(image, float))
        rgba[unknown, 3] = 0
        if no_return is not None:
            rgba[unknown & (np.asarray(no_return) >= 0.5)] = (*NO_RETURN, 255)
        return rgba

    def address(self, image: ArrayLike, no_return: ArrayLike | None = None) -> str:
        """Return an image as a data URL."""
        return png_address(self.rgba(image, no_return))

    @property
    def gradient(self) -> str:
        """The colours from low to high, as CSS."""
        stops = colormaps[self.colours](np.linspace(0, 1, 9), bytes=True)
        return ", ".join(f"rgb({r} {g} {b})" for r, g, b, _ in stops)

    @property
    def quantity(self) -> str:
        """The kind of number for pages: `meaning`, or else the unit."""
        return self.meaning or self.unit

    @property
    def prefix(self) -> Prefix:
        """The prefix of the numbers of the scale."""
        return Prefix.of([self.low, self.high], self.unit)

    @property
    def ticks(self) -> Iterator[tuple[str, float]]:
        """Yield round numbers on the scale in its prefix, and their positions in per cent."""
        last = -MIN_APART
        for value in MaxNLocator(5).tick_values(self.low, self.high):
            position = 100 * float(self.position(value))
            if self.low <= value <= self.high and position - last >= MIN_APART:
                last = position
                yield self.prefix.write(value), position


def intensity_scale(*images: ArrayLike, unit: str = "") -> Scale:
    """Return a grey scale from zero to the maximum, excluding a few pixels."""
    return Scale(0.0, _percentile(99.5, *images), "gray", unit)


def view_scale(view: ArrayLike) -> Scale:
    """Return a grey scale with perceptually even steps, as in photographs."""
    return Scale(0.0, _percentile(98, view), "gray", "", exponent=1 / 2.2)


def depth_scale(*images: ArrayLike) -> Scale:
    """Return a scale in metres on which near is bright; from 0 to 1 without any depth.

    Depths far beyond all near ones, such as the horizon, have the colour of the far end.
    """
    far_m = min(_percentile(99, *images), HORIZON * _percentile(25, *images))
    return Scale(_percentile(1, *images, default=0.0), far_m, "viridis_r", "m")


def error_scale(*images: ArrayLike) -> Scale:
    """Return a scale in metres: blue is too near, red is too far."""
    limit = _percentile(95, *map(np.abs, images))
    return Scale(-limit, limit, "RdBu_r", "m")


def sigma_scale(*images: ArrayLike) -> Scale:
    """Return a scale of standard deviations of ln depth; bright is certain."""
    return Scale(0.0, _percentile(99, *images), "viridis_r", "", meaning="ln")


def probability_scale() -> Scale:
    """Return a scale from 0, black, to 1, white."""
    return Scale(0.0, 1.0, "gray", "", meaning="probability")


def spot_marks(setup: Setup) -> list[tuple[int, float, float]]:
    """Return spots and their positions in the image in per cent, without those outside."""
    if setup.spots is None or setup.optics is None:
        return []
    x, y, z = setup.spots.directions.T
    across = 50 * (1 + x / z / setup.optics.tan_half_width)
    down = 50 * (1 + y / z / setup.optics.tan_half_height)
    return [
        (k, left, top)
        for k, (left, top) in enumerate(zip(across, down, strict=True))
        if 0 <= left <= 100 and 0 <= top <= 100
    ]


def show(axes: Axes, rgba: NDArray[np.uint8], shape: tuple[int, int] | None = None) -> None:
    """Draw a picture alone in its axes, stretched to the shape (rows, columns) of another."""
    height, width = rgba.shape[:2] if shape is None else shape
    axes.imshow(rgba, extent=(0, width, height, 0), interpolation="nearest")
    axes.set(xticks=[], yticks=[])
    axes.spines[:].set_visible(False)


def png_address(rgba: NDArray[np.uint8]) -> str:
    """Return colours (H, W, 4) as a data URL."""
    return data_address(_png(rgba), "image/png")


def data_address(content: bytes, kind: str) -> str:
    """Return a file as a data URL."""
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def write_png(path: str | Path, rgba: NDArray[np.uint8]) -> None:
    """Write colours (H, W, 4), whole or not at all. Raises OSError."""
    write_atomically(path, _png(rgba))


def _percentile(percent: float, *images: ArrayLike, default: float = 1.0) -> float:
    values = np.concatenate([[], *(np.ravel(np.asarray(image, float)) for image in images)])
    finite = values[np.isfinite(values)]
    return float(np.percentile(finite, percent)) if finite.size else default


def _png(rgba: NDArray[np.uint8]) -> bytes:
    buffer = io.BytesIO()
    imsave(buffer, rgba, format="png", metadata={"Software": mark("picture")})
    return buffer.getvalue()


UNKNOWN = 65535
"""Code of values that are not finite; the others are even steps from minimum to maximum."""


def packed(values: ArrayLike) -> dict[str, object]:
    """Encode a map (H, W) as 16-bit steps in base64, with the first value and the step."""
    array = np.asarray(values, dtype=np.float64)
    finite = np.isfinite(array)
    low, high = (array[finite].min(), array[finite].max()) if finite.any() else (0.0, 1.0)
    step = (high - low) / (UNKNOWN - 1) or 1.0
    steps = np.full(array.shape, UNKNOWN, "<u2")
    steps[finite] = np.round((array[finite] - low) / step)
    return {
        "width": array.shape[1],
        "values": b64encode(steps.tobytes()).decode(),
        "low": float(f"{low:.7g}"),
        "step": float(f"{step:.7g}"),
    }

"""Arrays as pictures: scales of colour, and pixels that stay pixels."""

import base64
import io
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.image import imsave
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike, NDArray

from reconstruction import Capture
from reconstruction.base.arrays import Floats
from reconstruction.base.files import mark, write_atomically
from reconstruction.outputs.pictures import NO_RETURN

from .units import Prefix

HORIZON = 10.0
"""What is so many times farther than a quarter of all is not told apart in pictures."""
MIN_APART = 11.0
"""Per cent of a scale between its numbers, at least."""


@dataclass(frozen=True)
class Scale:
    """A colour scale that several pictures share.

    `meaning`: "probability", or "ln" of logarithms, where that tells more than the unit.
    """

    low: float
    high: float
    colours: str
    unit: str
    exponent: float = 1.0
    meaning: str = ""

    def position(self, values: ArrayLike) -> Floats:
        """Where values lie on the scale, from 0 to 1; what is not finite at 0."""
        span = (self.high - self.low) or 1.0
        fraction = np.nan_to_num((np.asarray(values, float) - self.low) / span)
        return np.asarray(np.clip(fraction, 0, 1) ** self.exponent)

    def rgba(self, image: ArrayLike, no_return: ArrayLike | None = None) -> NDArray[np.uint8]:
        """Colours of an image, (H, W, 4); what is not finite is transparent.

        But pale blue where `no_return` (H, W), the probability of nothing within reach, is 0.5 or
        more.
        """
        rgba: NDArray[np.uint8] = colormaps[self.colours](self.position(image), bytes=True)
        unknown = ~np.isfinite(np.asarray(image, float))
        rgba[unknown, 3] = 0
        if no_return is not None:
            rgba[unknown & (np.asarray(no_return) >= 0.5)] = (*NO_RETURN, 255)
        return rgba

    def address(self, image: ArrayLike, no_return: ArrayLike | None = None) -> str:
        """A picture of an image, to stand in a page."""
        return data_address(_png(self.rgba(image, no_return)), "image/png")

    @property
    def gradient(self) -> str:
        """The colours from low to high, as CSS."""
        stops = colormaps[self.colours](np.linspace(0, 1, 9), bytes=True)
        return ", ".join(f"rgb({r} {g} {b})" for r, g, b, _ in stops)

    @property
    def quantity(self) -> str:
        """What pages make of a number: `meaning`, or else the unit."""
        return self.meaning or self.unit

    @property
    def prefix(self) -> Prefix:
        """In which the numbers of the scale are written."""
        return Prefix.of([self.low, self.high], self.unit)

    @property
    def ticks(self) -> Iterator[tuple[str, float]]:
        """Round numbers on the scale in its prefix, and where they lie in per cent."""
        last = -MIN_APART
        for value in MaxNLocator(5).tick_values(self.low, self.high):
            position = 100 * float(self.position(value))
            if self.low <= value <= self.high and position - last >= MIN_APART:
                last = position
                yield self.prefix.write(value), position


def intensity_scale(*images: ArrayLike, unit: str = "") -> Scale:
    """Grey from zero to the brightest but for a few pixels."""
    return Scale(0.0, _percentile(99.5, *images), "gray", unit)


def view_scale(view: ArrayLike) -> Scale:
    """Grey that the eye sees in even steps, as photographs are shown."""
    return Scale(0.0, _percentile(98, view), "gray", "", exponent=1 / 2.2)


def depth_scale(*images: ArrayLike) -> Scale:
    """Near is bright, in metres; from 0 to 1 where there is no depth at all.

    What lies far behind all that is near, as a horizon does, is shown as the far end.
    """
    far_m = min(_percentile(99, *images), HORIZON * _percentile(25, *images))
    return Scale(_percentile(1, *images, default=0.0), far_m, "viridis_r", "m")


def error_scale(*images: ArrayLike) -> Scale:
    """Blue is too near, red is too far, in metres."""
    limit = _percentile(95, *map(np.abs, images))
    return Scale(-limit, limit, "RdBu_r", "m")


def sigma_scale(*images: ArrayLike) -> Scale:
    """Standard deviations of ln depth; bright is sure."""
    return Scale(0.0, _percentile(99, *images), "viridis_r", "", meaning="ln")


def probability_scale() -> Scale:
    """From black, 0, to white, 1."""
    return Scale(0.0, 1.0, "gray", "", meaning="probability")


def spot_marks(capture: Capture) -> list[tuple[int, float, float]]:
    """Spots, and where they lie in the image in per cent; those outside of it are left out."""
    if capture.spots is None or capture.optics is None:
        return []
    x, y, z = capture.spots.directions.T
    across = 50 * (1 + x / z / capture.optics.tan_half_width)
    down = 50 * (1 + y / z / capture.optics.tan_half_height)
    return [
        (k, left, top)
        for k, (left, top) in enumerate(zip(across, down, strict=True))
        if 0 <= left <= 100 and 0 <= top <= 100
    ]


def show(axes: Axes, image: ArrayLike, scale: Scale, shape: tuple[int, int] | None = None) -> None:
    """An image alone in its axes, stretched to the shape (rows, columns) of another."""
    height, width = np.shape(image) if shape is None else shape
    axes.imshow(scale.rgba(image), extent=(0, width, height, 0), interpolation="nearest")
    axes.set(xticks=[], yticks=[])
    axes.spines[:].set_visible(False)


def data_address(content: bytes, kind: str) -> str:
    """A file, to stand in a page."""
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def write_png(path: str | Path, rgba: NDArray[np.uint8]) -> None:
    """Write colours (H, W, 4), whole or not at all; raises OSError."""
    write_atomically(path, _png(rgba))


def _percentile(percent: float, *images: ArrayLike, default: float = 1.0) -> float:
    values = np.concatenate([[], *(np.ravel(np.asarray(image, float)) for image in images)])
    finite = values[np.isfinite(values)]
    return float(np.percentile(finite, percent)) if finite.size else default


def _png(rgba: NDArray[np.uint8]) -> bytes:
    buffer = io.BytesIO()
    imsave(buffer, rgba, format="png", metadata={"Software": mark("picture")})
    return buffer.getvalue()

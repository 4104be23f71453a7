"""Arrays as pictures in the page: pixels stay pixels, scales and words stay text."""

import base64
import io
from dataclasses import dataclass
from html import escape
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.image import imsave
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike, NDArray

from reconstruction import Capture
from reconstruction.files import write_atomically

Floats = NDArray[np.floating]


@dataclass(frozen=True)
class Scale:
    """A colour scale that several pictures share."""

    low: float
    high: float
    colours: str
    unit: str
    exponent: float = 1.0

    def position(self, values: ArrayLike) -> NDArray[np.float64]:
        """Where values lie on the scale, from 0 to 1; what is not finite at 0."""
        span = (self.high - self.low) or 1.0
        share = np.nan_to_num((np.asarray(values, float) - self.low) / span)
        return np.asarray(np.clip(share, 0, 1) ** self.exponent)

    def rgba(self, image: ArrayLike) -> NDArray[np.uint8]:
        """Colours of an image, (H, W, 4); what is not finite is transparent."""
        rgba: NDArray[np.uint8] = colormaps[self.colours](self.position(image), bytes=True)
        rgba[~np.isfinite(np.asarray(image, float)), 3] = 0
        return rgba


def intensity_scale(*images: ArrayLike | None, unit: str) -> Scale:
    """Grey from zero to the brightest but for a few pixels."""
    return Scale(0.0, _percentile(99.5, *images), "gray", unit)


def view_scale(view: ArrayLike) -> Scale:
    """Grey that the eye sees in even steps, as photographs are shown."""
    return Scale(0.0, _percentile(98, view), "gray", "", exponent=1 / 2.2)


def depth_scale(*images: ArrayLike | None) -> Scale:
    """Near is bright, in metres."""
    return Scale(_percentile(1, *images), _percentile(99, *images), "viridis_r", "m")


def error_scale(*images: ArrayLike | None) -> Scale:
    """Blue is too near, red is too far, in metres."""
    limit = _percentile(95, *(None if image is None else np.abs(image) for image in images))
    return Scale(-limit, limit, "RdBu_r", "m")


def figure(image: ArrayLike, scale: Scale, title: str, note: str = "", over: str = "") -> str:
    """A picture with its title; `over` is laid over it."""
    small = f"<small>{escape(note)}</small>" if note else ""
    return (
        f'<figure><div class="frame">'
        f'<img alt="{escape(title)}" src="{_png(scale.rgba(image))}">{over}</div>'
        f"<figcaption>{escape(title)}{small}</figcaption></figure>"
    )


def colour_bar(scale: Scale, meaning: str) -> str:
    """The scale as a bar with ticks."""
    stops = colormaps[scale.colours](np.linspace(0, 1, 9), bytes=True)
    gradient = ", ".join(f"rgb({r} {g} {b})" for r, g, b, _ in stops)
    ticks = "".join(
        f'<li style="left:{100 * scale.position(value):.1f}%">{value:g}</li>'
        for value in MaxNLocator(5).tick_values(scale.low, scale.high)
        if scale.low <= value <= scale.high
    )
    return (
        f'<div class="scale"><span>{escape(meaning)}</span><div>'
        f'<i style="background:linear-gradient(90deg, {gradient})"></i><ol>{ticks}</ol></div>'
        f"<span>{escape(scale.unit)}</span></div>"
    )


def spot_marks(capture: Capture) -> str:
    """Dots where the laser spots lie in the image; those outside of it are left out."""
    if capture.spots is None or capture.optics is None:
        return ""
    x, y, z = capture.spots.directions.T
    across = 50 * (1 + x / z / capture.optics.tan_half_width)
    down = 50 * (1 + y / z / capture.optics.tan_half_height)
    return "".join(
        f'<span class="spot" title="spot {k}" '
        f'style="left:{left:.2f}%;top:{top:.2f}%;--colour:var(--spot-{k})"></span>'
        for k, (left, top) in enumerate(zip(across, down, strict=True))
        if 0 <= left <= 100 and 0 <= top <= 100
    )


def _percentile(percent: float, *images: ArrayLike | None) -> float:
    values = np.concatenate([np.ravel(np.asarray(i, float)) for i in images if i is not None])
    finite = values[np.isfinite(values)]
    return float(np.percentile(finite, percent)) if finite.size else 1.0


def write_png(path: str | Path, rgba: NDArray[np.uint8]) -> None:
    """Write colours (H, W, 4), whole or not at all; raises OSError."""
    write_atomically(path, _png_bytes(rgba))


def _png(rgba: NDArray[np.uint8]) -> str:
    """The picture as a data address."""
    return "data:image/png;base64," + base64.b64encode(_png_bytes(rgba)).decode()


def _png_bytes(rgba: NDArray[np.uint8]) -> bytes:
    buffer = io.BytesIO()
    imsave(buffer, rgba, format="png")
    return buffer.getvalue()

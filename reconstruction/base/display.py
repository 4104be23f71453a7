"""Representations of objects: text, HTML for notebooks, and Matplotlib plots."""

from base64 import b64encode
from collections.abc import Iterable, Mapping
from html import escape
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .errors import InputError
from .png import png

WIDTH_PX = 220
"""Width of a picture."""
MAX_LINES, MAX_LETTERS = 10, 100
"""Limits of a text representation."""
SIDE_IN = 3.2
"""Side of a panel in inches."""


def text_summary(title: str, facts: Mapping[str, Any]) -> str:
    """Title and named facts, one per line, for `repr`."""
    lines = [title, *(f"  {name}: {value}" for name, value in facts.items())]
    if len(lines) > MAX_LINES:
        left = len(lines) - MAX_LINES + 1
        lines = [*lines[: MAX_LINES - 1], f"  and {left} more"]
    return "\n".join(_cut(" ".join(line.split("\n"))) for line in lines)


def _cut(line: str) -> str:
    return line if len(line) <= MAX_LETTERS else f"{line[: MAX_LETTERS - 1]}…"


def html_summary(title: str, facts: Mapping[str, Any], pictures: Iterable[str] = ()) -> str:
    """Title, named facts and pictures beside them, with all text escaped."""
    rows = "".join(
        f'<tr><th style="text-align:left">{escape(name)}</th>'
        f'<td style="text-align:left">{escape(str(value))}</td></tr>'
        for name, value in facts.items()
    )
    return (
        '<div style="display:flex;flex-wrap:wrap;gap:1em;align-items:flex-start">'
        f"<div><strong>{escape(title)}</strong><table>{rows}</table></div>{''.join(pictures)}</div>"
    )


def picture(values: ArrayLike, caption: str, unit: str) -> str:
    """Map (H, W) in grey from its 1st to its 99th percentile; unknown pixels are blue."""
    array = np.asarray(values, dtype=np.float64)
    finite = np.isfinite(array)
    low, high = np.percentile(array[finite], (1, 99)) if finite.any() else (0.0, 1.0)
    grey = np.clip((array - low) / max(high - low, 1e-300), 0, 1)
    levels = (255 * np.where(finite, grey, 0)).astype(np.uint8)
    colours = np.repeat(levels[..., None], 3, axis=-1)
    colours[~finite] = (70, 90, 140)
    address = b64encode(png(colours, "spisim")).decode()
    image = (
        f'<img src="data:image/png;base64,{address}" alt="{escape(caption)}" '
        f'style="width:{WIDTH_PX}px;image-rendering:pixelated">'
    )
    return figure(image, f"{caption}, {low:.3g} (black) to {high:.3g} {unit}")


def figure(content: str, caption: str) -> str:
    """Picture, SVG or other HTML, with a caption."""
    return (
        f'<figure style="margin:0;width:{WIDTH_PX}px">{content}<figcaption>{escape(caption)}'
        "</figcaption></figure>"
    )


def drawing(elements: Iterable[str], low: ArrayLike, high: ArrayLike) -> str:
    """SVG of these elements, in coordinates with corners low and high, (x, y), y up."""
    (left, bottom), (right, top) = np.asarray(low, float), np.asarray(high, float)
    width, height = max(right - left, 1e-9), max(top - bottom, 1e-9)
    return (
        f'<svg viewBox="{left:.6g} {-top:.6g} {width:.6g} {height:.6g}" width="{WIDTH_PX}" '
        f'height="{WIDTH_PX}" fill="none" stroke="currentColor" '
        'xmlns="http://www.w3.org/2000/svg">'
        f'<g transform="scale(1,-1)">{"".join(elements)}</g></svg>'
    )


def panels(count: int) -> Any:
    """Axes (count,) of a new figure; raises InputError without Matplotlib."""
    try:
        from matplotlib import pyplot
    except ModuleNotFoundError:
        raise InputError(
            "plots need Matplotlib: pip install 'spisim-reconstruction[window]', or matplotlib"
        ) from None
    size = (1.25 * SIDE_IN * count, SIDE_IN)
    _, axes = pyplot.subplots(1, count, figsize=size, squeeze=False, layout="constrained")
    return axes[0]


def draw_map(axes: Any, values: ArrayLike, title: str, unit: str, colours: str = "gray") -> None:
    """Map (H, W) from its 1st to its 99th percentile, with a bar; unknown pixels are white."""
    array = np.asarray(values, dtype=np.float64)
    finite = array[np.isfinite(array)]
    low, high = np.percentile(finite, (1, 99)) if finite.size else (0.0, 1.0)
    drawn = axes.imshow(array, cmap=colours, vmin=low, vmax=high, interpolation="nearest")
    axes.figure.colorbar(drawn, ax=axes, label=unit)
    axes.set(title=title, xticks=[], yticks=[])

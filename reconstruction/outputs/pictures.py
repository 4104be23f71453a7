"""Pictures of images and depth maps, as PNG."""

import base64
import zlib
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.files import mark
from ..base.png import png
from ..capture import Setup
from ..depth import pixel_of
from ..ranging import RANGED, Ranges
from .letters import HEIGHT, LETTERS, PACKED, WIDTHS
from .scale import GREY, VIRIDIS, Scale

SIDE = 512
"""Longer side to which an image is enlarged by a whole factor, unless it is larger."""
DOTTED_SIDE = 256
"""The same for pictures with dots."""
MIN_SIDE = 220
"""Minimum length of a colour scale."""
MARGIN, BAR, GAP = 16, 18, 8
"""Widths of margin, colour scale, and gaps."""
NUMBER_SPACING = 60
"""Approximate spacing of the numbers of a scale."""
CROSS = 6
"""Half the size of the cross on a spot."""
NO_DEPTH = 128
"""Grey of pixels without a depth."""

NO_RETURN = (198, 219, 239)
"""Pale blue of pixels without a depth where no return within range is likelier than one."""

Canvas = NDArray[np.uint8]


def image_picture(image: NDArray[np.float32], title: str, unit: str) -> bytes:
    """Grey image with its scale."""
    # Percentiles: single bright pixels must not dim the rest.
    low, high = (float(end) for end in np.percentile(image, (0.5, 99.5)))
    scale = Scale(low, _above(high, low, 1e-12), GREY)
    enlarged = _enlarged(scale.paint(image))
    return png(_framed(enlarged, title, scale, f"{unit}s per exposure"), mark("image"))


def depth_picture(
    depth_m: NDArray[np.float32],
    title: str,
    setup: Setup,
    ranges: Ranges | None,
    no_return: NDArray[np.float32] | None = None,
) -> bytes:
    """Depth map with its scale, and the spots with their depths.

    ``no_return`` (H, W) is the probability of no return within range.
    """
    finite = np.isfinite(depth_m)
    low, high = np.percentile(depth_m[finite], (1, 99)).tolist() if finite.any() else (0.0, 1.0)
    scale = Scale(low, _above(high, low, 1e-6), VIRIDIS)
    colours = np.full((*depth_m.shape, 3), NO_DEPTH, np.uint8)
    if no_return is not None:
        colours[no_return >= 0.5] = NO_RETURN
    colours[finite] = scale.paint(depth_m[finite])
    enlarged = _enlarged(colours)
    if ranges is not None:
        _mark_spots(enlarged, setup, ranges)
    return png(_framed(enlarged, title, scale, "depth along the optical axis / m"), mark("depth"))


def sigma_picture(sigma: NDArray[np.float32], title: str) -> bytes:
    """Standard deviations of ln depth with their scale."""
    finite = np.isfinite(sigma)
    high = float(np.percentile(sigma[finite], 99)) if finite.any() else 1.0
    scale = Scale(0.0, _above(high, 0.0, 1e-6), VIRIDIS)
    colours = np.full((*sigma.shape, 3), NO_DEPTH, np.uint8)
    colours[finite] = scale.paint(sigma[finite])
    label = "standard deviation of ln depth"
    return png(_framed(_enlarged(colours), title, scale, label), mark("depth deviation"))


def no_return_picture(no_return: NDArray[np.float32], title: str) -> bytes:
    """Probabilities of no return within range, from black to white."""
    scale = Scale(0.0, 1.0, GREY)
    enlarged = _enlarged(scale.paint(no_return))
    return png(_framed(enlarged, title, scale, "probability of nothing"), mark("nothing"))


def _above(high: float, low: float, minimum: float) -> float:
    """Upper end of a scale of non-zero length."""
    return max(high, low + max(minimum, 1e-6 * abs(low)))


def _enlarged(colours: Canvas) -> Canvas:
    factor = max(1, SIDE // max(colours.shape[:2]))
    return colours.repeat(factor, axis=0).repeat(factor, axis=1)


def _framed(picture: Canvas, title: str, scale: Scale, label: str) -> Canvas:
    """A picture on white, with a title above and its scale at the right."""
    height, width = picture.shape[:2]
    inner = max(height, MIN_SIDE)
    top, right = MARGIN + HEIGHT + GAP, MARGIN + width + 2 * GAP
    values, numbers, factor = scale.numbers(max(2, inner // NUMBER_SPACING))
    texts = [rendered_text(number) for number in numbers]
    name = np.rot90(rendered_text(f"{label} {factor}".strip()))
    column = right + BAR + GAP // 2 + max(text.shape[1] for text in texts) + GAP
    heading = rendered_text(title)
    size = (
        max(top + inner, top + name.shape[0]) + MARGIN,
        max(column + name.shape[1], MARGIN + heading.shape[1]) + MARGIN,
    )
    canvas = np.full((*size, 3), 255, np.uint8)
    _ink(canvas, heading, MARGIN // 2, MARGIN)
    above = top + (inner - height) // 2
    canvas[above : above + height, MARGIN : MARGIN + width] = picture
    bar = scale.paint(np.linspace(scale.high, scale.low, inner))
    canvas[top - 1 : top + inner + 1, right - 1 : right + BAR + 1] = 0
    canvas[top : top + inner, right : right + BAR] = bar[:, None]
    for value, text in zip(values, texts, strict=True):
        fraction = (scale.high - value) / (scale.high - scale.low)
        row = top + round(fraction * (inner - 1))
        canvas[row, right + BAR : right + BAR + GAP // 2] = 0
        _ink(canvas, text, row - HEIGHT // 2, right + BAR + GAP)
    _ink(canvas, name, top + max(0, (inner - name.shape[0]) // 2), column)
    return canvas


def _mark_spots(picture: Canvas, setup: Setup, ranges: Ranges) -> None:
    """Mark the spots with crosses, and with their depth or status."""
    assert setup.spots is not None
    if setup.optics is None:
        return
    shape = setup.plan.shape
    factor = picture.shape[0] / shape[0]
    anchors = (pixel_of(setup.spots.directions, setup.optics, shape) + 0.5) * factor
    depths = ranges.range_m * setup.spots.directions[:, 2]
    edge = np.array(picture.shape[:2]) - 1
    for position, depth_m, status in zip(anchors, depths, ranges.status, strict=True):
        row, column = np.clip(position, 0, edge).astype(int)
        draw_spot(picture, row, column, f"{depth_m:.2f} m" if status in RANGED else status)


def draw_spot(picture: Canvas, row: int, column: int, text: str) -> None:
    """Draw a white cross on black, with text beside it, white on half black."""
    for half_width, grey in ((1, 0), (0, 255)):
        for tall, wide in ((half_width, CROSS), (CROSS, half_width)):
            rows = slice(max(row - tall, 0), row + tall + 1)
            picture[rows, max(column - wide, 0) : column + wide + 1] = grey
    cover = rendered_text(text)
    height, width = cover.shape
    left = column + 2 * CROSS
    if left + width > picture.shape[1]:
        left = max(column - 2 * CROSS - width, 0)
    top = max(min(row - height // 2, picture.shape[0] - height), 0)
    picture[top : top + height, left : left + width] //= 2
    _ink(picture, cover, top, left, 255)


def dotted(colours: Canvas, pixels: Floats) -> Canvas:
    """A picture (H, W, C), enlarged by a whole factor, with white dots at pixels (N, 2)."""
    factor = max(1, DOTTED_SIDE // max(colours.shape[:2]))
    canvas = colours.repeat(factor, axis=0).repeat(factor, axis=1)
    for half, grey in ((2, 0), (1, 255)):
        for row, column in np.round((pixels + 0.5) * factor).astype(int):
            part = canvas[max(row - half, 0) : row + half, max(column - half, 0) : column + half]
            part[:] = (*(grey,) * 3, 255)[: colours.shape[2]]
    return canvas


def _ink(canvas: Canvas, cover: Floats, top: int, left: int, colour: int = 0) -> None:
    """Draw coverage in a grey, in place, clipped at the edges."""
    part = canvas[top : top + cover.shape[0], left : left + cover.shape[1]]
    fraction = cover[: part.shape[0], : part.shape[1], None]
    part[:] = np.round((1 - fraction) * part + fraction * colour).astype(np.uint8)


@cache
def _glyphs() -> dict[str, Floats]:
    packed = np.frombuffer(zlib.decompress(base64.b85decode(PACKED)), np.uint8)
    levels = np.stack([packed >> 4, packed & 15], axis=-1).reshape(HEIGHT, -1)
    ends = np.cumsum([int(width, 16) for width in WIDTHS])
    parts = np.split(levels[:, : ends[-1]] / 15, ends[:-1], axis=1)
    return dict(zip(LETTERS, parts, strict=True))


def rendered_text(text: str) -> Floats:
    """Coverage of each pixel by a line of text, 0..1: (HEIGHT, width)."""
    glyphs = _glyphs()
    return np.hstack([glyphs[" "][:, :0], *(glyphs.get(each, glyphs["?"]) for each in text)])

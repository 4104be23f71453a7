"""Lines of text as grey levels, of the letters in `letters`."""

import base64
import zlib
from functools import cache

import numpy as np

from ..base.arrays import Floats
from .letters import HEIGHT, LETTERS, PACKED, WIDTHS


@cache
def _glyphs() -> dict[str, Floats]:
    packed = np.frombuffer(zlib.decompress(base64.b85decode(PACKED)), np.uint8)
    levels = np.stack([packed >> 4, packed & 15], axis=-1).reshape(HEIGHT, -1)
    ends = np.cumsum([int(width, 16) for width in WIDTHS])
    parts = np.split(levels[:, : ends[-1]] / 15, ends[:-1], axis=1)
    return dict(zip(LETTERS, parts, strict=True))


def written(text: str) -> Floats:
    """How much of each pixel a line of text covers, 0..1: (HEIGHT, width)."""
    glyphs = _glyphs()
    return np.hstack([glyphs[" "][:, :0], *(glyphs.get(each, glyphs["?"]) for each in text)])

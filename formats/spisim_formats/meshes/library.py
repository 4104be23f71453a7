"""Materials of OBJ files (MTL): their colours, pictures of these, and what of them is opaque.

http://paulbourke.net/dataformats/mtl/
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import TypeAlias

from spisim.scene.mesh_files import COMMENT
from spisim_formats.library.content import Content, Surface
from spisim_formats.library.files import Folders, quoted
from spisim_formats.library.opacity import Opacity, cut, uniform
from spisim_formats.library.textures import Texture, read_channels

#: Options between `map_Kd` and the file name: words, or up to three numbers.
MAP_OPTIONS = re.compile(r"-(?:[a-z]+)(?:\s+(?:on|off|[rgbmlz]|[-+.\d]+(?:e[-+]?\d+)?(?=\s)))*\s+")

Color: TypeAlias = tuple[float, float, float]


@dataclass
class Described:
    """What a library says of a material; `opaque` is the fraction `d`, or 1 less `Tr`."""

    color: Color | None = None
    texture: Texture | None = None
    is_pictured: bool = False
    opaque: float | None = None
    transparency: float | None = None
    mask: Texture | None = None

    def surface(self, name: str, content: Content) -> Surface:
        """Return the surface; exporters leave Kd black or white if there is a texture."""
        color = None if self.is_pictured else self.color
        opacity = None
        if (self.opaque, self.transparency, self.mask) != (None, None, None):
            what = f"material {quoted(name)}: opacity"
            opacity = cache(partial(content.attempt, what, self._opacity))
        return Surface(name, color, texture=self.texture, opacity=opacity)

    def _opacity(self) -> Opacity | None:
        """A mask's opacity is its alpha where it has some, as of the picture of colours."""
        opaque = 1 - (self.transparency or 0.0) if self.opaque is None else self.opaque
        if self.mask is None:
            return uniform(opaque)
        grey, alpha = read_channels(self.mask, 0, 3)
        mask = alpha if alpha.min() < 1 else grey
        return cut(opaque * mask, fits=self.mask.fits)


def read_library(
    lines: Iterable[str], library: Path, folders: Folders, content: Content
) -> dict[str, Described]:
    """Return materials by name; notes name missing pictures."""
    materials: dict[str, Described] = {}
    current = Described()
    for words in (line.split(maxsplit=1) for line in lines):
        if len(words) < 2:
            continue
        value = words[1].strip()
        match words[0].lower():
            case "newmtl":
                current = materials[COMMENT.sub("", value).strip()] = Described()
            case "map_kd":
                current.is_pictured = True
                current.texture = _texture(value, library, folders, content) or current.texture
            case "map_d":
                current.mask = _texture(value, library, folders, content)
            case "kd" | "d" | "tr" as key:
                name, parsed = NUMBERS[key]
                if (number := parsed(value.removeprefix("-halo "))) is None:
                    content.note(f"{library.name}: not read: {quoted(' '.join(words))}")
                else:
                    setattr(current, name, number)
    return materials


def _texture(value: str, library: Path, folders: Folders, content: Content) -> Texture | None:
    name = MAP_OPTIONS.sub("", value).strip()
    result = content.texture(name, library.parent, folders, f"{library.name}: texture")
    return None if result is None else replace(result, fits=name == value)


def _fraction(text: str) -> float | None:
    try:
        value = float(text.split()[0])
    except (IndexError, ValueError):
        return None
    return value if 0 <= value <= 1 else None


def _color(text: str) -> Color | None:
    try:
        red, green, blue = (float(word) for word in text.split()[:3])
    except ValueError:
        return None
    return red, green, blue


#: Statements of numbers, by their fields.
NUMBERS: dict[str, tuple[str, Callable[[str], object]]] = {
    "kd": ("color", _color),
    "d": ("opaque", _fraction),
    "tr": ("transparency", _fraction),
}

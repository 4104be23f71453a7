"""Textures as reflectances at 1550 nm, by a rule of thumb.

The reflectance is `RULE` times the red value of the image as stored, from 0 to 1, with sRGB's
gamma. `tools/texture_rule.py` fits it to measured spectra. The uncertainty is large: a third of the
surfaces differ by more than 0.12. Red is nearest to 1550 nm and works better than grey.
"""

from __future__ import annotations

import io
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image

from reconstruction.base.errors import InputError
from spisim.base.config.linear import LINEAR
from spisim.scene.description import RectangleObject
from spisim.scene.shapes import texture_coordinates
from spisim_formats.library.files import quoted, read_bytes

RULE = 0.7
RULE_TEXT = f"{RULE:g} times its mean red, with sRGB's gamma"
#: Exponent that approximates sRGB's curve for linear images and factors.
GAMMA = 1 / 2.2
MAX_PIXELS = 2**26
#: Maximum pixels of an image written beside a scene file.
MAX_WRITTEN = 2**24
FORMATS = ("PNG", "JPEG", "BMP", "TGA", "WEBP", "DDS", "GIF", "TIFF", "PPM")

Use = Literal["mean", "picture", "off"]


@dataclass(frozen=True, eq=False)
class Texture:
    """An image in a file or in its bytes, and the red of a colour that multiplies it.

    `fits` tells whether the meshes' texture coordinates belong to it. `linear` images have no
    gamma.
    """

    name: str
    source: Path | bytes
    factor: float = 1.0
    fits: bool = True
    linear: bool = False

    @property
    def stem(self) -> str:
        """Its name without folder and suffix."""
        return Path(self.name.replace("\\", "/")).stem or "texture"


class Pictured:
    """Own materials of a scene file made from textures: their `rows`, and images beside it."""

    def __init__(self, use: Use) -> None:
        self.rows: dict[str, dict[str, Any]] = {}
        self.files: dict[str, NDArray[np.uint8]] = {}
        self.notes: list[str] = []
        self._use = use
        self._made: dict[tuple[object, float, bool], tuple[str, str] | None] = {}

    def material(self, texture: Texture, geometry: object) -> tuple[str, str] | None:
        """Return the name of a surface's material, and the reason; None if it has no texture."""
        if self._use == "off":
            return None
        whole = self._use == "picture" and texture.fits and has_coordinates(geometry)
        source = texture.source if isinstance(texture.source, Path) else id(texture.source)
        key = source, texture.factor, whole
        if key not in self._made:
            self._made[key] = self._make(texture, whole)
        return self._made[key]

    def _make(self, texture: Texture, whole: bool) -> tuple[str, str] | None:
        try:
            red, fraction = read_red(texture)
        except InputError as error:
            self.notes.append(f"texture {quoted(texture.name)}: {error}; it is not used")
            return None
        mean = float(np.average(red, weights=fraction if fraction.any() else None))
        name, number = f"texture {texture.stem}"[:80], 1
        while name in self.rows:
            number += 1
            name = f"{f'texture {texture.stem}'[:76]} {number}"
        why = f"texture {texture.name:.80}: {RULE_TEXT} ({mean:.2f})"
        row: dict[str, Any] = {"reflectance": round(RULE * mean, 3), "source": f"{why}: a guess"}
        if whole and red.any():
            file = f"texture_{len(self.files) + 1}.png"
            self.files[file] = np.round(255 * thinned(red)).astype(np.uint8)
            row |= {"reflectance": RULE, "texture": file}
        self.rows[name] = row
        return name, f"{RULE * mean:.2f}, {why}"


def read_red(texture: Texture) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Read red (h, w) as used by `RULE`, and opacity, both from 0 to 1. Raises InputError."""
    factor = np.float32(np.clip(texture.factor, 0, 1) ** GAMMA)
    if isinstance(texture.source, Path) and texture.source.suffix.lower() in LINEAR:
        linear = LINEAR[texture.source.suffix.lower()](texture.source)
        red = np.clip(linear, 0, 1) ** GAMMA
        return red * factor, np.ones_like(red)
    red, fraction = read_channels(texture, 0, 3)
    red = red**GAMMA if texture.linear else red
    return (red * factor).astype(np.float32), fraction


def has_coordinates(geometry: object) -> bool:
    """Return whether a mesh or shape has texture coordinates."""
    if isinstance(geometry, trimesh.Trimesh):
        return texture_coordinates(geometry) is not None
    return isinstance(geometry, RectangleObject)


def has_holes(source: Path | bytes) -> bool:
    """Return whether an image is transparent somewhere; False if it cannot be read."""
    try:
        return bool(read_channels(Texture("", source), 3)[0].min() < 1)
    except InputError:
        return False


def read_channels(texture: Texture, *numbers: int) -> list[NDArray[np.float32]]:
    """Read red, green, blue or opacity (h, w), 0 to 3, as stored in an image, from 0 to 1.

    Raises InputError if it is unreadable or not of integers.
    """
    data = texture.source if isinstance(texture.source, bytes) else read_bytes(texture.source)
    try:
        with (
            warnings.catch_warnings(action="ignore"),  # of large images, which are limited below
            Image.open(io.BytesIO(data), formats=FORMATS) as picture,
        ):
            if picture.width * picture.height > MAX_PIXELS:
                raise InputError(f"more than {MAX_PIXELS:,} pixels are not read")
            if numbers == (3,) and not picture.has_transparency_data:  # no need to decode it
                return [np.ones((picture.height, picture.width), np.float32)]
            if picture.mode.startswith("I"):  # 16-bit grey, which conversion would clip
                grey = np.asarray(picture).astype(np.float32) / np.float32(65535)
                return [np.ones_like(grey) if number == 3 else grey for number in numbers]
            channels = np.asarray(picture.convert("RGBA"))
            return [
                channels[..., number].astype(np.float32) / np.float32(255) for number in numbers
            ]
    except InputError:
        raise
    except Exception:  # of any kind, within decoders
        raise InputError(f"no picture that can be read; known: {', '.join(FORMATS)}") from None


def linear_red(texture: Texture) -> NDArray[np.float32]:
    """Read red (h, w) proportional to light, from 0 to 1. Raises InputError."""
    stored, _ = read_red(texture)
    is_linear = isinstance(texture.source, Path) and texture.source.suffix.lower() in LINEAR
    if texture.linear or is_linear:
        return np.asarray(stored ** (1 / GAMMA), dtype=np.float32)
    curved = ((stored + 0.055) / 1.055) ** 2.4  # sRGB
    return np.where(stored <= 0.04045, stored / 12.92, curved).astype(np.float32)


def thinned(red: NDArray[np.float32]) -> NDArray[np.float32]:
    """Downsample an image that is too large to be written."""
    step = 1
    while (red.shape[0] // step) * (red.shape[1] // step) > MAX_WRITTEN:
        step += 1
    return red[::step, ::step]

"""Colours at vertices: a scene file has none, so their mean over the surface counts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from spisim_formats.library.content import Content, Surface
from spisim_formats.library.files import quoted
from spisim_formats.library.source_material import SourceMaterial

Color: TypeAlias = tuple[float, float, float]


def mean_color(colors: NDArray[Any], corners: NDArray[Any], areas: Sequence[float]) -> Color | None:
    """Return the mean RGB, from 0 to 1, of colours (c, 3 or 4) at corners (t, 3) of triangles.

    It is weighted by the triangles' areas (t,); None if the colours do not fit.
    """
    rgb = np.asarray(colors, np.float64)[:, :3]
    weights = np.repeat(np.asarray(areas, np.float64), 3)
    numbers = np.ravel(corners)
    if not (len(numbers) and numbers.max() < len(rgb) and np.isfinite(rgb).all()):
        return None
    if not weights.sum() > 0:
        weights = np.ones_like(weights)
    red, green, blue = np.clip(np.average(rgb[numbers], axis=0, weights=weights), 0, 1).tolist()
    return red, green, blue


def tinted(surface: Surface, color: Color | None, content: Content, name: str) -> Surface:
    """Return a surface times a mean colour, with a note."""
    if color is None:
        return surface
    content.note(f"{quoted(name)}: colours at vertices count by their mean")
    red, texture, source = color[0], surface.texture, surface.source

    @cache
    def dyed() -> SourceMaterial | None:
        whole = source() if source is not None else None
        return None if whole is None else whole.times(red)

    if texture is not None:
        return replace(surface, texture=replace(texture, factor=texture.factor * red), source=dyed)
    own = surface.color or (1.0, 1.0, 1.0)
    product = (own[0] * color[0], own[1] * color[1], own[2] * color[2])
    return replace(surface, color=product, source=None if source is None else dyed)

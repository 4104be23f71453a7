"""Surfaces by metalness and roughness, as in glTF, OpenUSD's preview surface and Gazebo.

They differ slightly from `principled`: their metals are brighter at grazing angles.
https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html#appendix-b-brdf-implementation
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.errors import InputError
from spisim.scene.bsdf import MIN_ROUGHNESS, MIN_SPECULAR
from spisim_formats.library.opacity import Opacity
from spisim_formats.library.source_material import SourceMaterial
from spisim_formats.library.textures import Texture, linear_red, read_channels

#: Reflectance of `specular` 1 at normal incidence.
FULL_GLOSS = 0.08


@dataclass(frozen=True, eq=False)
class Metallic:
    """Numbers from 0 to 1 at the file's own wavelength; textures multiply theirs.

    `pictures` are of base, metal and roughness, by these names, with the channel of each.
    """

    base: float
    metal: float
    roughness: float
    ior: float = 1.5
    gloss: float = 1.0  # relative to the reflectance of `ior`
    opacity: Opacity | None = None
    pictures: Mapping[str, tuple[Texture, int]] = field(default_factory=dict)
    odd: tuple[str, ...] = ()

    def source_material(self) -> SourceMaterial | None:
        """Return the material; None if a texture cannot be read or numbers are invalid."""
        try:
            return self._source_material()
        except InputError:
            return None

    def _source_material(self) -> SourceMaterial:
        numbers = (self.base, self.metal, self.roughness, self.gloss)
        if not (np.isfinite(numbers).all() and self.ior >= 1 and min(numbers) >= 0):
            raise InputError("no surface")
        odd = list(self.odd)
        metal, roughness = (
            min(number * self._mean(name, odd), 1.0)
            for name, number in (("metal", self.metal), ("roughness", self.roughness))
        )
        reflected = ((self.ior - 1) / (self.ior + 1)) ** 2 * self.gloss
        fields = {
            "bsdf": "principled",
            "reflectance": min(self.base, 1.0),
            "roughness": float(np.clip(roughness**2, MIN_ROUGHNESS, 1)),
            "metallic": metal,
            "specular": float(np.clip(reflected / FULL_GLOSS, MIN_SPECULAR, 1)),
        }
        pictures: dict[str, NDArray[np.float32]] = {}
        if "base" in self.pictures:
            texture, _ = self.pictures["base"]
            red = min(self.base, 1) * linear_red(texture)
            self._take("reflectance", red, texture.fits, fields, pictures, odd)
        if self.opacity is not None:
            there = self.opacity.fraction
            self._take("opacity", there, self.opacity.fits, fields, pictures, odd)
        return SourceMaterial(fields, pictures, tuple(odd))

    def _mean(self, name: str, odd: list[str]) -> float:
        """Return the mean of a texture of numbers; 1 without one."""
        if name not in self.pictures:
            return 1.0
        texture, channel = self.pictures[name]
        (values,) = read_channels(texture, channel)
        if values.min() < values.max():
            odd.append(f"its picture of {name} is a mean")
        return float(values.mean())

    def _take(self, name: str, picture: NDArray[np.float32], fits: bool,
              fields: dict[str, object], pictures: dict[str, NDArray[np.float32]],
              odd: list[str]) -> None:  # fmt: skip
        """Use a texture if it fits the mesh, else its mean."""
        fields[name] = float(picture.mean())
        if fits and picture.size > 1:
            pictures[name] = picture
        elif picture.min() < picture.max():
            odd.append(f"its picture of {name} is laid on otherwise: a mean")

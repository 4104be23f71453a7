"""Surfaces by metalness and roughness, as glTF, OpenUSD's preview surface and Gazebo have them.

What they and `principled` are made of differs a little: theirs shine more at grazing angles where
they are metals. https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html#appendix-b-brdf-implementation
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.errors import InputError
from spisim.scene.bsdf import MIN_ROUGHNESS, MIN_SPECULAR
from spisim_formats.library.source_material import Told
from spisim_formats.library.textures import Texture, linear_red, read_channels

#: What `specular` 1 reflects at normal incidence.
FULL_GLOSS = 0.08


@dataclass(frozen=True, eq=False)
class Metallic:
    """Numbers from 0 to 1, in its own light; pictures multiply theirs.

    `pictures` are of base, metal, roughness and opacity, by these names, and the channel of each.
    """

    base: float
    metal: float
    roughness: float
    ior: float = 1.5
    gloss: float = 1.0  # share of what `ior` reflects
    opacity: float = 1.0
    cutoff: float | None = None  # of opacity, above which all is there and below which nothing
    pictures: Mapping[str, tuple[Texture, int]] = field(default_factory=dict)
    odd: tuple[str, ...] = ()

    def reported(self) -> Told | None:
        """The material; None where a picture cannot be read or numbers are none."""
        try:
            return self._reported()
        except InputError:
            return None

    def _reported(self) -> Told:
        numbers = (self.base, self.metal, self.roughness, self.gloss, self.opacity)
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
            self._take("reflectance", min(self.base, 1) * linear_red(texture), texture,
                       fields, pictures, odd)  # fmt: skip
        if "opacity" in self.pictures:
            texture, channel = self.pictures["opacity"]
            (fraction,) = read_channels(texture, channel)
            there = self._cut(self.opacity * fraction)
            if there.min() < 1:
                self._take("opacity", there, texture, fields, pictures, odd)
        elif self.opacity < 1:
            fields["opacity"] = float(self._cut(np.float32(self.opacity)))
        return Told(fields, pictures, tuple(odd))

    def _cut(self, opacity: NDArray[np.float32] | np.float32) -> NDArray[np.float32]:
        cut = opacity if self.cutoff is None else opacity >= self.cutoff
        return np.clip(np.asarray(cut, np.float32), 0, 1)

    def _mean(self, name: str, odd: list[str]) -> float:
        """Of a picture of numbers; 1 where there is none."""
        if name not in self.pictures:
            return 1.0
        texture, channel = self.pictures[name]
        (values,) = read_channels(texture, channel)
        if values.min() < values.max():
            odd.append(f"its picture of {name} is a mean")
        return float(values.mean())

    def _take(self, name: str, picture: NDArray[np.float32], texture: Texture,
              fields: dict[str, object], pictures: dict[str, NDArray[np.float32]],
              odd: list[str]) -> None:  # fmt: skip
        """A picture where it fits the mesh, else its mean."""
        fields[name] = float(picture.mean())
        if texture.fits:
            pictures[name] = picture
        elif picture.min() < picture.max():
            odd.append(f"its picture of {name} is laid on otherwise: a mean")

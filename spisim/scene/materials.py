"""Materials: how much a surface reflects at 1550 nm, each with the source of its value, and how."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import yaml
from numpy.typing import NDArray

from reconstruction.errors import InputError, nearest
from spisim.scene.bsdf import DIFFUSE, Bsdf, Clear, make_bsdf
from spisim.scene.files import read_picture

if TYPE_CHECKING:
    from spisim.scene.description import MaterialDescription

Picture: TypeAlias = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Material:
    """A surface.

    Pictures (h, w) hold values from 0 to 1, first row at the top of the mesh's texture coordinates
    (v = 1), and repeat beyond them. `texture` multiplies what is reflected; `opacity` is the
    fraction of the surface that is there, the rest lets light through as if nothing was.

    Raises InputError for a texture on a clear surface, which reflects by refraction alone.
    """

    name: str
    reflectance: float  # at 1550 nm: of the diffuse body, or at normal incidence without one
    source: str
    bsdf: Bsdf = DIFFUSE
    texture: Picture | None = None
    opacity: float | Picture | None = None

    def __post_init__(self) -> None:
        if self.texture is not None and isinstance(self.bsdf, Clear):
            raise InputError("texture does not go with a clear surface; use opacity")

    @property
    def needs_texture_coordinates(self) -> bool:
        """Whether a picture is to be laid onto the mesh."""
        return self.texture is not None or isinstance(self.opacity, np.ndarray)


@cache
def material_table() -> dict[str, Material]:
    """The shipped materials by name."""
    text = Path(__file__).with_name("materials.yaml").read_text(encoding="utf-8")
    rows = yaml.safe_load(text)
    return {name: Material(name, row["reflectance"], row["source"]) for name, row in rows.items()}


def find_material(name: str, extra: dict[str, Material] | None = None) -> Material:
    """Material of this name, from `extra` or else the shipped table.

    Raises InputError, naming the nearest, where there is none.
    """
    known = material_table() | (extra or {})
    if name not in known:
        raise InputError(f"unknown material {name!r}: {nearest(name, sorted(known))}")
    return known[name]


def make_material(name: str, described: MaterialDescription, folder: Path) -> Material:
    """Material of a scene file in `folder`, where its pictures are looked for.

    Raises InputError for parameters that do not fit the model, pictures that are missing or
    unusable, and a reflectance that is missing, or given where it follows from refraction.
    """
    bsdf = make_bsdf(described.bsdf, described.parameters())
    texture, opacity = described.texture, described.opacity
    return Material(
        name,
        _reflectance(described, bsdf.fresnel_reflectance),
        described.source,
        bsdf,
        None if texture is None else read_picture(folder / texture),
        read_picture(folder / opacity) if isinstance(opacity, str) else opacity,
    )


def _reflectance(described: MaterialDescription, fresnel: float | None) -> float:
    given = described.reflectance
    if fresnel is None:
        if given is None:
            raise InputError("reflectance is missing")
        return given
    if given is not None:
        raise InputError(
            f"reflectance does not go with bsdf {described.bsdf}: it follows from refraction, "
            f"{fresnel:.3g} at normal incidence"
        )
    return fresnel

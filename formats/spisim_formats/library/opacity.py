"""Cut-outs and transparency: what of a surface is opaque, kept whatever its material is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spisim.scene.bsdf import Clear
from spisim.scene.materials import find_material, shipped_materials
from spisim_formats.library.textures import has_coordinates, thinned

#: Wavelengths of the shipped table.
TABLE_NM = (850, 905, 940, 1460, 1550)


@dataclass(frozen=True, eq=False)
class Opacity:
    """Opaque fraction (h, w), or (1, 1) if it is the same everywhere.

    `fits` states whether it lies as the meshes' texture coordinates say.
    """

    fraction: NDArray[np.float32]
    fits: bool = True

    @property
    def is_clear(self) -> bool:
        """Whether all light passes."""
        return not self.fraction.any()


def uniform(fraction: float, cutoff: float | None = None) -> Opacity | None:
    """Return an opacity by a number, cut at a threshold if there is one; None if opaque."""
    return cut(np.full((1, 1), fraction, np.float32), cutoff)


def cut(
    fraction: NDArray[np.float32], cutoff: float | None = None, *, fits: bool = True
) -> Opacity | None:
    """Return an opacity, of 0 and 1 if there is a threshold; None if opaque everywhere."""
    opaque = fraction if cutoff is None else fraction >= cutoff
    opaque = np.clip(np.asarray(opaque, np.float32), 0, 1)
    return Opacity(opaque, fits) if opaque.min() < 1 else None


def times(factor: float, opacity: Callable[[], Opacity | None] | None = None) -> Opacity | None:
    """Return an opacity times a factor; None is opaque."""
    given = None if opacity is None else opacity()
    if given is None:
        return uniform(factor)
    return replace(given, fraction=np.float32(factor) * given.fraction)


class CutOuts:
    """Own materials of a scene file: others with an opacity; their `rows`, and pictures next to it.

    `own` are the rows that others of the file's materials have.
    """

    def __init__(self, own: Mapping[str, Mapping[str, Any]]) -> None:
        self.rows: dict[str, dict[str, Any]] = {}
        self.files: dict[str, NDArray[np.uint16]] = {}
        self.notes: list[str] = []
        self._own = own
        self._names: dict[tuple[str, int, bool], str] = {}

    def material(self, material: str, opacity: Opacity, geometry: object) -> str:
        """Return the name of a material with an opacity.

        A clear one, as of a pane, lets light pass already: it takes pictures of holes alone.
        """
        fraction = opacity.fraction
        passes = material not in self._own and isinstance(find_material(material).bsdf, Clear)
        if passes and fraction.size == 1:
            return material
        whole = opacity.fits and fraction.size > 1 and has_coordinates(geometry)
        key = material, hash(fraction.tobytes()), whole
        if key not in self._names:
            self._names[key] = self._add(material, fraction, whole)
        return self._names[key]

    def _add(self, material: str, fraction: NDArray[np.float32], whole: bool) -> str:
        mean = float(f"{float(fraction.mean()):.4g}")
        name, number = f"{material[:60]}, {100 * mean:.3g} % opaque", 1
        while name in self.rows or name in self._own:
            number += 1
            name = f"{material[:60]}, {100 * mean:.3g} % opaque {number}"
        row = dict(self._own.get(material) or _shipped_row(material))
        if whole:
            file = f"opacity_{len(self.files) + 1}.png"
            self.files[file] = np.round(65535 * thinned(fraction)).astype(np.uint16)
            self.rows[name] = row | {"opacity": file}
            return name
        if fraction.min() < fraction.max():
            self.notes.append(
                f"{name}: its picture of opacity does not lie as texture coordinates say: a mean"
            )
        self.rows[name] = row | {"opacity": mean}
        return name


def _shipped_row(name: str) -> dict[str, Any]:
    """Return a material of the shipped table as a row of a scene file."""
    table = shipped_materials()
    if name in table.dry:
        return table.dry[name].model_dump(exclude={"typical"}, exclude_unset=True)
    spectrum = {nm: round(find_material(name, wavelength_nm=nm).reflectance, 4) for nm in TABLE_NM}
    return {"reflectance": spectrum, "source": find_material(name).source}

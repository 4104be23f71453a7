"""Materials as the file itself gives them, at its own wavelength."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spisim_formats.library.textures import has_coordinates, thinned

#: Field that a texture multiplies; the texture is scaled to a maximum of 1.
TINTED = "reflectance"


@dataclass(frozen=True, eq=False)
class SourceMaterial:
    """Fields of a material in a scene file, and properties of the original that are lost.

    `source` is among them if their values are not the file's own. `pictures` (h, w) are of its
    `reflectance` and `opacity`, used if the mesh has texture coordinates, else averaged.
    """

    fields: Mapping[str, Any]
    pictures: Mapping[str, NDArray[np.float32]] = field(default_factory=dict)
    odd: tuple[str, ...] = ()

    def times(self, factor: float) -> SourceMaterial:
        """Return the material with its reflectance, if it has one, times a factor."""
        fields, pictures = dict(self.fields), dict(self.pictures)
        if TINTED in fields:
            fields[TINTED] = factor * fields[TINTED]
        if TINTED in pictures:
            pictures[TINTED] = np.asarray(factor * pictures[TINTED], np.float32)
        return SourceMaterial(fields, pictures, self.odd)


class SourceMaterials:
    """Own materials of a scene file: their `rows`, and textures beside it."""

    def __init__(self) -> None:
        self.rows: dict[str, dict[str, Any]] = {}
        self.files: dict[str, NDArray[np.uint16]] = {}
        self._odd: dict[str, list[str]] = {}
        self._names: dict[tuple[str, str], str] = {}

    @property
    def notes(self) -> list[str]:
        """Properties of the file's materials that are lost."""
        return [f"{_several(labels)}: {each}" for each, labels in self._odd.items()]

    def material(self, label: str, given: SourceMaterial, geometry: object) -> tuple[str, str]:
        """Return the name of a surface's material, and the reason."""
        whole = has_coordinates(geometry)
        fields = dict(given.fields)
        for name, picture in given.pictures.items():
            fields[name] = float(picture.max() if whole and name == TINTED else picture.mean())
        pictures = {name: each for name, each in given.pictures.items() if whole and each.any()}
        fields = {
            name: float(f"{value:.6g}") if isinstance(value, float) else value
            for name, value in fields.items()
        }
        key = label, repr((sorted(fields.items()), sorted(map(id, pictures.values()))))
        if key not in self._names:
            self._names[key] = self._add(label, fields, pictures)
            flat = [f"its picture of {name} is a mean" for name in given.pictures if not whole]
            for each in (*given.odd, *flat):
                labels = self._odd.setdefault(each, [])
                if label not in labels:
                    labels.append(label)
        return self._names[key], f"{fields['bsdf']}, as the file has it"

    def _add(
        self, label: str, fields: dict[str, Any], pictures: Mapping[str, NDArray[np.float32]]
    ) -> str:
        plain = f"file {label}"[:76]
        name, number = plain, 1
        while name in self.rows:
            number += 1
            name = f"{plain} {number}"
        for kind, picture in pictures.items():
            file = f"told_{len(self.files) + 1}.png"
            tinted = kind == TINTED
            fraction = thinned(picture / picture.max() if tinted else picture)
            self.files[file] = np.round(65535 * fraction).astype(np.uint16)
            fields = fields | {"texture" if tinted else kind: file}
        self.rows[name] = {"source": "the imported file, in its own light", **fields}
        return name


def _several(labels: list[str]) -> str:
    if len(labels) == 1:
        return f"material {labels[0]!r:.80}"
    return f"materials {labels[0]!r:.80} and {len(labels) - 1} more"

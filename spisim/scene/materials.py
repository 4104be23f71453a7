"""Materials: diffuse reflectance at 1550 nm, each with the source of its value."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import yaml

from reconstruction.errors import InputError, nearest


@dataclass(frozen=True)
class Material:
    """A Lambertian surface."""

    name: str
    reflectance: float  # diffuse, at 1550 nm
    source: str


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

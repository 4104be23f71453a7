"""Lamps in memory: the geometry and strength of their light."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.scene.pose import Vector3


@dataclass(frozen=True)
class Strength:
    """An amount in watts within the instrument's band or in kilolumens (per m² or sr)."""

    amount: float
    luminous: bool

    def in_band(self, watts_per_klm: float) -> float:
        """In-band watts (per m² or sr), given those of a kilolumen of daylight."""
        return self.amount * (watts_per_klm if self.luminous else 1.0)

    def __mul__(self, factor: float) -> Strength:
        return Strength(self.amount * factor, self.luminous)


@dataclass(frozen=True, eq=False)
class AreaLamp:
    """An object of `area_m2` that emits on the side its triangles face."""

    name: str
    object: str
    radiance: Strength
    area_m2: float

    def summary(self) -> dict[str, Any]:
        """The lamp in plain numbers."""
        return _reported(self.name, "area", "power", self.radiance * (np.pi * self.area_m2))


@dataclass(frozen=True, eq=False)
class PointLamp:
    """A point of constant intensity to `beam_rad` from its axis, falling to 0 at `cutoff_rad`."""

    name: str
    position_m: Vector3
    intensity: Strength  # on the axis
    direction: Vector3 = (0.0, 0.0, -1.0)  # unit
    cutoff_rad: float = np.pi
    beam_rad: float = np.pi

    def summary(self) -> dict[str, Any]:
        """The lamp in plain numbers."""
        kind = "point" if self.cutoff_rad == np.pi else "spot"
        angle = solid_angle(self.cutoff_rad, self.beam_rad)
        return _reported(self.name, kind, "power", self.intensity * angle)


@dataclass(frozen=True, eq=False)
class DirectionalLamp:
    """Parallel light."""

    name: str
    direction: Vector3  # in which it goes, unit
    irradiance: Strength

    def summary(self) -> dict[str, Any]:
        """The lamp in plain numbers."""
        return _reported(self.name, "directional", "irradiance", self.irradiance)


@dataclass(frozen=True, eq=False)
class EnvironmentLamp:
    """Light from infinity: `radiance` in every direction, or times a `picture` (h, w).

    Its rows run from the pole +z of its own axes to -z, its columns from x via y; `to_world` (3, 3)
    holds those axes.
    """

    name: str
    radiance: Strength
    picture: NDArray[np.float32] | None
    to_world: Floats

    def summary(self) -> dict[str, Any]:
        """The lamp in plain numbers."""
        mean = 1.0
        if self.picture is not None:
            polar = (np.arange(len(self.picture)) + 0.5) * np.pi / len(self.picture)
            mean = float(np.average(self.picture.mean(axis=1), weights=np.sin(polar)))
        return _reported(self.name, "environment", "mean radiance", self.radiance * mean)


Lamp: TypeAlias = AreaLamp | PointLamp | DirectionalLamp | EnvironmentLamp


def solid_angle(cutoff_rad: float, beam_rad: float) -> float:
    """Integral of a spot's falloff over all directions, sr; 4π for a point.

    By parts, 2π (1 - (sin c - sin b) / (c - b)) for full intensity up to b and none from c on.
    """
    if cutoff_rad == beam_rad:
        return float(2 * np.pi * (1 - np.cos(cutoff_rad)))
    slope = (np.sin(cutoff_rad) - np.sin(beam_rad)) / (cutoff_rad - beam_rad)
    return float(2 * np.pi * (1 - slope))


def unit(direction: Vector3, name: str = "direction") -> Vector3:
    """Unit vector; InputError for zero."""
    length = float(np.linalg.norm(direction))
    if length == 0:
        raise InputError(f"{name} should not be zero")
    x, y, z = (np.asarray(direction) / length).tolist()
    return x, y, z


def _reported(name: str, kind: str, quantity: str, strength: Strength) -> dict[str, Any]:
    """Plain numbers of a lamp; `power` is all its light, watts are in-band."""
    units = {
        "power": ("W", "klm"),
        "irradiance": ("W/m²", "klx"),
        "mean radiance": ("W/(m² sr)", "kcd/m²"),
    }
    return {
        "name": name,
        "type": kind,
        "quantity": quantity,
        "amount": float(strength.amount),
        "unit": units[quantity][strength.luminous],
    }

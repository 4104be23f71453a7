"""Lamps in memory: where their light comes from, and how much of it there is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError, nearest
from spisim.base.config.files import check_is_there, read_npy, read_picture
from spisim.base.config.linear import LINEAR
from spisim.scene.lamp_fields import (
    AnyLamp,
    AreaLampDescription,
    DirectionalLampDescription,
    EnvironmentLampDescription,
    LampDescription,
    PointLampDescription,
    SpotLampDescription,
)
from spisim.scene.model import SceneObject, Vector3
from spisim.scene.pose import pose_matrix

#: Fields in units of light that is seen, and what they are in kilolumens (per sr and m²).
LUMINOUS = {"luminous_flux_lm": 1e-3, "illuminance_klx": 1.0, "luminance_kcd_per_m2": 1.0}
#: Fields that tell all of a lamp's light, not that per solid angle or area.
WHOLE = ("power_w", "luminous_flux_lm")
BEAM_FRACTION = 0.75


@dataclass(frozen=True)
class Strength:
    """So much light, in watts within the instrument's band or in kilolumens (per m² or sr)."""

    amount: float
    luminous: bool

    def in_band(self, watts_per_klm: float) -> float:
        """In watts (per m² or sr), with those of daylight in the band per kilolumen."""
        return self.amount * (watts_per_klm if self.luminous else 1.0)

    def __mul__(self, factor: float) -> Strength:
        return Strength(self.amount * factor, self.luminous)


@dataclass(frozen=True, eq=False)
class AreaLamp:
    """An object whose surface shines on the side that its triangles face, `area_m2` in all."""

    name: str
    object: str
    radiance: Strength
    area_m2: float

    def summary(self) -> dict[str, Any]:
        """In plain numbers."""
        return _reported(self.name, "area", "power", self.radiance * (np.pi * self.area_m2))


@dataclass(frozen=True, eq=False)
class PointLamp:
    """A point that shines into a cone about a direction; `cutoff_rad` π is all around.

    As bright as on the axis up to `beam_rad` from it, then falling in proportion to the angle.
    """

    name: str
    position_m: Vector3
    intensity: Strength  # on the axis
    direction: Vector3 = (0.0, 0.0, -1.0)  # unit
    cutoff_rad: float = np.pi
    beam_rad: float = np.pi

    def summary(self) -> dict[str, Any]:
        """In plain numbers."""
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
        """In plain numbers."""
        return _reported(self.name, "directional", "irradiance", self.irradiance)


@dataclass(frozen=True, eq=False)
class EnvironmentLamp:
    """Light from beyond everything: `radiance` from everywhere, or times a `picture` (h, w).

    Its rows go from the pole +z of its own axes to -z, its columns from x by y; `to_world` (3, 3)
    are its axes.
    """

    name: str
    radiance: Strength
    picture: NDArray[np.float32] | None
    to_world: Floats

    def summary(self) -> dict[str, Any]:
        """In plain numbers."""
        mean = 1.0
        if self.picture is not None:
            polar = (np.arange(len(self.picture)) + 0.5) * np.pi / len(self.picture)
            mean = float(np.average(self.picture.mean(axis=1), weights=np.sin(polar)))
        return _reported(self.name, "environment", "mean radiance", self.radiance * mean)


Lamp: TypeAlias = AreaLamp | PointLamp | DirectionalLamp | EnvironmentLamp


def make_lamp(described: AnyLamp, objects: Sequence[SceneObject], folder: Path) -> Lamp:
    """The lamp of a description; pictures are looked for in `folder`.

    Raises InputError for an object that is not there, a direction that is none, and a picture that
    is missing or unfit.
    """
    name = described.name
    match described:
        case AreaLampDescription():
            thing = find_object(described.object, objects)
            area_m2 = float(thing.mesh.area)
            return AreaLamp(name, thing.name, _strength(described, np.pi * area_m2), area_m2)
        case PointLampDescription():
            return PointLamp(name, described.position_m, _strength(described, 4 * np.pi))
        case SpotLampDescription():
            return _spot(described)
        case DirectionalLampDescription():
            return DirectionalLamp(name, unit(described.direction), _strength(described))
        case EnvironmentLampDescription():
            picture = None
            if described.picture is not None:
                picture = _read_environment(folder / described.picture)
            axes = pose_matrix(described.rotate_deg, (0, 0, 0))[:3, :3]
            return EnvironmentLamp(name, _strength(described), picture, axes)
    raise TypeError(f"no lamp for {type(described).__name__}")


def solid_angle(cutoff_rad: float, beam_rad: float) -> float:
    """∫ of a spot's falloff over all directions, sr: 4π for a point.

    2π (1 - (sin c - sin b) / (c - b)) of the cone between b, whole, and c, in proportion: by parts.
    """
    if cutoff_rad == beam_rad:
        return float(2 * np.pi * (1 - np.cos(cutoff_rad)))
    slope = (np.sin(cutoff_rad) - np.sin(beam_rad)) / (cutoff_rad - beam_rad)
    return float(2 * np.pi * (1 - slope))


def unit(direction: Vector3) -> Vector3:
    """InputError for zero."""
    length = float(np.linalg.norm(direction))
    if length == 0:
        raise InputError("direction should not be zero")
    x, y, z = (np.asarray(direction) / length).tolist()
    return x, y, z


def _spot(described: SpotLampDescription) -> PointLamp:
    beam_deg = described.beam_deg
    if beam_deg is None:
        beam_deg = BEAM_FRACTION * described.cutoff_deg
    cutoff, beam = np.radians([described.cutoff_deg, beam_deg]).tolist()
    return PointLamp(
        described.name,
        described.position_m,
        _strength(described, solid_angle(cutoff, beam)),
        unit(described.direction),
        cutoff,
        beam,
    )


def _strength(described: LampDescription, spread: float = 1.0) -> Strength:
    """Per sr and m², over which all of a lamp's light is `spread`."""
    field, value = described.strength
    amount = value * LUMINOUS.get(field, 1.0)
    return Strength(amount / (spread if field in WHOLE else 1.0), field in LUMINOUS)


def find_object(name: str, objects: Sequence[SceneObject]) -> SceneObject:
    """InputError, naming the nearest, where none has this name."""
    for thing in objects:
        if thing.name == name:
            return thing
    candidate = nearest(name, [thing.name for thing in objects])
    raise InputError(f"object {name!r} is not in the scene: {candidate}")


def _read_environment(path: Path) -> NDArray[np.float32]:
    """Relative radiance (h, w); InputError for a file that is missing, or no such thing."""
    if reader := LINEAR.get(path.suffix.lower()):
        check_is_there(path, "picture")
        picture = reader(path)[:, ::-1]  # they are seen from within, the other way round
    elif path.suffix.lower() != ".npy":
        picture = read_picture(path)
    else:
        check_is_there(path, "picture")
        picture = read_npy(path, "picture").astype(np.float32)
    if picture.ndim != 2 or min(picture.shape) < 2:
        raise InputError(f"picture {path.name!r} should be (h, w); found shape {picture.shape}")
    if not (np.isfinite(picture).all() and picture.min() >= 0 and picture.any()):
        raise InputError(f"picture {path.name!r} should hold values from 0 on, and not only 0")
    return picture


def _reported(name: str, kind: str, quantity: str, strength: Strength) -> dict[str, Any]:
    """`power` is all of the light; watts are in the instrument's band."""
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

"""Lamp descriptions made into lamps."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.errors import InputError
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
from spisim.scene.lamps import (
    AreaLamp,
    DirectionalLamp,
    EnvironmentLamp,
    Lamp,
    PointLamp,
    Strength,
    solid_angle,
    unit,
)
from spisim.scene.model import SceneObject, find_object
from spisim.scene.pose import pose_matrix

#: Photometric fields, and their factors to kilolumens (per sr and m²).
LUMINOUS = {"luminous_flux_lm": 1e-3, "illuminance_klx": 1.0, "luminance_kcd_per_m2": 1.0}
#: Fields for all of a lamp's light, rather than per solid angle or area.
WHOLE = ("power_w", "luminous_flux_lm")
BEAM_FRACTION = 0.75


def make_lamp(described: AnyLamp, objects: Sequence[SceneObject], folder: Path) -> Lamp:
    """The lamp of a description, with pictures from `folder`."""
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
    """Strength per sr and m²; all of the lamp's light spreads over `spread`."""
    field, value = described.strength
    amount = value * LUMINOUS.get(field, 1.0)
    return Strength(amount / (spread if field in WHOLE else 1.0), field in LUMINOUS)


def _read_environment(path: Path) -> NDArray[np.float32]:
    """Relative radiance (h, w); InputError for a file that is missing or unfit."""
    if reader := LINEAR.get(path.suffix.lower()):
        check_is_there(path, "picture")
        picture = reader(path)[:, ::-1]  # these pictures show the sphere from inside
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

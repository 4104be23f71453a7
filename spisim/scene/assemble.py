"""Scenes assembled from their descriptions."""

import warnings
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.atmosphere import Atmosphere, combine
from spisim.atmosphere.precipitation import Precipitation
from spisim.atmosphere.sections import WEATHER
from spisim.atmosphere.weather import Weather
from spisim.base.config.files import check_is_there, read_npy, read_picture
from spisim.base.config.linear import LINEAR
from spisim.scene.description import AmbientDescription, DroneDescription, SceneDescription
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
from spisim.scene.load_context import LoadContext
from spisim.scene.model import Ambient, Scene, SceneObject, SceneWarning, Volume, find_object
from spisim.scene.placing import Meshes, placed_objects, radians
from spisim.scene.pose import look_at, pose_matrix
from spisim.scene.rays import enclosing_object
from spisim.scene.soundness import warn_of_odd_daylight, warn_of_odd_sizes, warn_of_unsound_meshes
from spisim.scene.volumes import make_volume, warn_of_overlap

#: From forward, left, up (ROS REP 103) to right, down, forward.
OPTICAL_FROM_BODY = np.array([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1.0]])

#: Photometric fields, and their factors to kilolumens (per sr and m²).
LUMINOUS = {"luminous_flux_lm": 1e-3, "illuminance_klx": 1.0, "luminance_kcd_per_m2": 1.0}
#: Fields for all of a lamp's light, rather than per solid angle or area.
WHOLE = ("power_w", "luminous_flux_lm")
BEAM_FRACTION = 0.75
NO_MESHES: Meshes = MappingProxyType({})


def assemble(
    described: SceneDescription, context: LoadContext, meshes: Meshes = NO_MESHES
) -> Scene:
    """Scene of a description; `meshes` are mesh files in memory, by name."""
    folder, source, wavelength_nm = context.folder, context.source, context.wavelength_nm
    media: list[Atmosphere] = []
    falling: list[Precipitation] = []
    for field in WEATHER:
        section: Weather | None = getattr(described, field)
        if section is None:
            continue
        with context.problems_at(field):
            made = section.made(folder, wavelength_nm)
        if isinstance(made, Precipitation):
            falling.append(made)
        else:
            media.append(made)
    with context.problems_at("ambient"):
        ambient = _ambient(described.ambient)
    with context.problems_at("drone"):
        pose = drone_pose(described.drone)
    objects = placed_objects(described, context, meshes)
    volumes: list[Volume] = []
    for i, filled in enumerate(described.volumes):
        with context.problems_at(f"volumes[{i}] ({filled.name})"):
            volumes.append(make_volume(filled, objects, folder, wavelength_nm))
    lamps: list[Lamp] = []
    for i, lamp in enumerate(described.lamps):
        with context.problems_at(f"lamps[{i}] ({lamp.name})"):
            lamps.append(make_lamp(lamp, objects, folder))
    _check_names("objects", [thing.name for thing in objects], source)
    _check_names("volumes", [volume.name for volume in volumes], source)
    _check_names("lamps", [lamp.name for lamp in lamps], source)
    return Scene(
        described.name,
        objects,
        combine(media),
        ambient,
        pose,
        context.text,
        tuple(volumes),
        described.drone.velocity_m_s,
        radians(described.drone.angular_velocity_deg_s),
        tuple(falling),
        wavelength_nm,
        tuple(lamps),
    )


def check_drone(scene: Scene, source: Path | str) -> None:
    """InputError if the drone is inside an object."""
    position = scene.drone_pose[:3, 3]
    if name := enclosing_object(scene, position):
        raise InputError(
            f"{source}: drone.position_m: {position.tolist()} is inside object {name!r}; move one "
            "of them, or turn the normals of the mesh inward if it is a room"
        )


def warn_of_oddities(scene: Scene) -> None:
    """SceneWarning for unsound meshes, odd sizes or daylight, overlaps and unnatural media."""
    warn_of_unsound_meshes(scene)
    warn_of_odd_sizes(scene)
    warn_of_odd_daylight(scene)
    warn_of_overlap(scene.volumes)
    parts = scene.atmosphere.parts or (scene.atmosphere,)
    for medium in (*parts, *(volume.medium for volume in scene.volumes)):
        for warning in medium.warnings:
            warnings.warn(warning, SceneWarning, stacklevel=2)


def drone_pose(described: DroneDescription) -> Floats:
    """World-from-optical pose (4, 4); InputError if there is no line of sight."""
    looking = look_at(described.position_m, described.look_at_m, described.up)
    offset = pose_matrix(described.turn_deg, described.offset_m)
    return np.asarray(looking @ OPTICAL_FROM_BODY @ offset @ OPTICAL_FROM_BODY.T)


def _ambient(described: AmbientDescription) -> Ambient:
    direction = unit(described.sun_direction, "sun_direction")
    return Ambient(described.sun_klx, direction, described.sky_klx)


def _check_names(field: str, names: list[str], source: Path | str) -> None:
    for name, count in Counter(names).items():
        if count > 1:
            raise InputError(f"{source}: {field}: two of them are named {name!r}")


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
    given_deg = described.beam_deg
    beam_deg = BEAM_FRACTION * described.cutoff_deg if given_deg is None else given_deg
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

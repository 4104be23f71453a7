"""Scenes assembled from their descriptions."""

import warnings
from collections import Counter
from pathlib import Path
from types import MappingProxyType

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.atmosphere import Atmosphere, combine
from spisim.atmosphere.precipitation import Precipitation
from spisim.atmosphere.sections import WEATHER
from spisim.atmosphere.weather import Weather
from spisim.scene.description import (
    AmbientDescription,
    DroneDescription,
    SceneDescription,
)
from spisim.scene.lamps import Lamp
from spisim.scene.load_context import LoadContext
from spisim.scene.make_lamp import make_lamp
from spisim.scene.model import Ambient, Scene, SceneWarning, Volume
from spisim.scene.placing import Meshes, placed_objects, radians
from spisim.scene.pose import look_at, pose_matrix
from spisim.scene.rays import enclosing_object
from spisim.scene.soundness import warn_of_odd_daylight, warn_of_odd_sizes, warn_of_unsound_meshes
from spisim.scene.volumes import make_volume, warn_of_overlap

#: From forward, left, up (ROS REP 103) to right, down, forward.
OPTICAL_FROM_BODY = np.array([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1.0]])

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
    direction = np.asarray(described.sun_direction)
    length = float(np.linalg.norm(direction))
    if length == 0:
        raise InputError("sun_direction should not be zero")
    x, y, z = (direction / length).tolist()
    return Ambient(described.sun_klx, (x, y, z), described.sky_klx)


def _check_names(field: str, names: list[str], source: Path | str) -> None:
    for name, count in Counter(names).items():
        if count > 1:
            raise InputError(f"{source}: {field}: two of them are named {name!r}")

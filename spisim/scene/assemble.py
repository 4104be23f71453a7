"""Descriptions to scenes: meshes placed, materials found, media made."""

import math
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np
import trimesh

from reconstruction.arrays import Floats
from reconstruction.errors import InputError
from spisim.atmosphere import Atmosphere, combine
from spisim.atmosphere.precipitation import Precipitation
from spisim.atmosphere.sections import WEATHER
from spisim.atmosphere.weather import Weather
from spisim.config.files import read_density
from spisim.scene.description import (
    AmbientDescription,
    DroneDescription,
    MeshObject,
    ObjectDescription,
    Pose,
    SceneDescription,
    VolumeDescription,
)
from spisim.scene.materials import Material, find_material, make_material
from spisim.scene.model import Ambient, Scene, SceneObject, Vector3, Volume
from spisim.scene.pose import look_at, pose_matrix
from spisim.scene.rays import enclosing_object
from spisim.scene.shapes import check_triangles, make_mesh, texture_coordinates
from spisim.scene.soundness import warn_of_odd_sizes, warn_of_unsound_meshes
from spisim.scene.volumes import warn_of_overlap
from spisim.scene.warning import SceneWarning

#: From forward, left, up (ROS REP 103) to right, down, forward.
OPTICAL_FROM_BODY = np.array([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1.0]])

#: Beyond this not even metres are told apart in single precision.
MAX_COORDINATE_M = 1e6

Meshes = Mapping[str, trimesh.Trimesh]
NO_MESHES: Meshes = MappingProxyType({})


@dataclass(frozen=True)
class Setting:
    """Where a description comes from, and the wavelength that its scene is made for.

    Pictures, tables and meshes lie in `folder`; `text` is what the scene says that it was made
    from, `source` what error messages call it.
    """

    folder: Path
    text: str
    source: Path | str
    wavelength_nm: float = 1550.0


def assemble(described: SceneDescription, setting: Setting, meshes: Meshes = NO_MESHES) -> Scene:
    """Scene of a description; `meshes` are mesh files that are in memory, by name.

    Raises InputError, naming source and field, for whatever the description alone could not tell.
    """
    folder, source, wavelength_nm = setting.folder, setting.source, setting.wavelength_nm
    materials: dict[str, Material] = {}
    for name, own in described.materials.items():
        with _problems_at(source, f"materials.{name}"):
            materials[name] = make_material(name, own, folder, wavelength_nm)
    media: list[Atmosphere] = []
    falling: list[Precipitation] = []
    for field in WEATHER:
        section: Weather | None = getattr(described, field)
        if section is None:
            continue
        with _problems_at(source, field):
            made = section.made(folder, wavelength_nm)
        if isinstance(made, Precipitation):
            falling.append(made)
        else:
            media.append(made)
    with _problems_at(source, "ambient"):
        ambient = _ambient(described.ambient)
    with _problems_at(source, "drone"):
        pose = _drone_pose(described.drone)
    with _problems_at(source, "material_swaps"):
        for name in described.material_swaps.values():
            find_material(name, materials, wavelength_nm)
    objects: list[SceneObject] = []
    triangles = 0
    for i, row in enumerate(described.objects):
        with _problems_at(source, f"objects[{i}] ({row.name})"):
            name = described.material_swaps.get(row.material, row.material)
            placed = _place(row, find_material(name, materials, wavelength_nm), folder, meshes)
            triangles += sum(len(thing.mesh.faces) for thing in placed)
            check_triangles(triangles)
            objects += placed
    volumes: list[Volume] = []
    for i, box in enumerate(described.volumes):
        with _problems_at(source, f"volumes[{i}] ({box.name})"):
            volumes.append(_volume(box, folder, wavelength_nm))
    _check_names("objects", [thing.name for thing in objects], source)
    _check_names("volumes", [volume.name for volume in volumes], source)
    return Scene(
        described.name,
        tuple(objects),
        combine(media),
        ambient,
        pose,
        setting.text,
        tuple(volumes),
        described.drone.velocity_m_s,
        _radians(described.drone.angular_velocity_deg_s),
        tuple(falling),
        wavelength_nm,
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
    """SceneWarning of unsound meshes, odd sizes, volumes that overlap, and unnatural media."""
    warn_of_unsound_meshes(scene)
    warn_of_odd_sizes(scene)
    warn_of_overlap(scene.volumes)
    parts = scene.atmosphere.parts or (scene.atmosphere,)
    for medium in (*parts, *(volume.medium for volume in scene.volumes)):
        for doubt in medium.doubts:
            warnings.warn(doubt, SceneWarning, stacklevel=2)


@contextmanager
def _problems_at(source: Path | str, field: str) -> Iterator[None]:
    """Put file and field in front of an InputError's message."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{source}: {field}: {error}") from None


def _drone_pose(described: DroneDescription) -> Floats:
    looking = look_at(described.position_m, described.look_at_m, described.up)
    offset = pose_matrix(described.turn_deg, described.offset_m)
    return np.asarray(looking @ OPTICAL_FROM_BODY @ offset @ OPTICAL_FROM_BODY.T)


def _volume(described: VolumeDescription, folder: Path, wavelength_nm: float) -> Volume:
    medium = described.made(folder, wavelength_nm)
    if medium.extinction_per_m == 0:
        raise InputError("extinction_per_m should be greater than 0: a volume of nothing")
    centred = np.diag([*described.size_m, 1.0])
    centred[:3, 3] = np.multiply(described.size_m, -0.5)
    to_world = pose_matrix(described.rotate_deg, described.translate_m) @ centred
    density = None
    if described.density is not None:
        density = read_density(folder / described.density)
    elif described.structure is not None:
        density = described.structure.density(to_world)
    return Volume(described.name, medium, to_world, density, described.structure)


def _ambient(described: AmbientDescription) -> Ambient:
    direction = np.asarray(described.sun_direction)
    length = float(np.linalg.norm(direction))
    if length == 0:
        raise InputError("sun_direction should not be zero")
    x, y, z = (direction / length).tolist()
    return Ambient(described.sun_klx, (x, y, z), described.sky_klx)


def _place(
    described: ObjectDescription, material: Material, folder: Path, meshes: Meshes
) -> list[SceneObject]:
    """An object, or its instances, with meshes in world coordinates."""
    if isinstance(described, MeshObject) and described.mesh in meshes:
        mesh = meshes[described.mesh].copy()
    else:
        mesh = make_mesh(described, folder)
    if material.needs_texture_coordinates and texture_coordinates(mesh) is None:
        what = f"mesh {described.mesh!r}" if isinstance(described, MeshObject) else "this shape"
        raise InputError(
            f"{what} has no texture coordinates, which material {material.name!r} needs for its "
            "texture or opacity"
        )
    mesh.apply_scale(described.scale)
    mesh.apply_transform(pose_matrix(described.rotate_deg, described.translate_m))
    check_triangles(len(mesh.faces) * len(described.instances or [mesh]))
    instances = {described.name: mesh}
    if described.instances is not None:
        instances = {
            f"{described.name}-{i}": _posed(mesh, instance)
            for i, instance in enumerate(described.instances, start=1)
        }
    for posed in instances.values():
        if not (far := float(np.abs(posed.bounds).max())) <= MAX_COORDINATE_M:
            raise InputError(f"reaches {far:.3g} m from the origin; at most {MAX_COORDINATE_M:g} m")
    turning = _radians(described.angular_velocity_deg_s)
    return [
        SceneObject(name, posed, material, described.velocity_m_s, turning)
        for name, posed in instances.items()
    ]


def _posed(mesh: trimesh.Trimesh, pose: Pose) -> trimesh.Trimesh:
    return mesh.copy().apply_transform(pose_matrix(pose.rotate_deg, pose.translate_m))


def _radians(degrees: Vector3) -> Vector3:
    x, y, z = (math.radians(angle) for angle in degrees)
    return x, y, z


def _check_names(field: str, names: list[str], source: Path | str) -> None:
    for name, count in Counter(names).items():
        if count > 1:
            raise InputError(f"{source}: {field}: two of them are named {name!r}")

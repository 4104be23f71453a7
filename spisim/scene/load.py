"""Scene files to scenes."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
import yaml

from reconstruction.errors import InputError
from spisim.atmosphere import Atmosphere, combine
from spisim.atmosphere.precipitation import Precipitation
from spisim.config import find_named, parse_model, read_text
from spisim.scene.description import (
    AmbientDescription,
    FallingDescription,
    MeshObject,
    ObjectDescription,
    Pose,
    SceneDescription,
    VolumeDescription,
)
from spisim.scene.files import read_density
from spisim.scene.materials import Material, find_material, make_material
from spisim.scene.media import make_medium, make_precipitation, warn_of_doubtful_media
from spisim.scene.model import Ambient, Scene, SceneObject, Vector3, Volume
from spisim.scene.pose import look_at, pose_matrix
from spisim.scene.rays import enclosing_object
from spisim.scene.shapes import make_mesh, texture_coordinates
from spisim.scene.soundness import warn_of_unsound_meshes
from spisim.scene.volumes import warn_of_overlap

#: Sections of a scene file that fill all of the air, in the order of their fields.
MEDIA = ("fog", "smoke", "rain", "snow")


def scenes_folder() -> Path:
    """Folder of the shipped scenes; it lies beside the package. InputError if it is not there."""
    folder = Path(__file__).parents[2] / "scenes"
    if not folder.is_dir():
        raise InputError(f"{folder}: the shipped scenes are missing; reinstall spisim")
    return folder


def list_scenes() -> list[str]:
    """Names of the shipped scenes."""
    return sorted(path.stem for path in scenes_folder().glob("*.yaml"))


def load_scene(
    path: str | Path,
    changes: Mapping[str, Any] | None = None,
    *,
    wavelength_nm: float = 1550.0,
) -> Scene:
    """Scene from a YAML file, or a shipped one by its name ("warehouse").

    `changes` are top-level sections, as in the file, to put in place of the file's own; None leaves
    a section out. The scene's text is changed along. Materials and weather are made for
    `wavelength_nm`, which is the instrument's.

    Raises InputError, naming file, field and what is allowed, for a file that is missing or not
    YAML, fields that are unknown, missing or out of range, a mesh that is missing or unusable, an
    unknown material or unfit pictures, densities and phase functions, two objects or volumes of one
    name, and a drone inside an object. Warns with SceneWarning of meshes that are no sound
    surfaces, volumes that overlap, and weather that nature does not have.
    """
    file = find_named(str(path), scenes_folder(), "scene")
    text = read_text(file)
    if changes:
        parse_model(text, SceneDescription, file)  # the file has to be one by itself
        sections = {**yaml.safe_load(text), **changes}
        kept = {name: section for name, section in sections.items() if section is not None}
        text = yaml.safe_dump(kept, sort_keys=False, allow_unicode=True)
    described = parse_model(text, SceneDescription, file)
    folder = file.parent
    materials: dict[str, Material] = {}
    for name, own in described.materials.items():
        with _problems_at(file, f"materials.{name}"):
            materials[name] = make_material(name, own, folder)
    media: list[Atmosphere] = []
    falling: list[Precipitation] = []
    for field in MEDIA:
        with _problems_at(file, field):
            section = getattr(described, field)
            if isinstance(section, FallingDescription) and section.model == "drops":
                falling.append(make_precipitation(section, wavelength_nm))
            elif section is not None:
                media.append(make_medium(section, folder, wavelength_nm))
    with _problems_at(file, "ambient"):
        ambient = _ambient(described.ambient)
    with _problems_at(file, "drone"):
        pose = look_at(described.drone.position_m, described.drone.look_at_m, described.drone.up)
    objects: list[SceneObject] = []
    for i, row in enumerate(described.objects):
        with _problems_at(file, f"objects[{i}] ({row.name})"):
            objects += _place(row, folder, materials)
    volumes: list[Volume] = []
    for i, box in enumerate(described.volumes):
        with _problems_at(file, f"volumes[{i}] ({box.name})"):
            volumes.append(_volume(box, folder, wavelength_nm))
    scene = Scene(
        described.name,
        tuple(objects),
        combine(media),
        ambient,
        pose,
        text,
        tuple(volumes),
        described.drone.velocity_m_s,
        _radians(described.drone.angular_velocity_deg_s),
        tuple(falling),
        wavelength_nm,
    )
    _check_names("objects", [thing.name for thing in objects], file)
    _check_names("volumes", [volume.name for volume in volumes], file)
    _check_drone(scene, file)
    warn_of_unsound_meshes(scene)
    warn_of_overlap(volumes)
    warn_of_doubtful_media([*media, *(volume.medium for volume in volumes)])
    return scene


@contextmanager
def _problems_at(file: Path, field: str) -> Iterator[None]:
    """Put file and field in front of an InputError's message."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{file}: {field}: {error}") from None


def _volume(described: VolumeDescription, folder: Path, wavelength_nm: float) -> Volume:
    medium = make_medium(described, folder, wavelength_nm)
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
    described: ObjectDescription, folder: Path, materials: dict[str, Material]
) -> list[SceneObject]:
    """An object, or its instances, with meshes in world coordinates."""
    material = find_material(described.material, materials)
    mesh = make_mesh(described, folder)
    if material.needs_texture_coordinates and texture_coordinates(mesh) is None:
        what = f"mesh {described.mesh!r}" if isinstance(described, MeshObject) else "this shape"
        raise InputError(
            f"{what} has no texture coordinates, which material {material.name!r} needs for its "
            "texture or opacity"
        )
    mesh.apply_scale(described.scale)
    mesh.apply_transform(pose_matrix(described.rotate_deg, described.translate_m))
    instances = {described.name: mesh}
    if described.instances is not None:
        instances = {
            f"{described.name}-{i}": _posed(mesh, instance)
            for i, instance in enumerate(described.instances, start=1)
        }
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


def _check_names(field: str, names: list[str], file: Path) -> None:
    for name, count in Counter(names).items():
        if count > 1:
            raise InputError(f"{file}: {field}: two of them are named {name!r}")


def _check_drone(scene: Scene, file: Path) -> None:
    position = scene.drone_pose[:3, 3]
    if name := enclosing_object(scene, position):
        raise InputError(
            f"{file}: drone.position_m: {position.tolist()} is inside object {name!r}; move one of "
            "them, or turn the normals of the mesh inward if it is a room"
        )

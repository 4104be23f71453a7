"""Scene files to scenes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import trimesh

from reconstruction.errors import InputError
from spisim import atmosphere
from spisim.atmosphere import CLEAR, Atmosphere
from spisim.config import find_named, parse_model, read_text
from spisim.scene.description import (
    AmbientDescription,
    FogDescription,
    ObjectDescription,
    Pose,
    SceneDescription,
)
from spisim.scene.materials import Material, find_material
from spisim.scene.model import Ambient, Scene, SceneObject
from spisim.scene.pose import look_at, pose_matrix
from spisim.scene.rays import enclosing_object
from spisim.scene.shapes import make_mesh


def scenes_folder() -> Path:
    """Folder of the shipped scenes; it lies beside the package. InputError if it is not there."""
    folder = Path(__file__).parents[2] / "scenes"
    if not folder.is_dir():
        raise InputError(f"{folder}: the shipped scenes are missing; reinstall spisim")
    return folder


def list_scenes() -> list[str]:
    """Names of the shipped scenes."""
    return sorted(path.stem for path in scenes_folder().glob("*.yaml"))


def load_scene(path: str | Path) -> Scene:
    """Scene from a YAML file, or a shipped one by its name ("warehouse").

    Raises InputError, naming file, field and what is allowed, for a file that is missing or not
    YAML, fields that are unknown, missing or out of range, a mesh that is missing or unusable, an
    unknown material, two objects of one name, and a drone inside an object.
    """
    file = find_named(str(path), scenes_folder(), "scene")
    text = read_text(file)
    described = parse_model(text, SceneDescription, file)
    materials = {
        name: Material(name, row.reflectance, row.source)
        for name, row in described.materials.items()
    }
    with _problems_at(file, "fog"):
        air = _atmosphere(described.fog)
    with _problems_at(file, "ambient"):
        ambient = _ambient(described.ambient)
    with _problems_at(file, "drone"):
        pose = look_at(described.drone.position_m, described.drone.look_at_m, described.drone.up)
    objects: list[SceneObject] = []
    for i, row in enumerate(described.objects):
        with _problems_at(file, f"objects[{i}] ({row.name})"):
            objects += _place(row, file.parent, materials)
    scene = Scene(described.name, tuple(objects), air, ambient, pose, text)
    _check_names(scene, file)
    _check_drone(scene, file)
    return scene


@contextmanager
def _problems_at(file: Path, field: str) -> Iterator[None]:
    """Put file and field in front of an InputError's message."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{file}: {field}: {error}") from None


def _atmosphere(described: FogDescription | None) -> Atmosphere:
    if described is None:
        return CLEAR
    if described.extinction_per_m is not None:
        return atmosphere.explicit(described.extinction_per_m, described.albedo, described.g)
    assert described.visibility_m is not None  # the description demands one of the two
    return atmosphere.fog(described.visibility_m, described.kind, described.definition)


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
    mesh.apply_scale(described.scale)
    mesh.apply_transform(pose_matrix(described.rotate_deg, described.translate_m))
    if described.instances is None:
        return [SceneObject(described.name, mesh, material)]
    return [
        SceneObject(f"{described.name}-{i}", _posed(mesh, instance), material)
        for i, instance in enumerate(described.instances, start=1)
    ]


def _posed(mesh: trimesh.Trimesh, pose: Pose) -> trimesh.Trimesh:
    return mesh.copy().apply_transform(pose_matrix(pose.rotate_deg, pose.translate_m))


def _check_names(scene: Scene, file: Path) -> None:
    seen: set[str] = set()
    for scene_object in scene.objects:
        if scene_object.name in seen:
            raise InputError(f"{file}: objects: two of them are named {scene_object.name!r}")
        seen.add(scene_object.name)


def _check_drone(scene: Scene, file: Path) -> None:
    position = scene.drone_pose[:3, 3]
    if name := enclosing_object(scene, position):
        raise InputError(
            f"{file}: drone.position_m: {position.tolist()} is inside object {name!r}; move one of "
            "them, or turn the normals of the mesh inward if it is a room"
        )

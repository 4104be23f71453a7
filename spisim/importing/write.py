"""Parts to an editable scene file and its meshes, all there or none of it."""

from __future__ import annotations

import re
import secrets
import shutil
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
import yaml
from scipy.linalg import polar
from scipy.spatial.transform import Rotation

from reconstruction.errors import InputError
from reconstruction.files import require_file
from spisim.importing.drone import DronePose
from spisim.importing.materials import Match, own_materials
from spisim.importing.model import Floats, Part, Shape
from spisim.importing.shapes import as_mesh, stretched
from spisim.scene import Scene, SceneWarning, load_scene
from spisim.scene.pose import pose_matrix

HEADER = "# Imported by `spisim scenes import`; docs/importing.md tells what may be changed.\n"
#: How far, relative to its scale, a pose may be from a rotation: what single precision leaves.
RIGID = 3e-7
EXACT = 1e-9
MAX_NAME = 80


@dataclass(frozen=True)
class Written:
    """The files of an import, and the scene that they were loaded as to check them."""

    scene_file: Path
    mesh_files: tuple[Path, ...]
    scene: Scene
    warnings: tuple[str, ...]


class _Flow(list[float]):
    """A list that YAML shows in one line."""


class _Dumper(yaml.SafeDumper):
    pass


_Dumper.add_representer(
    _Flow,
    lambda dumper, row: dumper.represent_sequence("tag:yaml.org,2002:seq", row, flow_style=True),
)


def check_free(output: Path, overwrite: bool) -> None:
    """InputError unless a scene file and its folder of meshes can be written."""
    if output.suffix not in (".yaml", ".yml"):
        raise InputError(f"{output}: the name of a scene file should end in .yaml")
    require_file(output)
    for path in (output, mesh_folder(output)):
        if path.is_symlink():
            raise InputError(f"{path} is a symbolic link; the name of a new file is needed")
        if path.exists() and not overwrite:
            raise InputError(f"{path} exists; --overwrite replaces it")
    if mesh_folder(output).exists() and not mesh_folder(output).is_dir():
        raise InputError(f"{mesh_folder(output)} is not a folder")


def mesh_folder(output: Path) -> Path:
    """The folder of the meshes of a scene file."""
    return output.with_name(f"{output.stem}-meshes")


def write_scene(
    output: Path, parts: Sequence[Part], matches: Sequence[Match], drone: DronePose, source: str
) -> Written:
    """Write a scene, load it to see that it is one, then give it its name.

    `matches` are the materials of the parts. Raises InputError for a scene that does not load;
    then, and when interrupted, nothing is left behind and older files stay.
    """
    folder = mesh_folder(output)
    new_folders = [parent for parent in output.parents if not parent.exists()]
    output.parent.mkdir(parents=True, exist_ok=True)
    stage = output.with_name(f".{output.stem}.{secrets.token_hex(4)}.tmp")
    try:
        (stage / folder.name).mkdir(parents=True)
        objects, meshes = _objects(parts, matches, stage, folder.name)
        scene_text = _scene_text(output.stem, source, objects, matches, drone)
        staged = stage / output.name
        staged.write_text(scene_text, encoding="utf-8")
        scene, odd = _loaded(staged, output)
        _put_in_place(stage, output, folder)
    except BaseException:
        shutil.rmtree(stage, ignore_errors=True)
        for parent in new_folders:
            if parent.is_dir() and not any(parent.iterdir()):
                parent.rmdir()
        raise
    shutil.rmtree(stage, ignore_errors=True)
    return Written(output, tuple(folder / name for name in meshes), scene, odd)


def _put_in_place(stage: Path, output: Path, folder: Path) -> None:
    """Move the staged files to their names; older ones go into the stage, or back on failure."""
    moved: list[tuple[Path, Path]] = []
    try:
        for path in (folder, output):
            if path.exists():
                moved.append((path, path.rename(stage / f"old-{path.name}")))
        for path in (folder, output):
            moved.append((stage / path.name, (stage / path.name).rename(path)))
    except BaseException:
        for before, now in reversed(moved):
            now.rename(before)
        raise


def _loaded(staged: Path, output: Path) -> tuple[Scene, tuple[str, ...]]:
    try:
        # A flat closed mesh has no volume to divide by.
        with warnings.catch_warnings(record=True) as odd, np.errstate(all="ignore"):
            warnings.simplefilter("always", SceneWarning)
            scene = load_scene(staged)
    except InputError as error:
        raise InputError(str(error).replace(str(staged), str(output))) from None
    return scene, tuple(str(warning.message) for warning in odd)


def _scene_text(
    name: str,
    source: str,
    objects: list[dict[str, Any]],
    matches: Iterable[Match],
    drone: DronePose,
) -> str:
    used = {match.material for match in matches}
    own = {name: row for name, row in own_materials().items() if name in used}
    content: dict[str, Any] = {
        "name": name,
        "description": f"imported from {source}",
        "drone": {
            "position_m": _flow(drone.position_m, 4),
            "look_at_m": _flow(drone.look_at_m, 4),
        },
    }
    if own:
        content["materials"] = own
    content["objects"] = objects
    text = yaml.dump(content, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=100)
    return HEADER + text


def _objects(
    parts: Sequence[Part], matches: Sequence[Match], stage: Path, folder: str
) -> tuple[list[dict[str, Any]], list[str]]:
    """Rows of a scene file, one for all copies of a part; writes their meshes into the stage."""
    groups: dict[Any, list[tuple[dict[str, Any], str, Floats]]] = {}
    stretched_meshes: dict[Any, trimesh.Trimesh] = {}
    files: dict[int, str] = {}
    for part, match in zip(parts, matches, strict=True):
        geometry, scale, pose = _placeable(part, stretched_meshes)
        if isinstance(geometry, trimesh.Trimesh):
            if id(geometry) not in files:
                files[id(geometry)] = _unique_file(part.name, files.values())
                geometry.export(stage / folder / files[id(geometry)], include_attributes=False)
            shape: dict[str, Any] = {"mesh": f"{folder}/{files[id(geometry)]}"}
        else:
            shape = _shape_row(geometry)
        if abs(scale - 1) > RIGID:
            shape["scale"] = float(f"{scale:.9g}")
        shape["material"] = match.material
        groups.setdefault(repr(shape), []).append((shape, part.name, pose))
    taken: set[str] = set()
    return [_row(copies, taken) for copies in groups.values()], list(files.values())


def _placeable(
    part: Part, stretched_meshes: dict[Any, trimesh.Trimesh]
) -> tuple[trimesh.Trimesh | Shape, float, Floats]:
    """A part as a scene file can place it: with one scale and a rigid pose (4, 4).

    Where its own pose does more, the mesh takes up the stretch, once for all parts that share both.
    """
    geometry, pose = part.geometry, part.to_world.copy()
    if not isinstance(geometry, trimesh.Trimesh) and (found := stretched(geometry, pose)):
        return found[0], 1.0, found[1]
    rotation, stretch = polar(pose[:3, :3])  # first the stretch
    if np.linalg.det(rotation) < 0:
        rotation, stretch = -rotation, -stretch
    pose[:3, :3] = rotation
    scale = float(np.trace(stretch)) / 3
    if scale > 0 and np.allclose(stretch / scale, np.eye(3), atol=RIGID):
        return geometry, scale, pose
    key = (id(geometry), tuple(np.round(stretch, 12).ravel()))
    if key not in stretched_meshes:
        matrix = np.eye(4)
        matrix[:3, :3] = stretch
        stretched_meshes[key] = as_mesh(geometry).copy().apply_transform(matrix)
    return stretched_meshes[key], 1.0, pose


def _row(copies: list[tuple[dict[str, Any], str, Floats]], taken: set[str]) -> dict[str, Any]:
    shape, name, pose = copies[0]
    row: dict[str, Any] = {"name": _unique_name(name, len(copies), taken), **shape}
    if len(copies) == 1:
        return row | _pose_row(pose)
    return row | {"instances": [_pose_row(pose) for _, _, pose in copies]}


def _pose_row(pose: Floats) -> dict[str, Any]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # at 90° of pitch there are many solutions
        angles = Rotation.from_matrix(pose[:3, :3]).as_euler("xyz", degrees=True)
    row: dict[str, Any] = {}
    if not np.allclose(pose_matrix(angles, (0, 0, 0))[:3, :3], np.eye(3), atol=EXACT):
        row["rotate_deg"] = _flow(angles, 9)
    if not np.allclose(pose[:3, 3], 0, atol=EXACT):
        row["translate_m"] = _flow(pose[:3, 3], 9)
    return row


def _shape_row(geometry: Any) -> dict[str, Any]:
    fields = geometry.model_dump(exclude={"name", "material"}, exclude_defaults=True)
    fields["shape"] = geometry.shape
    row = {"shape": fields.pop("shape")}
    for name, value in fields.items():
        row[name] = _flow(value, 9) if isinstance(value, tuple) else _flow([value], 9)[0]
    return row


def _flow(values: Iterable[float], digits: int) -> _Flow:
    """Rounded numbers, whole ones as such."""
    rounded = (round(float(value), digits) + 0.0 for value in values)
    return _Flow([int(value) if value == int(value) else value for value in rounded])


def _unique_name(name: str, copies: int, taken: set[str]) -> str:
    """A name, with a number where it is taken; copies are called name-1, name-2, … when loaded."""
    plain = re.sub(r"\s+", " ", re.sub(r"[^\w .:/+-]", " ", name)).strip()[:MAX_NAME] or "object"
    number = 1
    while True:
        candidate = plain if number == 1 else f"{plain} {number}"
        called = {candidate}
        if copies > 1:
            called |= {f"{candidate}-{i}" for i in range(1, copies + 1)}
        if not called & taken:
            taken |= called
            return candidate
        number += 1


def _unique_file(name: str, taken: Iterable[str]) -> str:
    plain = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")[:40] or "mesh"
    number, used = 1, set(taken)
    while (file := f"{plain}.ply" if number == 1 else f"{plain}_{number}.ply") in used:
        number += 1
    return file

"""Write parts as objects of a scene file, with their meshes."""

import re
import warnings
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.linalg import polar
from scipy.spatial.transform import Rotation

from reconstruction.base.arrays import Floats
from spisim.scene.pose import pose_matrix
from spisim_formats.library.content import Content, Glow, Haze, Part, Shape
from spisim_formats.library.drone import DronePose
from spisim_formats.library.lattice import Lattice, fill
from spisim_formats.library.materials import Match
from spisim_formats.library.shapes import as_mesh, stretched

#: Relative tolerance of rotations in single precision.
RIGID = 3e-7
EXACT = 1e-9
MAX_NAME = 80
#: Relative rounding error of a medium's density.
NO_RETURN = 1e-6

Meshes = dict[str, trimesh.Trimesh]
Arrays = dict[str, NDArray[Any]]


def scene_fields(
    name: str, content: Content, matches: Sequence[Match], drone: DronePose, source: str
) -> tuple[dict[str, Any], Meshes, Arrays]:
    """Return fields of a scene file, and its meshes and arrays by file name.

    `matches` are the materials of the content's parts.
    """
    arrays: Arrays = {}
    objects, meshes, lamps, names = _objects(content.parts, matches)
    fields: dict[str, Any] = {
        "name": name,
        "description": f"imported from {source}",
        "drone": {
            "position_m": _rounded(drone.position_m, 4),
            "look_at_m": _rounded(drone.look_at_m, 4),
        },
        "objects": objects,
    }
    if content.fog is not None:
        fields["fog"] = dict(content.fog)
    if content.hazes:
        taken: set[str] = set()
        fields["volumes"] = [
            row for haze in content.hazes for row in _haze_rows(haze, taken, meshes, arrays, names)
        ]
    named = {lamp["name"] for lamp in lamps}
    lamps += [_glow_row(glow, named, arrays) for glow in content.glows]
    if lamps:
        fields["lamps"] = lamps
    if content.daylight is not None:
        fields["ambient"] = {
            "sun_klx": round(content.daylight.sun_klx, 3),
            "sun_direction": _rounded(content.daylight.sun_direction, 6),
            "sky_klx": round(content.daylight.sky_klx, 3),
        }
    return fields, meshes, arrays


def _glow_row(glow: Glow, taken: set[str], arrays: Arrays) -> dict[str, Any]:
    row = {"name": _unique_name(glow.name, 1, taken), **glow.fields}
    if glow.position is not None:
        row["position_m"] = _rounded(glow.position, 6)
    if glow.direction is not None:
        row["direction"] = _rounded(glow.direction, 9)
    if glow.picture is not None:
        row["picture"] = _unique_file(glow.name, arrays, "npy")
        arrays[row["picture"]] = glow.picture
    if glow.axes is not None:
        pose = np.eye(4)
        pose[:3, :3] = glow.axes
        row |= _pose_row(pose)
    return row


def _haze_rows(
    haze: Haze, taken: set[str], meshes: Meshes, arrays: Arrays, names: Mapping[int, str]
) -> list[dict[str, Any]]:
    """Return a volume; for a varying albedo two: one that scatters, and one that absorbs the rest.

    `names` are those of the objects of all parts, by part number.
    """
    shape, box = _haze_shape(haze, meshes, names)
    if haze.density is None and haze.brightness is None:
        return [_volume(haze.name, shape, haze, haze.extinction, haze.albedo, taken)]
    even = Lattice(np.ones((1, 1, 1), np.float32), box)
    (density, brightness), _ = fill(box, (haze.density or even, haze.brightness or even))
    albedo = haze.albedo * float(brightness.max())
    scattering = density * brightness / (float(brightness.max()) or 1.0)
    absorbing = density - scattering
    rows = []
    for what, values, own in (("", scattering, albedo), ("absorbing", absorbing, 0.0)):
        peak = float(values.max())
        if peak <= NO_RETURN * float(density.max()):
            continue
        name = f"{haze.name} {what}".strip()
        row = _volume(name, shape, haze, haze.extinction * peak, own, taken)
        row["density"] = _unique_file(f"{name} density", arrays, "npy")
        arrays[row["density"]] = np.clip(values / peak, 0, 1).astype(np.float32)
        rows.append(row)
    return rows


def _volume(
    name: str, shape: dict[str, Any], haze: Haze, extinction: float, albedo: float, taken: set[str]
) -> dict[str, Any]:
    return {
        "name": _unique_name(name, 1, taken),
        **shape,
        "extinction_per_m": float(f"{extinction:.9g}"),
        "albedo": float(f"{albedo:.9g}"),
        "g": haze.g,
    }


def _haze_shape(
    haze: Haze, meshes: Meshes, names: Mapping[int, str]
) -> tuple[dict[str, Any], Floats]:
    """Return the extent of a volume in a scene file, and the box of its density (4, 4)."""
    box = np.eye(4)
    even = haze.density is None and haze.brightness is None
    if haze.part is not None and (even or haze.mesh is not None):
        if haze.mesh is not None:
            low, high = haze.mesh.copy().apply_transform(haze.to_world).bounds
            box[:3, :3], box[:3, 3] = np.diag(high - low), low
        return {"object": names[haze.part]}, box
    if haze.mesh is not None:
        file = _unique_file(f"{haze.name} bounds", meshes)
        meshes[file] = haze.mesh.copy().apply_transform(haze.to_world)
        low, high = meshes[file].bounds
        box[:3, :3], box[:3, 3] = np.diag(high - low), low
        return {"mesh": file}, box
    pose = haze.to_world.copy()
    size_m = np.linalg.norm(pose[:3, :3], axis=0)
    pose[:3, :3] /= size_m
    if np.linalg.det(pose[:3, :3]) < 0:  # a box is symmetric
        pose[:3, 0] *= -1
    box[:3, :3] = pose[:3, :3] * size_m
    box[:3, 3] = pose[:3, 3] - box[:3, :3].sum(axis=1) / 2
    return {"size_m": _rounded(size_m, 9), **_pose_row(pose)}, box


def _objects(
    parts: Sequence[Part], matches: Sequence[Match]
) -> tuple[list[dict[str, Any]], Meshes, list[dict[str, Any]], dict[int, str]]:
    """Return rows of a scene file, one for all copies of a part, meshes, and rows of area lamps.

    It also returns the object name of each part by number.
    """
    groups: dict[Any, list[tuple[dict[str, Any], str, Floats]]] = {}
    numbers: dict[Any, list[int]] = {}
    stretched_meshes: dict[Any, trimesh.Trimesh] = {}
    files: dict[int, str] = {}
    meshes: Meshes = {}
    for number, (part, match) in enumerate(zip(parts, matches, strict=True)):
        geometry, scale, pose = _placeable(part, stretched_meshes)
        if isinstance(geometry, trimesh.Trimesh):
            if id(geometry) not in files:
                files[id(geometry)] = _unique_file(part.name, meshes)
                meshes[files[id(geometry)]] = geometry
            shape: dict[str, Any] = {"mesh": files[id(geometry)]}
        else:
            shape = _shape_row(geometry)
        if abs(scale - 1) > RIGID:
            shape["scale"] = float(f"{scale:.9g}")
        shape["material"] = match.material
        key = part.radiance, repr(shape)
        groups.setdefault(key, []).append((shape, part.name, pose))
        numbers.setdefault(key, []).append(number)
    taken: set[str] = set()
    rows = [_row(copies, taken) for copies in groups.values()]
    lamps = [
        {"name": name, "type": "area", "object": name, "radiance_w_per_m2_sr": radiance}
        for (radiance, _), row in zip(groups, rows, strict=True)
        if radiance > 0
        for name in _names(row)
    ]
    names = {
        number: name
        for members, row in zip(numbers.values(), rows, strict=True)
        for number, name in zip(members, _names(row), strict=True)
    }
    return rows, meshes, lamps, names


def _names(row: Mapping[str, Any]) -> list[str]:
    """Return the names that a row's objects have when loaded."""
    copies = len(row.get("instances", ()))
    return [f"{row['name']}-{i}" for i in range(1, copies + 1)] or [row["name"]]


def _placeable(
    part: Part, stretched_meshes: dict[Any, trimesh.Trimesh]
) -> tuple[trimesh.Trimesh | Shape, float, Floats]:
    """Return a part that a scene file can place, with one scale and a rigid pose (4, 4).

    Any other stretch is applied to the mesh, once for all parts that share both.
    """
    geometry, pose = part.geometry, part.to_world.copy()
    if not isinstance(geometry, trimesh.Trimesh) and (result := stretched(geometry, pose)):
        return result[0], 1.0, result[1]
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
        warnings.simplefilter("ignore", UserWarning)  # the solution is not unique at 90° of pitch
        angles = Rotation.from_matrix(pose[:3, :3]).as_euler("xyz", degrees=True)
    row: dict[str, Any] = {}
    if not np.allclose(pose_matrix(angles, (0, 0, 0))[:3, :3], np.eye(3), atol=EXACT):
        row["rotate_deg"] = _rounded(angles, 9)
    if not np.allclose(pose[:3, 3], 0, atol=EXACT):
        row["translate_m"] = _rounded(pose[:3, 3], 9)
    return row


def _shape_row(geometry: Any) -> dict[str, Any]:
    fields = geometry.model_dump(exclude={"name", "material"}, exclude_defaults=True)
    fields["shape"] = geometry.shape
    row = {"shape": fields.pop("shape")}
    for name, value in fields.items():
        row[name] = _rounded(value, 9) if isinstance(value, tuple) else _rounded([value], 9)[0]
    return row


def _rounded(values: Iterable[float], digits: int) -> list[float]:
    """Round numbers, and convert whole ones to int."""
    rounded = (round(float(value), digits) + 0.0 for value in values)
    return [int(value) if value == int(value) else value for value in rounded]


def _unique_name(name: str, copies: int, taken: set[str]) -> str:
    """Return a name, numbered if taken; copies are named name-1, name-2, … when loaded."""
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


def _unique_file(name: str, taken: Iterable[str], suffix: str = "ply") -> str:
    plain = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")[:40] or "mesh"
    number, used = 1, set(taken)
    while (file := f"{plain}.{suffix}" if number == 1 else f"{plain}_{number}.{suffix}") in used:
        number += 1
    return file

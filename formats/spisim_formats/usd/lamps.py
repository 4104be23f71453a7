"""Lamps of OpenUSD stages (UsdLux), whose numbers are used as radiances, as Blender writes them.

https://openusd.org/release/user_guides/schemas/usdLux/usdLux_toc.html
"""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim_formats.library import shapes
from spisim_formats.library.content import Content, Glow, Part, Surface
from spisim_formats.library.files import Folders, quoted
from spisim_formats.library.surround import read_linear_red, surround

#: Material of a light panel that is off.
BLACK = (0.0, 0.0, 0.0)
#: Rotates y to z.
Z_POLE = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
DOMES = ("DomeLight", "DomeLight_1")
#: Lights that shine along their own -z, whereas triangles here face +z.
DOWN = np.diag([1.0, -1.0, -1.0, 1.0])


def read_lamp(prim: Any, to_world: Floats, content: Content, folders: Folders) -> list[Glow]:
    """Convert a light to a lamp, with a note; none if it gives no light, or is unknown."""
    kind, what = str(prim.GetTypeName()), f"lamp {quoted(prim.GetName())}"
    if kind not in MAKERS and kind not in DOMES:
        content.note(f"{what} is left out: {kind} is not read")
        return []
    strength = _strength(prim)
    if not 0 < strength < np.inf:
        content.note(f"{what} is left out: it gives no light")
        return []
    if kind in DOMES:
        return _dome(prim, strength, to_world, content, folders, what)
    try:
        glow, amount = MAKERS[kind](prim, strength, to_world)
    except InputError as error:
        content.note(f"{what} is left out: {error}")
        return []
    content.note(f"{what} has no unit; as watts {amount}")
    return [glow]


def _strength(prim: Any) -> float:
    color = _get(prim, "color", (1.0, 1.0, 1.0))
    intensity = float(_get(prim, "intensity", 1.0)) * 2.0 ** float(_get(prim, "exposure", 0.0))
    return intensity * float(np.mean(np.asarray(color, float)))


def _get(prim: Any, name: str, default: Any) -> Any:
    """Return an input of a light by its present name or that before 2021."""
    for each in (f"inputs:{name}", name):
        attribute = prim.GetAttribute(each)
        if attribute and (value := attribute.Get()) is not None:
            return value
    return default


def _is_normalized(prim: Any) -> bool:
    return bool(_get(prim, "normalize", False))


def _sphere(prim: Any, strength: float, to_world: Floats) -> tuple[Glow, str]:
    """Convert a sphere to a point of equal radiant intensity, or a spot if it has a cone."""
    scale = float(np.abs(np.linalg.det(to_world[:3, :3])) ** (1 / 3))
    radius = scale * float(_get(prim, "radius", 0.5))
    intensity = strength / 4 if _is_normalized(prim) else strength * np.pi * radius**2
    fields: dict[str, Any] = {"type": "point", "intensity_w_per_sr": intensity}
    angle = float(_get(prim, "shaping:cone:angle", 180.0))
    direction = None
    if 0 < angle < 90:
        softness = float(np.clip(_get(prim, "shaping:cone:softness", 0.0), 0, 1))
        fields |= {"type": "spot", "cutoff_deg": angle, "beam_deg": angle * (1 - softness)}
        direction = _forward(to_world)
    glow = Glow(prim.GetName(), fields, to_world[:3, 3], direction)
    return glow, f"{intensity:.4g} W/sr"


def _distant(prim: Any, strength: float, to_world: Floats) -> tuple[Glow, str]:
    """Convert a distant disc, to all of the sky if requested."""
    angle = np.radians(float(_get(prim, "angle", 0.53)))
    disc = np.pi * np.sin(min(angle, np.pi) / 2) ** 2
    irradiance = strength if _is_normalized(prim) or not disc > 0 else strength * disc
    fields = {"type": "directional", "irradiance_w_per_m2": float(irradiance)}
    return Glow(prim.GetName(), fields, None, _forward(to_world)), f"{irradiance:.4g} W/m²"


def _rectangle(prim: Any, strength: float, to_world: Floats) -> tuple[Glow, str]:
    size = [float(_get(prim, "width", 1.0)), float(_get(prim, "height", 1.0))]
    mesh = shapes.as_mesh(shapes.rectangle(size, "it"))
    return _panel(prim, mesh.copy().apply_transform(DOWN), strength, to_world)


def _disk(prim: Any, strength: float, to_world: Floats) -> tuple[Glow, str]:
    mesh = shapes.disk().apply_scale(float(_get(prim, "radius", 0.5)))
    return _panel(prim, mesh.apply_transform(DOWN), strength, to_world)


def _cylinder(prim: Any, strength: float, to_world: Floats) -> tuple[Glow, str]:
    """Convert a cylinder about x, open at both ends."""
    half = float(_get(prim, "length", 1.0)) / 2
    start, stop = np.array([[-half, 0, 0], [half, 0, 0]])
    mesh = shapes.tube(start, stop, float(_get(prim, "radius", 0.5)), "it")
    return _panel(prim, mesh, strength, to_world)


def _panel(prim: Any, mesh: trimesh.Trimesh, strength: float, to_world: Floats) -> tuple[Glow, str]:
    """Convert a panel to a black surface that emits."""
    area = float(mesh.copy().apply_transform(to_world).area)
    radiance = strength / area if _is_normalized(prim) and area > 0 else strength
    part = Part(prim.GetName(), mesh, to_world, Surface(None, BLACK), radiance)
    return Glow(prim.GetName(), {}, panel=part), f"{radiance:.4g} W/(m² sr)"


def _dome(
    prim: Any, strength: float, to_world: Floats, content: Content, folders: Folders, what: str
) -> list[Glow]:
    """Convert a uniform dome, or one with an environment map in OpenEXR's layout."""
    name = prim.GetName()
    fields = {"type": "environment", "radiance_w_per_m2_sr": strength}
    asset = _get(prim, "texture:file", None)
    reference = "" if asset is None else str(asset.path)
    if not reference:
        content.note(f"{what} has no unit; as watts {strength:.4g} W/(m² sr)")
        return [Glow(name, fields)]
    try:
        if str(_get(prim, "texture:format", "automatic")) not in ("automatic", "latlong"):
            raise InputError("only pictures by latitude and longitude are read")
        path = folders.find(reference, folders.roots[0], "its picture")
        picture, axes = surround(read_linear_red(path), _upright(prim, to_world), path.name)
    except InputError as error:
        content.note(f"{what} is left out: {error}")
        return []
    brightest = strength * float(picture.max())
    content.note(f"{what} has no unit; as watts up to {brightest:.4g} W/(m² sr)")
    return [Glow(name, fields, None, None, picture, axes)]


def _upright(prim: Any, to_world: Floats) -> Floats:
    """Return the pose of a dome whose pole is y or the stage's up (OpenUSD 24.03 and later)."""
    from pxr import UsdGeom

    if str(prim.GetTypeName()) == "DomeLight":
        return to_world
    pole = str(_get(prim, "poleAxis", "scene"))
    axis = UsdGeom.GetStageUpAxis(prim.GetStage()) if pole == "scene" else pole
    return to_world @ Z_POLE if str(axis) == "Z" else to_world


def _forward(to_world: Floats) -> Floats:
    direction = -to_world[:3, 2]
    return np.asarray(direction / (np.linalg.norm(direction) or 1.0))


MAKERS = {
    "SphereLight": _sphere,
    "DistantLight": _distant,
    "RectLight": _rectangle,
    "DiskLight": _disk,
    "CylinderLight": _cylinder,
}

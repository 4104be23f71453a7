"""Mitsuba 3 scenes (.xml): shapes, what their bsdfs say of materials, and the sensor.

Mitsuba itself is not needed. https://mitsuba.readthedocs.io/en/stable/src/key_topics/scene_format.html
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from reconstruction.errors import InputError, naming, nearest
from spisim.scene.importing import shapes
from spisim.scene.importing.files import Folders
from spisim.scene.importing.meshes import read_obj, read_ply
from spisim.scene.importing.mitsuba_file import Item, SceneFile, read_scene_file
from spisim.scene.importing.model import (
    Content,
    Floats,
    Part,
    Shape,
    Surface,
    check_triangles,
    scaling,
    translation,
)
from spisim.scene.importing.xml import numbers

MESHES = {"obj": read_obj, "ply": read_ply}
#: What Mitsuba calls metals, as words.
METALS = {"Al": "aluminium", "Zn": "zinc", "Cr": "chrome"}
#: Shapes of Mitsuba that have no counterpart here.
LEFT_OUT = ("instance", "shapegroup", "bsplinecurve", "linearcurve", "sdfgrid", "ellipsoids",
            "ellipsoidsmesh", "merge")  # fmt: skip


@np.errstate(all="ignore")  # poses are checked to be finite in the end
def read_mitsuba(path: Path, folders: Folders) -> Content:
    """Parts of a Mitsuba scene; up is that of the sensor's `lookat`, else z.

    Raises InputError for what cannot be read, refers to what is not there, or includes itself.
    """
    content = Content(unit_why="Mitsuba has no unit: metres", up_why="Mitsuba has no up: z")
    scene = read_scene_file(path, folders)
    reader = _Shapes(scene, folders, content)
    for item in scene.items:
        if item.tag == "shape":
            reader.add(item)
        elif item.tag == "sensor" and content.camera is None:
            _take_sensor(item, content)
        elif item.tag == "emitter":
            content.note("emitters are left out: give daylight under `ambient` in the scene file")
    if not content.parts:
        raise InputError(f"{path}: has no shapes that can be read")
    return content


class _Shapes:
    """Reads shapes into a content."""

    def __init__(self, scene: SceneFile, folders: Folders, content: Content) -> None:
        self._scene = scene
        self._folders = folders
        self._content = content
        self._files: dict[Path, list[Part]] = {}

    def add(self, item: Item) -> None:
        kind = item.attributes.get("type", "")
        if kind in LEFT_OUT:
            self._content.note(f"{item.what}: shapes of this type are left out")
            return
        name = item.attributes.get("id") or item.attributes.get("name") or kind
        to_world = transform(item.named("to_world"))
        surface = self._surface(item)
        if kind in MESHES:
            parts = self._mesh(item, kind)
            if kind == "obj" and parts:
                name = item.attributes.get("id") or Path(item.value("filename") or name).stem
        elif kind in SIMPLE:
            geometry, pose = SIMPLE[kind](item)
            parts = [Part(name, geometry, pose, surface)]
        else:
            hint = "export the mesh as PLY" if kind == "serialized" else ""
            known = hint or nearest(kind, (*MESHES, *SIMPLE))
            raise InputError(f"{item.path}: {item.what}: shape {kind!r} is not supported: {known}")
        for part in parts:
            geometry = part.geometry
            if item.flag("flip_normals"):
                geometry = shapes.as_mesh(geometry).copy()
                geometry.invert()
            self._content.add(Part(name, geometry, to_world @ part.to_world, surface))

    def _mesh(self, item: Item, kind: str) -> list[Part]:
        what = item.what
        path = self._folders.find(item.value("filename") or "", item.path.parent, what)
        if path not in self._files:
            with naming(what):
                content = MESHES[kind](path, self._folders)
            for note in content.notes:
                self._content.note(note)
            self._files[path] = content.parts
            loaded = (part for parts in self._files.values() for part in parts)
            check_triangles(sum(len(shapes.as_mesh(part.geometry).faces) for part in loaded))
        return self._files[path]

    def _surface(self, shape: Item) -> Surface:
        """What the bsdf of a shape says: its id, its colour, its type and those within it."""
        for child in shape.children:
            if (outer := self._scene.resolve(child)).tag == "bsdf":
                break
        else:
            return Surface()
        bsdfs = self._nested(outer)
        names = [bsdf.attributes["id"] for bsdf in bsdfs if "id" in bsdf.attributes]
        metals = [METALS.get(name, "metal") for bsdf in bsdfs if (name := bsdf.value("material"))]
        types = [re.sub("^rough|^thin", "", bsdf.attributes.get("type", "")) for bsdf in bsdfs]
        inside = [self._scene.resolve(child) for bsdf in bsdfs for child in bsdf.children]
        for item in inside:
            if item.tag == "texture" and (name := item.value("filename")) is not None:
                self._content.note_texture(name, item.path.parent, self._folders, item.what)
        colors = [_color(item) for item in inside if item.tag == "rgb" and _is_body(item)]
        return Surface(
            names[0] if names else None, colors[0] if colors else None, (*metals, *types)
        )

    def _nested(self, outer: Item) -> list[Item]:
        """A bsdf and those within it, each once."""
        found = [outer]
        for bsdf in found:
            for child in bsdf.children:
                inner = self._scene.resolve(child)
                if inner.tag == "bsdf" and not any(inner is known for known in found):
                    found.append(inner)
        return found


def transform(item: Item | None) -> Floats:
    """(4, 4) matrix of a `<transform>`: its steps, the first one done first; identity for None."""
    matrix = np.eye(4)
    for step in item.children if item is not None else ():
        if step.tag not in STEPS:
            raise InputError(f"{step.path}: transform {step.tag!r}: {nearest(step.tag, STEPS)}")
        matrix = STEPS[step.tag](step) @ matrix
    return matrix


def _rotate(step: Item) -> Floats:
    angle = numbers(step.attributes.get("angle"), 1, f"{step.path}: rotate: angle")[0]
    axis = np.array(step.vector(0.0))
    if not np.linalg.norm(axis) > 0:
        raise InputError(f"{step.path}: rotate: its axis is zero")
    matrix = np.eye(4)
    turn = axis / np.linalg.norm(axis) * math.radians(angle)
    matrix[:3, :3] = Rotation.from_rotvec(turn).as_matrix()
    return matrix


def _matrix(step: Item) -> Floats:
    text = step.attributes.get("value", "")
    if len(text.replace(",", " ").split()) == 9:
        matrix = np.eye(4)
        matrix[:3, :3] = np.reshape(numbers(text, 9, f"{step.path}: matrix"), (3, 3))
        return matrix
    return np.reshape(numbers(text, 16, f"{step.path}: matrix"), (4, 4))


def _lookat(step: Item) -> Floats:
    """x to the left, y up, z to the target, as Mitsuba has it."""
    origin, target, up = (
        np.array(numbers(step.attributes.get(name, default), 3, f"{step.path}: lookat: {name}"))
        for name, default in (("origin", None), ("target", None), ("up", "0 0 1"))
    )
    forward = target - origin
    left = np.cross(up, forward)
    if not (np.linalg.norm(forward) > 0 and np.linalg.norm(left) > 0):
        raise InputError(f"{step.path}: lookat: up is along the view, or target is origin")
    forward, left = forward / np.linalg.norm(forward), left / np.linalg.norm(left)
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([left, np.cross(forward, left), forward, origin])
    return matrix


STEPS: dict[str, Callable[[Item], Floats]] = {
    "translate": lambda step: translation(step.vector(0.0)),
    "scale": lambda step: scaling(step.vector(1.0)),
    "rotate": _rotate,
    "matrix": _matrix,
    "lookat": _lookat,
}


def _sphere(item: Item) -> tuple[Shape | trimesh.Trimesh, Floats]:
    return shapes.sphere(item.number("radius", 1.0), item.what), translation(
        item.point("center", [0, 0, 0])
    )


def _cylinder(item: Item) -> tuple[Shape | trimesh.Trimesh, Floats]:
    start, stop = np.array(item.point("p0", [0, 0, 0])), np.array(item.point("p1", [0, 0, 1]))
    return shapes.tube(start, stop, item.number("radius", 1.0), item.what), np.eye(4)


SIMPLE: dict[str, Callable[[Item], tuple[Shape | trimesh.Trimesh, Floats]]] = {
    "rectangle": lambda item: (shapes.rectangle([2.0, 2.0], item.what), np.eye(4)),
    "cube": lambda item: (shapes.box([2.0, 2.0, 2.0], item.what), np.eye(4)),
    "sphere": _sphere,
    "cylinder": _cylinder,
    "disk": lambda item: (shapes.disk(), np.eye(4)),
}


def _take_sensor(item: Item, content: Content) -> None:
    """The pose of the scene's first sensor, and which way it holds to be up."""
    steps = item.named("to_world")
    content.camera = transform(steps)
    for step in steps.children if steps is not None else ():
        if step.tag == "lookat":
            up = numbers(step.attributes.get("up", "0 0 1"), 3, "lookat: up")
            largest = int(np.argmax(np.abs(up)))
            if up[largest] > 0.9 * np.linalg.norm(up):
                content.up = ("x", "y", "z")[largest]
                content.up_why = "up of the sensor's lookat"


def _is_body(item: Item) -> bool:
    """Whether a colour is that of a surface's body, not of its gloss."""
    name = item.attributes.get("name", "")
    return name in ("reflectance", "diffuse_reflectance", "base_color")


def _color(item: Item) -> tuple[float, float, float]:
    text = item.attributes.get("value", "").strip()
    if re.fullmatch("#[0-9a-fA-F]{6}", text):
        red, green, blue = (int(text[i : i + 2], 16) / 255 for i in (1, 3, 5))
        return red, green, blue
    count = len(text.replace(",", " ").split())
    values = numbers(text, 1 if count == 1 else 3, item.what)
    red, green, blue = values * 3 if count == 1 else values
    return red, green, blue

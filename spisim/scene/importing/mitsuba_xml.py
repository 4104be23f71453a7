"""Mitsuba 3 scenes (.xml): shapes, what their bsdfs say of materials, and the sensor.

https://mitsuba.readthedocs.io/en/stable/src/key_topics/scene_format.html
"""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh

from reconstruction.arrays import Floats
from reconstruction.errors import InputError, naming, nearest
from spisim.scene.importing import shapes
from spisim.scene.importing.files import Folders
from spisim.scene.importing.meshes import read_obj, read_ply
from spisim.scene.importing.mitsuba_file import Node, Parse, read_elements
from spisim.scene.importing.model import Content, Part, Shape, Surface, translation
from spisim.scene.shapes import check_triangles

MESHES = {"obj": read_obj, "ply": read_ply}
#: What Mitsuba calls metals, as words.
METALS = {"Al": "aluminium", "Zn": "zinc", "Cr": "chrome"}
#: Shapes of Mitsuba that have no counterpart here.
LEFT_OUT = ("instance", "shapegroup", "bsplinecurve", "linearcurve", "sdfgrid", "ellipsoids",
            "ellipsoidsmesh", "merge")  # fmt: skip
#: The colours of a surface's body, not of its gloss.
BODY = ("reflectance", "diffuse_reflectance", "base_color")


@np.errstate(all="ignore")  # poses are checked to be finite in the end
def read_scene(path: Path, folders: Folders, parse: Parse) -> Content:
    """Parts of a Mitsuba scene; up is that of the sensor's `lookat`, else z.

    Raises InputError for what cannot be read, refers to what is not there, or includes itself.
    """
    content = Content(unit_why="Mitsuba has no unit: metres", up_why="Mitsuba has no up: z")
    reader = _Shapes(path, folders, content)
    for node in parse(read_elements(path, folders)).children:
        if node.kind == "shape":
            reader.add(node)
        elif node.kind == "sensor" and content.camera is None:
            _take_sensor(node, content)
        elif node.kind == "emitter":
            content.note("emitters are left out: give daylight under `ambient` in the scene file")
    if not content.parts:
        raise InputError(f"{path}: has no shapes that can be read")
    return content


class _Shapes:
    """Reads shapes into a content."""

    def __init__(self, path: Path, folders: Folders, content: Content) -> None:
        self._folder = path.parent
        self._folders = folders
        self._content = content
        self._files: dict[Path, list[Part]] = {}

    def add(self, node: Node) -> None:
        kind = node.type
        if kind in LEFT_OUT:
            self._content.note(f"{node.what}: shapes of this type are left out")
            return
        name = node.id or node.name or kind
        to_world = node.value("to_world", np.eye(4))
        surface = self._surface(node)
        if kind in MESHES:
            parts = self._mesh(node)
            if kind == "obj" and parts:
                name = node.id or Path(node.value("filename", name)).stem
        elif kind in SIMPLE:
            geometry, pose = SIMPLE[kind](node)
            parts = [Part(name, geometry, pose, surface)]
        else:
            hint = "export the mesh as PLY" if kind == "serialized" else ""
            known = hint or nearest(kind, (*MESHES, *SIMPLE))
            raise InputError(f"{node.what}: shape {kind[:80]!r} is not supported: {known}")
        for part in parts:
            geometry = part.geometry
            if node.value("flip_normals", False):
                geometry = shapes.as_mesh(geometry).copy()
                geometry.invert()
            self._content.add(Part(name, geometry, to_world @ part.to_world, surface))

    def _mesh(self, node: Node) -> list[Part]:
        what = node.what
        path = self._folders.find(node.value("filename", ""), self._folder, what)
        if path not in self._files:
            with naming(what):
                content = MESHES[node.type](path, self._folders)
            for note in content.notes:
                self._content.note(note)
            self._files[path] = content.parts
            loaded = (part for parts in self._files.values() for part in parts)
            check_triangles(sum(len(shapes.as_mesh(part.geometry).faces) for part in loaded))
        return self._files[path]

    def _surface(self, shape: Node) -> Surface:
        """What the bsdf of a shape says: its id, its colour, its type and those within it."""
        outer = next((each for each in shape.children if each.kind == "bsdf"), None)
        if outer is None:
            return Surface()
        bsdfs = _nested(outer)
        names = [bsdf.id for bsdf in bsdfs if bsdf.id]
        metals = [name for bsdf in bsdfs if (name := bsdf.value("material", ""))]
        types = [re.sub("^rough|^thin", "", bsdf.type) for bsdf in bsdfs]
        for node in (each for bsdf in bsdfs for each in bsdf.children):
            if node.kind == "texture" and (name := node.value("filename", "")):
                self._content.note_texture(name, self._folder, self._folders, node.what)
        colors = [
            (float(value[0]), float(value[1]), float(value[2]))
            for bsdf in bsdfs
            for name, value in bsdf.properties.items()
            if name in BODY and np.shape(value) == (3,)
        ]
        words = (*(METALS.get(name, "metal") for name in metals), *types)
        return Surface(names[0] if names else None, colors[0] if colors else None, words)


def _nested(outer: Node) -> list[Node]:
    """A bsdf and those within it, each once."""
    found, known = [outer], {outer}
    for bsdf in found:
        for inner in bsdf.children:
            if inner.kind == "bsdf" and inner not in known:
                found.append(inner)
                known.add(inner)
    return found


def _sphere(node: Node) -> tuple[Shape | trimesh.Trimesh, Floats]:
    center = node.value("center", np.zeros(3))
    return shapes.sphere(node.value("radius", 1.0), node.what), translation(center)


def _cylinder(node: Node) -> tuple[Shape | trimesh.Trimesh, Floats]:
    start, stop = node.value("p0", np.zeros(3)), node.value("p1", np.array([0.0, 0.0, 1.0]))
    return shapes.tube(start, stop, node.value("radius", 1.0), node.what), np.eye(4)


SIMPLE: dict[str, Callable[[Node], tuple[Shape | trimesh.Trimesh, Floats]]] = {
    "rectangle": lambda node: (shapes.rectangle([2.0, 2.0], node.what), np.eye(4)),
    "cube": lambda node: (shapes.box([2.0, 2.0, 2.0], node.what), np.eye(4)),
    "sphere": _sphere,
    "cylinder": _cylinder,
    "disk": lambda node: (shapes.disk(), np.eye(4)),
}


def _take_sensor(node: Node, content: Content) -> None:
    """The pose of the scene's first sensor, and which axis its `lookat` holds to be up."""
    content.camera = node.value("to_world", np.eye(4))
    up = node.value("up", np.zeros(3))
    largest = int(np.argmax(np.abs(up)))
    if up[largest] > 0.9 * np.linalg.norm(up):
        content.up = ("x", "y", "z")[largest]
        content.up_why = "up of the sensor's lookat"

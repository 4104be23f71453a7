"""Mitsuba 3 scenes (.xml): shapes, what their bsdfs say of materials, media, and sensors.

https://mitsuba.readthedocs.io/en/stable/src/key_topics/scene_format.html
"""

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import TypeAlias

import numpy as np
import trimesh

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError, naming, nearest
from spisim.scene.shapes import check_triangles
from spisim_formats.library import shapes
from spisim_formats.library.content import Content, Part, Shape, Surface, translation
from spisim_formats.library.files import Folders
from spisim_formats.library.opacity import Opacity
from spisim_formats.library.source_material import SourceMaterial
from spisim_formats.library.textures import Texture, has_holes
from spisim_formats.meshes.reading import read_obj, read_ply
from spisim_formats.mitsuba.bsdf import opacity, source_surface
from spisim_formats.mitsuba.elements import Node, Source, read_source, unread_nodes
from spisim_formats.mitsuba.light import Air, take_emitter, take_medium
from spisim_formats.mitsuba.parsing import parse
from spisim_formats.mitsuba.serialized import read_serialized

MESHES = {"obj": read_obj, "ply": read_ply}
#: Words for Mitsuba's metals; others are bare conductors.
METALS = {"Al": "aluminium", "Zn": "zinc", "Cr": "chrome", "Cu": "copper"}
#: Unsupported shapes of Mitsuba.
LEFT_OUT = ("bsplinecurve", "linearcurve", "sdfgrid", "ellipsoids", "ellipsoidsmesh")
#: Shapes that only others refer to.
GROUP = "shapegroup"
#: Colours of a surface's diffuse part.
BODY = ("reflectance", "diffuse_reflectance", "base_color")
_Optics: TypeAlias = tuple[Callable[[], SourceMaterial | None], Callable[[], Opacity | None]]
#: Tolerance of rotation and scale; Mitsuba writes about six digits.
BOX_TOLERANCE = 1e-4


@np.errstate(all="ignore")  # poses are checked later to be finite
def read_mitsuba(path: Path, folders: Folders) -> Content:
    """Read the parts of a Mitsuba scene; up is that of the sensor's `lookat`, else z.

    Shapes that cannot be read or have dangling references are left out with a note. Raises
    InputError if nothing is left, for circular includes, and for what Mitsuba's parser rejects.
    """
    content = Content(unit_why="Mitsuba has no unit: metres", up_why="Mitsuba has no up: z")
    source = read_source(path, folders)
    for each in source.left_out:
        content.note(f"{path.name}: not read of {each}")
    reader, air = _Shapes(source, folders, content), Air()
    scene = parse(source.elements)
    content.records.append((path.name, partial(unread_nodes, scene)))
    for node in scene.children:
        with content.leaving_out(node.what, node.forget):
            if node.kind == "shape":
                reader.add(node, np.eye(4), air)
            elif node.kind == "sensor":
                _take_sensor(node, content)
                air.around += [each for each in node.children if each.kind == "medium"]
            elif node.kind == "emitter":
                take_emitter(node, content, reader.file)
                air.outside += [each for each in node.children if each.kind == "medium"]
    air.take(content)
    content.check_not_empty(path, "has no shapes that can be read")
    return content


class _Shapes:
    """Reads shapes into a content."""

    def __init__(self, source: Source, folders: Folders, content: Content) -> None:
        self._source = source
        self._folders = folders
        self._content = content
        self._files: dict[tuple[Path, int], list[Part]] = {}
        self._textures: dict[int, Texture | None] = {}
        self._surfaces: dict[tuple[int, bool], _Optics] = {}

    def add(self, node: Node, parent: Floats, air: Air) -> None:
        """Add the parts of a shape, where `parent` is the pose of its group."""
        to_world = parent @ node.value("to_world", np.eye(4))
        if node.type == "instance":
            for group in (each for each in node.children if each.type == GROUP):
                self._add_all(group, to_world, air)
        elif node.type == "merge":
            self._add_all(node, to_world, air)
        elif node.type != GROUP:
            self._add_one(node, to_world, air)

    def _add_all(self, group: Node, to_world: Floats, air: Air) -> None:
        for inner in group.children:
            if inner.kind == "shape" and inner.type in (GROUP, "instance", "merge"):
                self._content.note(f"{inner.what} within {group.what} is left out")
            elif inner.kind == "shape":
                self.add(inner, to_world, air)

    def _add_one(self, node: Node, to_world: Floats, air: Air) -> None:
        kind = node.type.lower()
        if kind in LEFT_OUT:
            self._content.note(f"{node.what}: shapes of this type are left out")
            node.forget()
            return
        name = node.id or node.name or kind
        parts, is_flipped = self._parts(node, kind, name), node.value("flip_normals", False)
        if kind in MESHES and parts:
            name = node.id or Path(node.value("filename", name)).stem
        surface, radiance = self._surface(node), 0.0
        for each in node.children:
            with self._content.leaving_out(each.what, each.forget):
                if each.kind == "medium" and node.properties.get("exterior") is each:
                    air.outside.append(each)
                if each.kind == "emitter":
                    radiance += take_emitter(each, self._content, self.file, name)
                elif each.kind == "medium" and node.properties.get("interior") is each:
                    placed = [replace(part, to_world=to_world @ part.to_world) for part in parts]
                    boxes = [_as_box(part, to_world) for part in parts]
                    first = None if surface is None else len(self._content.parts)
                    air.inside.add(each)
                    take_medium(each, placed, boxes, name, self._content, self.file, first)
        if surface is None:
            self._content.note(f"{node.what}: its surface is null, nothing but a bound of a medium")
            return
        for part in parts:
            geometry = part.geometry
            if is_flipped:
                geometry = shapes.as_mesh(geometry).copy()
                geometry.invert()
            self._content.add(Part(name, geometry, to_world @ part.to_world, surface, radiance))

    def _parts(self, node: Node, kind: str, name: str) -> list[Part]:
        """Return the geometry of a shape in its own coordinates."""
        if kind in MESHES or kind == "serialized":
            return self._mesh(node, kind)
        if kind in SIMPLE:
            geometry, pose = SIMPLE[kind](node)
            return [Part(name, geometry, pose, Surface())]
        candidate = nearest(kind, (*MESHES, "serialized", *SIMPLE, "instance", "merge"))
        raise InputError(f"{node.what}: shape {kind[:80]!r} is not supported: {candidate}")

    def file(self, node: Node) -> Path:
        """Return the file that a node names. Raises InputError if it is missing or forbidden."""
        beside, *more = self._source.folders
        return self._folders.find(node.value("filename", ""), beside, node.what, more)

    def _mesh(self, node: Node, kind: str) -> list[Part]:
        what, path = node.what, self.file(node)
        key = (path, int(node.value("shape_index", 0.0)))
        if key not in self._files:
            with naming(what):
                if kind == "serialized":
                    name, mesh = read_serialized(*key)
                    self._files[key] = [Part(name, mesh, np.eye(4), Surface())]
                else:
                    content = MESHES[kind](path, self._folders)
                    self._files[key] = content.parts
                    self._content.adopt(content)
            loaded = (part for parts in self._files.values() for part in parts)
            check_triangles(sum(len(shapes.as_mesh(part.geometry).faces) for part in loaded))
        return self._files[key]

    def _surface(self, shape: Node) -> Surface | None:
        """Return what the bsdf of a shape gives: its id, colour, type and nested types.

        None for a null bsdf, which does not affect light.
        """
        outer = next((each for each in shape.children if each.kind == "bsdf"), None)
        if outer is None:
            return Surface()
        if outer.type == "null":
            return None
        bsdfs = _nested(outer)
        names = [bsdf.id for bsdf in bsdfs if bsdf.id]
        metals = [name for bsdf in bsdfs if (name := bsdf.value("material", ""))]
        types = [re.sub("^rough|^thin", "", bsdf.type) for bsdf in bsdfs]
        bodies = [bsdf.properties[name] for bsdf in bsdfs for name in BODY
                  if name in bsdf.properties]  # fmt: skip
        textures = [
            self._texture(value)
            for value in bodies
            if isinstance(value, Node) and value.kind == "texture" and value.value("filename", "")
        ]
        colors = [
            (float(value[0]), float(value[1]), float(value[2]))
            for value in bodies
            if np.shape(value) == (3,)
        ]
        words = (*(METALS[name] for name in metals if name in METALS), *types)
        body = next(filter(None, textures), None)
        flips = shape.type == "obj" and shape.value("flip_tex_coords", True)
        source, opacity = self._optics(outer, flips)
        color = colors[0] if colors else None
        return Surface(names[0] if names else None, color, words, body, source, opacity)

    def _optics(self, bsdf: Node, flips: bool) -> _Optics:
        """Return one material, and one opacity, for all shapes that share a bsdf."""
        key = id(bsdf), flips
        if key not in self._surfaces:
            opaque = partial(opacity, bsdf, flips, self._texture)
            self._surfaces[key] = (
                cache(partial(source_surface, bsdf, flips, self._texture)),
                cache(partial(self._content.attempt, f"{bsdf.what}: opacity", opaque)),
            )
        return self._surfaces[key]

    def _texture(self, node: Node) -> Texture | None:
        """Return the image of a texture, of which only the mean fits Mitsuba's mapping."""
        key = id(node)
        if key not in self._textures:
            beside, *more = self._source.folders
            name = node.value("filename", "")
            result = self._content.texture(name, beside, self._folders, node.what, more)
            if result is not None:
                if node.name == "opacity" and has_holes(result.source):
                    self._content.note(f"{node.what}: its alpha is not used, as in Mitsuba")
                result = replace(result, fits=False, linear=node.value("raw", False))
            self._textures[key] = result
        return self._textures[key]


def _as_box(part: Part, to_world: Floats) -> Floats | None:
    """Return the pose (4, 4) of a unit cube about the origin that equals this part, or None."""
    mesh = shapes.as_mesh(part.geometry)
    low, high = mesh.bounds
    corner = np.isclose(mesh.vertices, low, atol=1e-6 * mesh.scale) | np.isclose(
        mesh.vertices, high, atol=1e-6 * mesh.scale
    )
    whole = np.isclose(mesh.area, 2 * np.sum((high - low) * np.roll(high - low, 1)), rtol=1e-6)
    if not (corner.all() and whole):
        return None
    pose = to_world @ part.to_world @ translation((low + high) / 2) @ np.diag([*(high - low), 1.0])
    across = pose[:3, :3] / np.linalg.norm(pose[:3, :3], axis=0)
    upright = np.allclose(across.T @ across, np.eye(3), atol=BOX_TOLERANCE)
    return pose if upright else None


def _nested(outer: Node) -> list[Node]:
    """Return a bsdf and all nested ones, each once; of a mixture the first alone."""
    result, given = [outer], {outer}
    for bsdf in result:
        inside = [each for each in bsdf.children if each.kind == "bsdf"]
        for inner in inside[: 1 if bsdf.type == "blendbsdf" else None]:
            if inner not in given:
                result.append(inner)
                given.add(inner)
    return result


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
    """Read the pose of a sensor, and the up axis of the first one's `lookat`."""
    first = not content.cameras
    content.cameras.append(node.value("to_world", np.eye(4)))
    up = node.value("up", np.zeros(3))
    largest = int(np.argmax(np.abs(up)))
    if first and up[largest] > 0.9 * np.linalg.norm(up):
        content.up = ("x", "y", "z")[largest]
        content.up_why = "up of the sensor's lookat"

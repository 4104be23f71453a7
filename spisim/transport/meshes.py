"""The surfaces of a scene as Mitsuba meshes: one for each material.

A few large meshes are built and traced much faster than many small ones, because each surface that
a path meets is a virtual call over all shapes and materials.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from typing import Any
from weakref import WeakKeyDictionary

import drjit as dr
import mitsuba as mi
import numpy as np
import trimesh
from numpy.typing import NDArray

from spisim.scene import SceneObject, texture_coordinates
from spisim.scene.content import material_content, surface_content
from spisim.transport.bsdf import bsdf_dict, is_null_transmitting
from spisim.transport.jit import Bool, Hit, Int, Object, UInt


@dataclass(frozen=True, eq=False)
class Meshes:
    """The meshes of some objects in a Mitsuba scene, and the owner of each triangle."""

    scene: Object  # mi.Scene
    see_through: bool  # whether any of them lets light straight through
    _shapes: NDArray[np.int64]  # index by Dr.Jit's number of a shape, -1 for other scenes'
    _first: NDArray[np.int64]  # index of each shape's first triangle, and number of all
    _starts: NDArray[np.int64]  # index of each object's first triangle, in the order of the shapes
    _objects: NDArray[np.int64]  # indices of the objects in this order

    @classmethod
    def of(cls, objects: Sequence[SceneObject]) -> "Meshes":
        """Meshes of objects, from the cache if nothing about the objects has changed."""
        key = str(mi.variant()).encode() + surface_content(objects)
        content, cached = _CACHED.get(objects[0], (b"", None)) if objects else (b"", None)
        if cached is None or content != key:
            _CACHED.clear()
            cached = cls._made(objects)
            if objects:
                _CACHED[objects[0]] = key, cached
        return cached

    @classmethod
    def _made(cls, objects: Sequence[SceneObject]) -> "Meshes":
        groups = _by_material(objects)
        in_order = [number for group in groups for number in group]
        starts = [0, *accumulate(len(objects[number].mesh.faces) for number in in_order)]
        firsts = [0, *accumulate(map(len, groups))]
        scene = mi.load_dict({"type": "scene", **shapes(objects)})
        numbers = [int(_registry_ids(mi.ShapePtr(shape))[0]) for shape in scene.shapes()]
        shape_of = np.full(max(numbers, default=0) + 1, -1)
        shape_of[numbers] = np.arange(len(numbers))
        return cls(
            scene,
            any(is_null_transmitting(thing.material) for thing in objects),
            shape_of,
            np.array([starts[first] for first in firsts], dtype=np.int64),
            np.array(starts),
            np.array(in_order, dtype=np.int64),
        )

    @property
    def triangles(self) -> int:
        """Number of triangles of all objects."""
        return int(self._starts[-1])

    def triangles_of(self, number: int) -> slice:
        """Indices of an object's triangles, in their order."""
        (index,) = np.flatnonzero(self._objects == number)
        return slice(int(self._starts[index]), int(self._starts[index + 1]))

    @cached_property
    def _first_of(self) -> UInt:
        """Index of the first triangle of a shape, by Dr.Jit's number of it."""
        return mi.UInt32(np.where(self._shapes >= 0, self._first[self._shapes], 0))

    def triangle(self, si: Hit, active: Bool) -> UInt:
        """Index of the triangle that each ray meets, in a kernel."""
        shape: UInt = dr.reinterpret_array(mi.UInt32, si.shape)
        return dr.gather(mi.UInt32, self._first_of, shape, active) + si.prim_index

    def owner(self, si: Hit) -> Int:
        """Index of the object that each ray meets, -1 for none."""
        shape: UInt = dr.reinterpret_array(mi.UInt32, si.shape)
        ours = shape < len(self._shapes)
        ours &= dr.gather(mi.Int32, self._number_of, shape, ours) >= 0
        owner: Int = dr.gather(mi.Int32, self._owners, self.triangle(si, ours), ours)
        return dr.select(ours, owner, -1)

    def object_ids(self, si: Hit) -> NDArray[np.int64]:
        """The same as numbers."""
        return np.asarray(self.owner(si).numpy(), dtype=np.int64)

    @cached_property
    def _number_of(self) -> Int:
        """Index of a shape by Dr.Jit's number of it, -1 for other scenes'."""
        return mi.Int32(self._shapes.astype(np.int32))

    @cached_property
    def _owners(self) -> Int:
        """Index of the object of each triangle, and one more: what is empty cannot be gathered."""
        owners = np.repeat(self._objects, np.diff(self._starts))
        return mi.Int32(np.append(owners, -1).astype(np.int32))


#: The most recent meshes, by their first object, with which they expire. Only one set is cached,
#: because Dr.Jit compiles a kernel for all existing shapes and materials of all scenes.
_CACHED: WeakKeyDictionary[SceneObject, tuple[bytes, Meshes]] = WeakKeyDictionary()


def shapes(objects: Sequence[SceneObject]) -> dict[str, Any]:
    """Mitsuba meshes by name, one for each material, in the order of its first object."""
    return {
        f"mesh_{i}": shape([objects[number] for number in group])
        for i, group in enumerate(_by_material(objects))
    }


def _by_material(objects: Sequence[SceneObject]) -> list[list[int]]:
    """Indices of the objects of each material."""
    contents = {id(thing.material): material_content(thing.material) for thing in objects}
    groups: dict[bytes, list[int]] = {}
    for number, thing in enumerate(objects):
        groups.setdefault(contents[id(thing.material)], []).append(number)
    return list(groups.values())


def shape(things: Sequence[SceneObject], **parts: Any) -> Object:
    """Merge objects of one material into a Mitsuba mesh; `parts` are further plugins of it."""
    material = things[0].material
    meshes = [thing.mesh for thing in things]
    with_uv = material.needs_texture_coordinates
    bsdf = mi.load_dict(bsdf_dict(material))
    return mesh_shape(meshes, bsdf, parts, name=things[0].name, with_uv=with_uv)


def mesh_shape(
    meshes: Sequence[trimesh.Trimesh],
    bsdf: Object,
    parts: Mapping[str, Any],
    *,
    name: str = "mesh",
    with_uv: bool = False,
) -> Object:
    """Merge meshes into one of Mitsuba's."""
    properties = mi.Properties()
    properties["bsdf"] = bsdf
    for key, part in parts.items():
        properties[key] = part
    vertices = np.concatenate([np.float32(mesh.vertices) for mesh in meshes])
    firsts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])], dtype=np.uint32)
    faces = np.concatenate(
        [np.uint32(mesh.faces) + n for mesh, n in zip(meshes, firsts, strict=True)]
    )
    uv = np.concatenate([texture_coordinates(mesh) for mesh in meshes]) if with_uv else None
    mesh = mi.Mesh(
        name, len(vertices), len(faces), has_vertex_texcoords=uv is not None, props=properties
    )
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = vertices.ravel()
    parameters["faces"] = faces.ravel()
    if uv is not None:  # a picture's rows run down, v up
        parameters["vertex_texcoords"] = np.float32([0, 1] + uv * [1, -1]).ravel()
    parameters.update()
    return mesh


def _registry_ids(pointers: Object) -> NDArray[np.uint32]:
    """Dr.Jit's number of each shape in an array of pointers, (lanes,); 0 for none."""
    numbers: UInt = dr.reinterpret_array(mi.UInt32, pointers)
    return np.asarray(numbers.numpy())

"""The surfaces of a scene as Mitsuba holds them: one mesh for each material.

A few large meshes are built and traced much faster than many small ones: whatever a path meets is
a call to one of all shapes and materials.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Any
from weakref import WeakKeyDictionary

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from spisim.scene import SceneObject, texture_coordinates
from spisim.scene.content import material_content, surface_content
from spisim.transport.bsdf import bsdf_dict, is_null_transmitting


@dataclass(frozen=True, eq=False)
class Meshes:
    """The meshes of some objects in a Mitsuba scene of their own, and which triangle is whose."""

    scene: Any  # mi.Scene
    see_through: bool  # whether any of them lets light straight through
    _shapes: NDArray[np.int64]  # of each of Dr.Jit's numbers of a shape, -1 for those of others
    _first: NDArray[np.int64]  # number of each shape's first triangle
    _starts: NDArray[np.int64]  # and of each object's, in the order of the shapes
    _objects: NDArray[np.int64]  # their numbers

    @classmethod
    def of(cls, objects: Sequence[SceneObject]) -> Meshes:
        """Those of objects; the last ones made of them, as long as nothing about them changed."""
        key = str(mi.variant()).encode() + surface_content(objects)
        content, kept = _KEPT.get(objects[0], (b"", None)) if objects else (b"", None)
        if kept is None or content != key:
            _KEPT.clear()
            kept = cls._made(objects)
            if objects:
                _KEPT[objects[0]] = key, kept
        return kept

    @classmethod
    def _made(cls, objects: Sequence[SceneObject]) -> Meshes:
        groups = _by_material(objects)
        in_order = [number for group in groups for number in group]
        starts = [0, *accumulate(len(objects[number].mesh.faces) for number in in_order)]
        places = [0, *accumulate(map(len, groups))]
        scene = mi.load_dict({"type": "scene", **shapes(objects)})
        numbers = [int(_registry_ids(mi.ShapePtr(shape))[0]) for shape in scene.shapes()]
        known = np.full(max(numbers, default=0) + 1, -1)
        known[numbers] = np.arange(len(numbers))
        return cls(
            scene,
            any(is_null_transmitting(thing.material) for thing in objects),
            known,
            np.array([starts[place] for place in places[:-1]], dtype=np.int64),
            np.array(starts),
            np.array(in_order, dtype=np.int64),
        )

    def object_ids(self, si: Any) -> NDArray[np.int64]:
        """Number of the object that each ray meets, -1 for none."""
        numbers = _registry_ids(si.shape)
        shape = np.where(numbers < len(self._shapes), self._shapes[numbers % len(self._shapes)], -1)
        triangle = self._first[shape] + si.prim_index.numpy()
        order = np.searchsorted(self._starts, triangle, side="right") - 1
        met = shape >= 0
        return np.where(met, self._objects[np.where(met, order, 0)], -1)


#: The last ones that were made of objects, by the first of these: they last as long as it does.
#: There are no more than these, for Dr.Jit makes a kernel for all shapes and materials that there
#: are, of whatever scene.
_KEPT: WeakKeyDictionary[SceneObject, tuple[bytes, Meshes]] = WeakKeyDictionary()


def shapes(objects: Sequence[SceneObject]) -> dict[str, Any]:
    """Mitsuba meshes by name, one for each material, in the order of its first object."""
    return {
        f"mesh_{i}": _mesh([objects[number] for number in group])
        for i, group in enumerate(_by_material(objects))
    }


def _by_material(objects: Sequence[SceneObject]) -> list[list[int]]:
    """Numbers of the objects whose materials are alike."""
    contents = {id(thing.material): material_content(thing.material) for thing in objects}
    groups: dict[bytes, list[int]] = {}
    for number, thing in enumerate(objects):
        groups.setdefault(contents[id(thing.material)], []).append(number)
    return list(groups.values())


def _mesh(things: Sequence[SceneObject]) -> Any:
    """All triangles of objects of one material."""
    material = things[0].material
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(bsdf_dict(material))
    vertices = np.concatenate([np.float32(thing.mesh.vertices) for thing in things])
    firsts = np.cumsum([0, *(len(thing.mesh.vertices) for thing in things[:-1])], dtype=np.uint32)
    faces = np.concatenate(
        [np.uint32(thing.mesh.faces) + n for thing, n in zip(things, firsts, strict=True)]
    )
    uv = None
    if material.needs_texture_coordinates:
        uv = np.concatenate([texture_coordinates(thing.mesh) for thing in things])
    mesh = mi.Mesh(
        things[0].name,
        len(vertices),
        len(faces),
        has_vertex_texcoords=uv is not None,
        props=properties,
    )
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = vertices.ravel()
    parameters["faces"] = faces.ravel()
    if uv is not None:  # a picture's rows run down, v up
        parameters["vertex_texcoords"] = np.float32([0, 1] + uv * [1, -1]).ravel()
    parameters.update()
    return mesh


def _registry_ids(pointers: Any) -> Any:
    """Dr.Jit's number of each shape that an array of pointers points to, (lanes,); 0 for none."""
    numbers: Any = dr.reinterpret_array(mi.UInt32, pointers)
    return numbers.numpy()

"""The surfaces of a scene as Mitsuba holds them: one mesh for each material.

A few large meshes are built and traced much faster than many small ones: whatever a path meets is
a call to one of all shapes and materials.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from spisim.scene import SceneObject, texture_coordinates
from spisim.transport.bsdf import bsdf_dict


def shapes(objects: Sequence[SceneObject]) -> dict[str, Any]:
    """Mitsuba meshes by name, one for each material, in the order of its first object."""
    return {
        f"mesh_{i}": _mesh([objects[number] for number in group])
        for i, group in enumerate(_by_material(objects))
    }


def object_ids(objects: Sequence[SceneObject], geometry: Any, si: Any) -> NDArray[np.int64]:
    """Number of the object that each ray meets, -1 for none.

    `geometry` is a Mitsuba scene of the `shapes` of the objects and nothing else.
    """
    groups = _by_material(objects)
    in_order = [number for group in groups for number in group]
    starts = [0, *accumulate(len(objects[number].mesh.faces) for number in in_order)]
    places = [0, *accumulate(map(len, groups))]
    shape = _shape_numbers(geometry, si.shape)
    first = np.array([starts[place] for place in places[:-1]])
    triangle = first[shape] + si.prim_index.numpy()
    order = np.searchsorted(starts, triangle, side="right") - 1
    met = shape >= 0
    return np.where(met, np.array(in_order)[np.where(met, order, 0)], -1)


def _by_material(objects: Sequence[SceneObject]) -> list[list[int]]:
    """Numbers of the objects that share a material."""
    groups: dict[int, list[int]] = {}
    for number, thing in enumerate(objects):
        groups.setdefault(id(thing.material), []).append(number)
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


def _shape_numbers(geometry: Any, met: Any) -> NDArray[np.int64]:
    """Place of each shape met among those of a Mitsuba scene, -1 for none."""
    registry = [int(_registry_ids(mi.ShapePtr(shape))[0]) for shape in geometry.shapes()]
    numbers = _registry_ids(met).astype(np.int64)
    known = np.full(max([*registry, int(numbers.max(initial=0))]) + 1, -1)
    known[registry] = np.arange(len(registry))
    return np.asarray(known[numbers])


def _registry_ids(pointers: Any) -> Any:
    """Dr.Jit's number of each shape that an array of pointers points to, (lanes,); 0 for none."""
    numbers: Any = dr.reinterpret_array(mi.UInt32, pointers)
    return numbers.numpy()

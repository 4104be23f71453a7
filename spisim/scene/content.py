"""Digests of meshes and surfaces: equal content has equal digests."""

from collections.abc import Sequence
from functools import cache
from hashlib import blake2b

import numpy as np
import trimesh

from spisim.scene.materials import Material
from spisim.scene.model import SceneObject
from spisim.scene.shapes import texture_coordinates


def surface_content(objects: Sequence[SceneObject]) -> bytes:
    """Digest of everything about objects that affects light, in their order; not their names."""
    result = blake2b()
    materials = {id(thing.material): thing.material for thing in objects}
    contents = {number: material_content(each) for number, each in materials.items()}
    for thing in objects:
        result.update(contents[id(thing.material)] + mesh_content(thing.mesh))
    return result.digest()


def mesh_content(mesh: trimesh.Trimesh) -> bytes:
    """Digest of triangles and texture coordinates."""
    return _digest(mesh.vertices, mesh.faces, texture_coordinates(mesh))


def material_content(material: Material) -> bytes:
    """Digest of how a surface scatters light."""
    numbers = repr((material.bsdf, float(material.reflectance)))
    opacity = material.opacity
    pictured = opacity if opacity is None else np.asarray(opacity)
    return _digest(np.frombuffer(numbers.encode(), np.uint8), material.texture, pictured)


def _digest(*arrays: np.ndarray | None) -> bytes:
    result = blake2b()
    for array in arrays:
        result.update(b"none" if array is None else f"{_name(array.dtype)} {array.shape}".encode())
        if array is not None:
            result.update(np.ascontiguousarray(array).data)
    return result.digest()


@cache
def _name(dtype: np.dtype) -> str:
    """Name of a type of numbers; NumPy takes longer to make it than a small mesh's digest."""
    return str(dtype)

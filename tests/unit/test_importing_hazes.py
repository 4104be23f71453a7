"""Where bodies of fog of imported scenes are: in an object, in a mesh, in a box."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import trimesh

from spisim_formats.library.content import Haze
from spisim_formats.library.writing import Meshes, _haze_shape

BLOCK = trimesh.creation.box((2, 4, 6))
MOVED = trimesh.transformations.translation_matrix((1, 2, 3))  # its corner to the origin
IN_ITS_BOUNDS = np.diag([2.0, 4.0, 6.0, 1.0])
LUMPY = SimpleNamespace()
EVEN = Haze("smoke", MOVED, extinction=0.1, albedo=0.9, g=0.0)


def shape_of(haze: Haze) -> tuple[dict, np.ndarray, Meshes]:
    meshes: Meshes = {}
    shape, box = _haze_shape(haze, meshes, {7: "tank"})
    return shape, box, meshes


def test_even_fog_in_a_part_is_in_its_object() -> None:
    shape, _, meshes = shape_of(replace(EVEN, part=7))
    assert (shape, meshes) == ({"object": "tank"}, {})


def test_lumpy_fog_in_a_part_has_its_density_in_the_bounds_of_that() -> None:
    shape, box, meshes = shape_of(replace(EVEN, part=7, mesh=BLOCK, density=LUMPY))
    assert (shape, meshes) == ({"object": "tank"}, {})
    np.testing.assert_allclose(box, IN_ITS_BOUNDS, atol=1e-12)


def test_lumpy_fog_of_a_part_that_has_no_mesh_of_its_own_is_in_its_box() -> None:
    shape, box, meshes = shape_of(replace(EVEN, part=7, density=LUMPY))
    assert (shape["size_m"], meshes) == ([1, 1, 1], {})
    np.testing.assert_allclose(box[:3, 3], (0.5, 1.5, 2.5))


def test_fog_in_a_mesh_brings_the_mesh() -> None:
    shape, box, meshes = shape_of(replace(EVEN, mesh=BLOCK))
    assert list(meshes) == [shape["mesh"]]
    np.testing.assert_allclose(meshes[shape["mesh"]].bounds, [[0, 0, 0], [2, 4, 6]], atol=1e-12)
    np.testing.assert_allclose(box, IN_ITS_BOUNDS, atol=1e-12)

"""Blocks of triangles against all pairs."""

import numpy as np
import pytest

from spisim.scene.blocks import Blocks, distance
from spisim.scene.rays import first_hits


@pytest.fixture(scope="module")
def triangles() -> np.ndarray:
    """Small ones in clusters, two that are far larger than all, and one without an area."""
    rng = np.random.default_rng(3)
    positions = rng.uniform(-20, 20, (40, 1, 1, 3)) + rng.normal(size=(40, 30, 1, 3))
    small = (positions + 0.2 * rng.normal(size=(40, 30, 3, 3))).reshape(-1, 3, 3)
    a, b, c, d = [-30, -30, -5], [30, -30, -5], [30, 30, -5], [-30, 30, -5]
    return np.concatenate([small, [[a, b, c], [a, c, d], [a, a, a]]])


def test_first_hits(triangles: np.ndarray) -> None:
    """Along the axes too, where the slopes of bounds are infinite."""
    rng = np.random.default_rng(4)
    rays = np.concatenate([rng.normal(size=(40, 3)), np.eye(3), -np.eye(3)])
    blocks = Blocks.of(triangles)
    result = blocks.first_hits(np.array([0.5, 0.25, 1.0]), rays)
    np.testing.assert_array_equal(result, first_hits(np.array([0.5, 0.25, 1.0]), rays, triangles))
    assert 0.2 < np.isfinite(result).mean() < 1


def test_a_ray_within_a_face_of_the_bounds() -> None:
    """0/0 there says nothing, and is no miss."""
    square = np.array([[[0, 0, 0], [1, 0, 0], [0, 0, 1]], [[1, 0, 0], [1, 0, 1], [0, 0, 1]]], float)
    blocks = Blocks.of(np.concatenate([square, square + np.array([0, 3, 0])]))
    (result,) = blocks.first_hits(np.array([0.0, -1, 0.25]), np.array([[-0.0, 2, 0]]))
    assert result == 0.5


@pytest.mark.parametrize("point", [(0, 0, 1), (50, 0, -5), (0, 0, -4.9), (-30, -30, -5)])
def test_distance(triangles: np.ndarray, point: tuple) -> None:
    position = np.array(point, float)
    assert Blocks.of(triangles).distance(position) == distance(position, triangles)

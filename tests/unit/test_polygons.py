"""Triangles of polygons: they cover each polygon once, whatever its shape and where it lies."""

import re

import numpy as np
import pytest

from reconstruction.base.errors import InputError
from spisim.scene.polygons import MAX_CORNERS, triangulate

NOTCHED = [(0, 0), (3, 0), (3, 3), (1.5, 0.5), (0, 3)]
#: A wall of 4 m x 3 m with an opening of 2 m x 1 m, joined to the outline by a seam.
WINDOW = [(0, 0), (4, 0), (4, 3), (0, 3), (0, 0), (1, 1), (1, 2), (3, 2), (3, 1), (1, 1)]
RNG = np.random.default_rng(5)


def openings(rows: int, columns: int) -> list[tuple[float, float]]:
    """A wall with openings of 1 m², each joined to the corner at 0, through others."""
    width, height = 2 * columns + 1, 2 * rows + 1
    outline = [(0, 0), (width, 0), (width, height), (0, height), (0, 0)]
    for x in range(1, width, 2):
        for y in range(1, height, 2):
            outline += [(x, y), (x, y + 1), (x + 1, y + 1), (x + 1, y), (x, y), (0, 0)]
    return outline[:-1]


def along_the_sill() -> list[tuple[float, float]]:
    """Two openings of 1 m² in a wall of 5 m x 3 m; the way there passes below them."""
    there = [(0, 1), (1, 1), (2, 1), (3, 1), (4, 1)]
    back = [(4, 2), (3, 2), (3, 1), (2, 1), (2, 2), (1, 2), (1, 1), (0, 1)]
    return [(0, 0), *there, *back, (0, 3), (5, 3), (5, 0)][::-1]


def star(corners: int) -> list[tuple[float, float]]:
    angles = np.linspace(0, 2 * np.pi, corners, endpoint=False)
    radii = 0.2 + RNG.random(corners)
    return list(zip(radii * np.cos(angles), radii * np.sin(angles), strict=True))


def comb(teeth: int) -> list[tuple[float, float]]:
    top = [(x, 5 * (x % 2)) for x in range(2 * teeth + 1)]
    return [*top, (2 * teeth, -1), (0, -1)][::-1]


def newell(points: np.ndarray) -> np.ndarray:
    return np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0) / 2


def vectors(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b, c = points[triangles].transpose(1, 0, 2)
    return np.cross(b - a, c - a) / 2


SHAPES = {
    "notched": (NOTCHED, 5.25),
    "dart": ([(2, -1), (0.5, 0), (2, 1), (0, 0)], 0.5),
    "window": (WINDOW, 10.0),
    "openings": (openings(3, 4), 51.0),
    "along the sill": (along_the_sill(), 13.0),
    "comb": (comb(20), 140.0),
    "star": (star(60), None),
    "corners that repeat": ([(0, 0), (0, 0), (3, 0), (3, 3), (1.5, 0.5), (1.5, 0.5), (0, 3)], 5.25),
    "corners on edges": ([(0, 0), (1, 0), (3, 0), (3, 3), (1.5, 0.5), (0, 3), (0, 1)], 5.25),
    "squares that touch": ([(0, 0), (1, 0), (1, 1), (2, 1), (2, 2), (1, 2), (1, 1), (0, 1)], 2.0),
}


@pytest.mark.parametrize("turn", [False, True], ids=["level", "turned"])
@pytest.mark.parametrize("name", SHAPES)
def test_polygons_are_covered_once(name: str, turn: bool) -> None:
    flat, area = SHAPES[name]
    for first in range(min(len(flat), 12)):
        for step in (1, -1):
            outline = np.roll(np.array(flat, float), first, axis=0)[::step]
            points = np.column_stack([outline, np.zeros(len(outline))])
            if turn:
                axes = np.linalg.qr(RNG.normal(size=(3, 3)))[0]
                points = points @ axes.T + [5e5, 5e6, 100]
            exact = newell(points - points[0])
            result = triangulate(points, [len(points)], np.arange(len(points)))
            made = vectors(points - points[0], result.corners)
            assert result.fault == ""
            assert np.linalg.norm(made, axis=1).sum() == pytest.approx(np.linalg.norm(exact), 1e-6)
            np.testing.assert_allclose(made.sum(axis=0), exact, rtol=1e-6, atol=1e-6)
            if area is not None:
                assert np.linalg.norm(exact) == pytest.approx(area, 1e-6)


def test_nothing_stands_in_the_opening() -> None:
    points = np.array([(x, y, 0.0) for x, y in WINDOW])
    middles = points[triangulate(points, [10], np.arange(10)).corners].mean(axis=1)
    assert not (
        (middles[:, 0] > 1) & (middles[:, 0] < 3) & (middles[:, 1] > 1) & (middles[:, 1] < 2)
    ).any()


def test_polygons_stay_in_order_and_convex_ones_are_fans() -> None:
    points = np.array([(x, y, 0.0) for x, y in NOTCHED])
    result = triangulate(points, [3, 5, 4, 2], [0, 1, 2, 0, 1, 2, 3, 4, 0, 1, 2, 4, 0, 1])
    assert result.polygons.tolist() == [0, 1, 1, 1, 2, 2]
    assert result.corners[[0, 4, 5]].tolist() == [[0, 1, 2], [8, 9, 10], [8, 10, 11]]


def test_a_bent_polygon_is_cut_as_seen_along_its_normal() -> None:
    points = np.array([(x, y, 0.1 * (i % 2)) for i, (x, y) in enumerate(NOTCHED)])
    normal = newell(points) / np.linalg.norm(newell(points))
    made = vectors(points, triangulate(points, [5], np.arange(5)).corners) @ normal
    assert (made > 0).all()
    assert made.sum() == pytest.approx(np.linalg.norm(newell(points)))


@pytest.mark.parametrize(
    ("outline", "sentence"),
    [
        (
            [(0, 0), (1, 1), (1, 0), (0, 1)],
            "1 of 2 polygons .*cover 1, by Newell's formula they have 0 ",
        ),
        ([(0, 0), (1, 0), (2, 0), (3, 0)], "1 of 2 polygons .*cover 0, .* have 0 "),
        ([(0, 0), (4, 4), (4, 0), (0, 3)], "1 of 2 polygons .*cover 14, .* have 2 "),
        ([(np.cos(a), np.sin(a)) for a in np.arange(5) * 0.8 * np.pi], "1 of 2 polygons cross"),
    ],
)
def test_polygons_that_cross_themselves_are_named(
    outline: list[tuple[float, float]], sentence: str
) -> None:
    points = np.array([(x, y, 0.0) for x, y in [*outline, (9, 9), (10, 9), (9, 10), (10, 10)]])
    n = len(outline)
    result = triangulate(points, [n, 3], np.arange(n + 3))
    assert np.isin([0, 1], result.polygons).all()
    assert re.match(sentence, result.fault)


def test_missing_vertices_and_polygons_of_too_many_corners_are_refused() -> None:
    with pytest.raises(InputError, match="vertex not in the file"):
        triangulate(np.zeros((3, 3)), [4], [0, 1, 2, 3])
    n = MAX_CORNERS + 1
    points = np.column_stack([np.arange(n), np.arange(n) % 3, np.zeros(n)])
    with pytest.raises(InputError, match=r"up to 100,001 corners.*at most 100,000"):
        triangulate(points, [n], np.arange(n))

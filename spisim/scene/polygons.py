"""Triangles of polygons, without new vertices: fans where those fit, else ears (mapbox_earcut)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mapbox_earcut import triangulate_float64
from numpy.typing import ArrayLike, NDArray

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError, LimitError

Ints = NDArray[np.int64]

#: Relative tolerance of areas: polygons far from the origin are rounded.
TOLERANCE = 1e-6
ROUNDING = 1e-9
#: Corners of a polygon that fans do not fit; of several, the root of the sum of squares, as ears
#: take quadratic time: 3 to 12 s for so many.
MAX_CORNERS = 100_000


@dataclass(frozen=True, eq=False)
class Triangles:
    """Triangles of t polygons by the places (t, 3) of their corners in the list of all corners.

    `polygons` (t,) are the numbers of their polygons, in ascending order. With `are_fans` the
    polygons are cut from their first corners, as most programs do. `fault` is a sentence on those
    that cross themselves or have no area, or "".
    """

    corners: Ints
    polygons: Ints
    are_fans: bool
    fault: str


def triangulate(points: ArrayLike, counts: ArrayLike, indices: ArrayLike) -> Triangles:
    """Cut polygons into triangles that cover them once.

    Each polygon is seen along its normal by Newell's formula. A hole may be joined to the outline
    by a seam that is passed in both directions, as window openings of walls are in most files.

    Parameters
    ----------
    points
        Vertices (n, 3).
    counts
        Number of corners of each polygon (p,).
    indices
        Vertices of all corners, polygon after polygon (sum of `counts`,).

    Raises
    ------
    InputError
        For corners of missing vertices, or a LimitError for too many in one concave polygon.
    """
    points, counts = np.asarray(points, np.float64), np.asarray(counts, np.int64)
    indices = np.asarray(indices, np.int64)
    if len(indices) and not 0 <= indices.min() <= indices.max() < len(points):
        raise InputError("a polygon refers to a vertex not in the file")
    starts = np.cumsum(counts) - counts
    corners, owners = _fans(counts)
    many = np.flatnonzero(counts[owners] > 3)
    whose = owners[many]
    vectors = _vectors(points[indices[corners[many]]])
    newell = np.zeros((len(counts), 3))  # vector areas by Newell's formula
    np.add.at(newell, whose, vectors)
    area = np.linalg.norm(newell, axis=1)
    covered = np.zeros(len(counts))
    np.add.at(covered, whose, np.linalg.norm(vectors, axis=1))
    flat = (counts > 3) & (area <= TOLERANCE * covered)
    normals = newell / np.where(area > 0, area, 1)[:, None]

    def folded(vectors: Floats) -> NDArray[np.bool_]:
        signed = np.einsum("ij,ij->i", vectors, normals[whose])
        return np.bincount(whose, signed < -ROUNDING * area[whose], len(counts)) > 0

    bad = folded(vectors) & ~flat
    are_fans = not bad.any()
    first = starts[whose]
    turned = first[:, None] + (corners[many] - first[:, None] + 1) % counts[whose][:, None]
    mended = bad & ~folded(_vectors(points[indices[turned]]))
    corners[many] = np.where(mended[whose][:, None], turned, corners[many])
    bad &= ~mended
    cut = np.flatnonzero(bad & (counts > 4))  # two fans are all that a quadrilateral has
    if len(cut):
        inside = np.flatnonzero(np.repeat(np.isin(np.arange(len(counts)), cut), counts))
        seen = _seen(points[indices[inside]], counts[cut], normals[cut])
        ears, whose, covered[cut] = _ears(seen, counts[cut], area[cut])
        bad[cut] = np.abs(covered[cut] - area[cut]) > TOLERANCE * area[cut]
        kept = ~np.isin(owners, cut)
        corners = np.concatenate([corners[kept], inside[ears]])
        owners = np.concatenate([owners[kept], cut[whose]])
        order = np.argsort(owners, kind="stable")
        corners, owners = corners[order], owners[order]
    return Triangles(corners, owners, are_fans, _fault(bad | flat, covered, area))


@np.errstate(all="ignore")  # vertices that are not finite are refused elsewhere
def _vectors(triangles: Floats) -> Floats:
    """Vector areas (t, 3) of triangles (t, 3, 3)."""
    first, second, third = triangles.transpose(1, 0, 2)
    return np.asarray(np.cross(second - first, third - first) / 2)


def _fans(counts: Ints) -> tuple[Ints, Ints]:
    """Triangles (t, 3) of polygons about their first corners, and the polygon of each."""
    each = np.maximum(counts - 2, 0)
    owners = np.repeat(np.arange(len(counts)), each)
    step = np.arange(each.sum()) - np.repeat(np.cumsum(each) - each, each)
    first = (np.cumsum(counts) - counts)[owners]
    return np.column_stack([first, first + step + 1, first + step + 2]), owners


def _fault(bad: NDArray[np.bool_], covered: Floats, area: Floats) -> str:
    if not bad.any():
        return ""
    return (
        f"{np.count_nonzero(bad):,} of {len(bad):,} polygons cross themselves or have no area: "
        f"their triangles cover {covered[bad].sum():.4g}, by Newell's formula they have "
        f"{area[bad].sum():.4g} square units; export triangles to mend them"
    )


def _seen(points: Floats, counts: Ints, normals: Floats) -> Floats:
    """Plane coordinates (n, 2) of polygons' corners (n, 3), counterclockwise about their normals.

    They are from the first corner of each polygon, and exact where it lies along the axes.
    """
    right = np.cross(np.eye(3)[np.argmin(np.abs(normals), axis=1)], normals)
    right /= np.linalg.norm(right, axis=1)[:, None]
    axes = np.stack([right, np.cross(normals, right)], axis=1)
    owners = np.repeat(np.arange(len(counts)), counts)
    offsets = points - points[(np.cumsum(counts) - counts)[owners]]
    return np.asarray(np.einsum("nij,nj->ni", axes[owners], offsets))


def _ears(seen: Floats, counts: Ints, area: Floats) -> tuple[Ints, Ints, Floats]:
    """Triangles (t, 3) of polygons of given areas, their polygons (t,), and the area they cover.

    Ears may come out wrong where seams touch, but not once these are cut open to rings.
    """
    if (effort := float(np.linalg.norm(counts))) > MAX_CORNERS:
        raise LimitError(
            f"{len(counts):,} concave polygons of up to {counts.max():,} corners, {effort:,.0f} by "
            f"the root of the sum of squares; at most {MAX_CORNERS:,}: have the program that made "
            "them cut them into triangles"
        )
    starts = (np.cumsum(counts) - counts).tolist()
    outlines = [np.arange(start, start + n) for start, n in zip(starts, counts, strict=True)]
    ears = [_earcut(seen, [outline]) for outline in outlines]
    owners, covered = _covered(seen, ears)
    for polygon in np.flatnonzero(np.abs(covered - area) > TOLERANCE * area).tolist():
        rings = _rings(seen, outlines[polygon])
        opened = np.concatenate([np.zeros((0, 3), np.int64), *(_earcut(seen, r) for r in rings)])
        error = abs(_covered(seen, [opened])[1] - area[polygon])
        if error < abs(covered[polygon] - area[polygon]):
            ears[polygon] = opened
    owners, covered = _covered(seen, ears)
    return np.concatenate(ears), owners, covered


def _earcut(seen: Floats, rings: Sequence[Ints]) -> Ints:
    """Counterclockwise triangles of an outline and its holes, which are numbers of points."""
    places = np.concatenate(rings)
    ends = np.cumsum([len(ring) for ring in rings]).astype(np.uint32)
    return places[triangulate_float64(seen[places], ends).reshape(-1, 3)]


def _covered(seen: Floats, ears: Sequence[Ints]) -> tuple[Ints, Floats]:
    """Polygon of each triangle, and the area (p,) that the triangles of each polygon cover."""
    owners = np.repeat(np.arange(len(ears)), [len(each) for each in ears])
    a, b, c = seen[np.concatenate(ears).T]
    (x, y), (u, v) = (b - a).T, (c - a).T
    area = np.zeros(len(ears))
    np.add.at(area, owners, np.abs(x * v - y * u) / 2)
    return owners, area


def _rings(seen: Floats, outline: Ints) -> list[list[Ints]]:
    """Outlines of a polygon, each followed by its holes, with the seams between them taken out."""
    _, place = np.unique(seen[outline], axis=0, return_inverse=True)
    names = place.ravel().tolist()
    if len(set(names)) == len(names):
        return []
    leaving: dict[int, list[tuple[int, int]]] = {}  # from each place: the next one, the corner
    for corner, start, stop in zip(outline.tolist(), names, [*names[1:], names[0]], strict=True):
        back = leaving.get(stop, [])
        seam = next((edge for edge in back if edge[0] == start), None)
        if seam is not None:
            back.remove(seam)
        elif start != stop:
            leaving.setdefault(start, []).append((stop, corner))
    rings = []
    for at in leaving:
        passed: dict[int, int] = {}  # places on the way, and their corners
        while leaving[at]:
            stop, passed[at] = leaving[at].pop(0)
            if stop in passed:
                ring = [*passed][[*passed].index(stop) :]
                rings.append(np.array([passed.pop(place) for place in ring]))
            at = stop
    return _nested(seen, rings)


def _nested(seen: Floats, rings: list[Ints]) -> list[list[Ints]]:
    """Rings by outline: a clockwise one is a hole of the smallest outline around its box."""
    area = []
    for ring in rings:
        x, y = seen[ring].T
        area.append(float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum()) / 2)
    low = [seen[ring].min(axis=0) for ring in rings]
    high = [seen[ring].max(axis=0) for ring in rings]
    order = sorted(range(len(rings)), key=area.__getitem__)
    groups = {i: [rings[i]] for i in order if area[i] > 0}
    for hole in (i for i in order if area[i] < 0):
        around = (
            i for i in groups if (low[i] <= low[hole]).all() and (high[hole] <= high[i]).all()
        )
        if (outline := next(around, None)) is not None:
            groups[outline].append(rings[hole])
    return list(groups.values())

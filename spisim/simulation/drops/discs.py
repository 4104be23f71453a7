"""Discs of drops as points, and the virtual pixel whose light goes through each point.

Far drops are smaller than a pixel, and one point suffices. Close ones cover several pixels, or part
of a lens, and get many: points on Vogel's spiral, paired with points of lens and aperture from
Richtmyer's sequence, the multiples of √2 and √3.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from spisim.instrument.views import DetectorView, ProjectorView

Ints = NDArray[np.intp]

#: Points per side of a pixel that a drop covers, and per pixel over which a lens blurs its shadow.
ON_DISC, ON_LENS = 8, 2
#: Maximum number of points of one drop.
MAX_POINTS = 4096
#: Steps of the search for the surface behind a drop, along a ray that is not a pixel's.
SURFACE_STEPS = 3
ROOTS = np.sqrt([2.0, 3.0])
GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))


class Points(NamedTuple):
    """Points on the discs of drops, (points, ...): the first point of a drop is its centre."""

    drop: Ints
    position_m: Floats  # (points, 3)
    area_m2: Floats  # of the disc, that the point stands for
    on_lens: Floats  # (points, 2) of a unit disc: where its ray crosses lens or aperture
    several: Ints  # the points of drops with more than one


class Fractions(NamedTuple):
    """Fractions of pixels' light that meet points."""

    point: Ints
    pixel: Ints  # row by row
    fraction: Floats


def disc_points(
    positions_m: Floats, diameters_mm: Floats, blur_m: Floats, pixel_rad: float
) -> Points:
    """Points on drops (drops, 3) whose discs all face the pinhole.

    `blur_m` (drops,) is the width of a pixel's light blurred by the lens, `pixel_rad` a pixel's
    angle.
    """
    diameters = diameters_mm * 1e-3
    pixel_m = positions_m[:, 2] * pixel_rad
    wanted = (ON_DISC * diameters / pixel_m) ** 2 + (ON_LENS * blur_m / pixel_m) ** 2
    counts = np.clip(wanted, 1, MAX_POINTS).astype(np.intp)
    drop = np.repeat(np.arange(len(counts)), counts)
    position, on_lens = positions_m[drop], np.zeros((len(drop), 2))
    several = np.flatnonzero(counts[drop] > 1)
    rank = several - (np.cumsum(counts) - counts)[drop[several]]
    radius = np.sqrt((rank + 0.5) / counts[drop[several]]) * diameters[drop[several]] / 2
    turn = rank * GOLDEN_ANGLE
    centre = position[several]
    sideways = np.cross(centre, [0.0, -1.0, 0.0])
    upwards = np.cross(centre, sideways)
    for shift, way in ((radius * np.cos(turn), sideways), (radius * np.sin(turn), upwards)):
        position[several] += (shift / length(way))[:, None] * way
    on_lens[several] = _unit_disc(np.mod(0.5 + rank[:, None] * ROOTS, 1))
    return Points(drop, position, (np.pi / 4 * diameters**2 / counts)[drop], on_lens, several)


def length(vectors: Floats) -> Floats:
    """Lengths of vectors (n, 3)."""
    return np.asarray(np.sqrt(np.einsum("nk,nk->n", vectors, vectors)))


def on_the_way_out(projector: ProjectorView, depth_m: Floats, points: Points) -> Fractions:
    """Fraction of each pixel's power that would meet each point, in front of surfaces (H, W).

    A pixel of area a on the image plane at unit distance sends 1 / (a cos³θ) of its power per
    steradian, evenly from all of the lens, which is sharp at its focus.
    """
    lens = np.zeros_like(points.position_m)
    lens[:, :2] = points.on_lens * projector.lens_radius_m
    ray = points.position_m - lens
    image = lens[:, :2] / projector.focus_m + ray[:, :2] / ray[:, 2:]
    inside, pixel = _pixel(projector, image)
    inside &= points.position_m[:, 2] < depth_m.ravel()[pixel]
    fraction = points.area_m2 * length(ray) / (projector.pixel_area * ray[:, 2] ** 3)
    return Fractions(np.flatnonzero(inside), pixel[inside], fraction[inside])


def on_the_way_back(
    projector: ProjectorView, aperture: DetectorView, number: int, depth_m: Floats, points: Points
) -> Fractions:
    """Fraction of the light from each pixel's surface to an aperture that would meet each point.

    The surface of a pixel counts as lying across the optical axis at its depth (H, W), and as
    sending the same light into all of the aperture.
    """
    position = aperture.positions_m[number]
    radius = np.sqrt(aperture.area_m2 / np.pi)
    start = np.broadcast_to(position, points.position_m.shape).copy()
    start[:, :2] += points.on_lens * radius
    ray = points.position_m - start
    image = points.position_m[:, :2] / points.position_m[:, 2:]
    for _ in range(SURFACE_STEPS):
        _, pixel = _pixel(projector, image)
        depth = depth_m.ravel()[pixel, None]
        image = (start[:, :2] + ray[:, :2] * (depth - start[:, 2:]) / ray[:, 2:]) / depth
    inside, pixel = _pixel(projector, image)
    depth = depth_m.ravel()[pixel]
    inside &= (points.position_m[:, 2] < depth) & (ray[:, 2] > 0)
    ahead = np.where(inside, ray[:, 2], 1.0)
    fraction = points.area_m2 * length(ray) / (projector.pixel_area * ahead**3)
    fraction *= (1 - start[:, 2] / depth) ** 2
    return Fractions(np.flatnonzero(inside), pixel[inside], fraction[inside])


def passing(fractions: Fractions, points: Points, pixels: int) -> Floats:
    """Fraction of each pixel's light that passes all drops, (pixels,).

    Drops are independently distributed within a pixel, so the passing fractions multiply.
    """
    among = np.zeros(len(points.drop), dtype=np.bool_)
    among[points.several] = True
    together = among[fractions.point]
    drop, pixel = points.drop[fractions.point[together]], fractions.pixel[together]
    pairs, which = np.unique(drop * pixels + pixel, return_inverse=True)
    joint = np.bincount(which, fractions.fraction[together], minlength=len(pairs))
    pixel = np.concatenate([fractions.pixel[~together], pairs % pixels])
    covered = np.minimum(np.concatenate([fractions.fraction[~together], joint]), 1 - 1e-12)
    return np.exp(np.bincount(pixel, np.log1p(-covered), minlength=pixels))


def _pixel(projector: ProjectorView, image: Floats) -> tuple[NDArray[np.bool_], Ints]:
    """Whether points of the image plane (n, 2) are lit, and the index of the nearest pixel."""
    height, width = projector.shape
    column = np.floor((image[:, 0] / projector.tan_half_width + 1) * (width / 2))
    row = np.floor((image[:, 1] / projector.tan_half_height + 1) * (height / 2))
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    nearest = np.clip(row, 0, height - 1) * width + np.clip(column, 0, width - 1)
    return inside, nearest.astype(np.intp)


def _unit_disc(square: Floats) -> Floats:
    """Map points of the unit square (n, 2) to the disc, centre to centre (Shirley & Chiu 1997)."""
    x, y = (2 * square - 1).T
    wide = np.abs(x) > np.abs(y)
    radius = np.where(wide, x, y)
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.where(wide, y / x, x / y)
    angle = np.where(wide, np.pi / 4 * slope, np.pi / 2 - np.pi / 4 * slope)
    angle = np.where(radius == 0, 0.0, angle)
    return radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)

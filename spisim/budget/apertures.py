"""Where an aperture in front of beams takes in most, which is mostly between them.

The one with most visits touches a beam, or lies anywhere around a single one: of the apertures
whose rim runs through a beam, others take up arcs, and the most arcs at a point are wanted. A turn
in azimuth moves some columns of a raster onto others, and only the fullest need be looked at. Times
with many beams are bounded: a tile of centres by an aperture that is larger by its half diagonal,
split in four while that beats what an aperture at the centre of any tile has reached.
"""

import math
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.instrument.steering import directions
from spisim.instrument.zones import Zones

#: Relative excess of the aperture, so that none takes in more for rounding, and its least size.
EXCESS, LEAST_RAD = 1e-7, 1e-9
#: Steps of angles that count as equal, relative to the aperture.
STEP = 1e-8
#: Relative excess of a hazard that is not resolved any more.
TOLERANCE = 0.01
#: Tiles, or beams, that are looked at together.
BATCH = 1024
CORNERS = np.array(list(product((-1, 1), repeat=2)))
#: Places of an aperture over a flood's edge, and integration points across it.
PLACES, ACROSS = 65, 513


class Worst(NamedTuple):
    """Maxima over all apertures, each over its own; beams count as a whole."""

    beams: int  # at once
    mean: float  # beams, mean over the frames
    hazard: float  # of the beams within any time


def worst_apertures(
    angles_deg: Floats, radius_rad: float, hazard: Floats, of_mean: float = 0.0
) -> Worst:
    """What the worst apertures take in of beams from one point.

    Parameters
    ----------
    angles_deg
        Azimuth and elevation (frames, beams, 2) of the beams in successive frames.
    radius_rad
        Half the angle under which the beams' origin sees the aperture, whose rim counts as inside.
    hazard
        Hazard of a beam in one frame, if it is judged within a time of 1 to all frames, (frames,);
        it falls no faster than the time grows.
    of_mean
        Hazard of a beam that stays for longer than all frames: the result is at least that of the
        mean, and less is not resolved.

    Returns
    -------
    Worst
        At least what any aperture takes in, and at most what one does that is larger by 1e-7.
    """
    if not 0 <= radius_rad < math.pi / 2:
        raise InputError(f"radius_rad should be at least 0 and below π/2; found {radius_rad:g}")
    frames, beams, _ = angles_deg.shape
    angles_deg = angles_deg.reshape(-1, 2)
    radius_rad = max(radius_rad, LEAST_RAD) * (1 + EXCESS)
    mean = _most_visits(angles_deg, radius_rad) / frames
    most, worst = _worst_times(angles_deg, beams, radius_rad, hazard, mean * of_mean)
    return Worst(int(most), mean, float(worst))


def _most_visits(angles_deg: Floats, radius_rad: float) -> int:
    """Maximum number of directions (n, 2) within an angle of any direction."""
    steps = np.rint(angles_deg / (np.degrees(radius_rad) * STEP))
    _, first, visits = np.unique(steps, axis=0, return_index=True, return_counts=True)
    points, most = directions(angles_deg[first]), int(visits.max())
    tree, rims = KDTree(points), np.arange(len(points))
    if np.ptp(visits) == 0:
        rims = _unlike(angles_deg[first], radius_rad)
    for begin in range(0, len(rims), BATCH):
        batch = rims[begin : begin + BATCH]
        most = max(most, _most_on_rims(batch, points, tree, visits, radius_rad))
    return most


def _most_on_rims(
    rims: NDArray[np.intp],
    points: Floats,
    tree: KDTree,
    visits: NDArray[np.intp],
    radius_rad: float,
) -> int:
    """The most visits of apertures whose rim runs through one of some points, by index."""
    around = points[rims]
    near = KDTree(around).sparse_distance_matrix(
        tree, 2 * math.sin(radius_rad), output_type="ndarray"
    )
    near = near[(rims[near["i"]] != near["j"]) & (near["v"] < 2 * math.sin(radius_rad))]
    rim, half, toward = near["i"], near["v"] / 2, points[near["j"]]
    # On the rim around p, at an angle from a neighbour, the neighbour is within reach where
    # cos(angle) is at least tan(d/2) / tan(radius), d being the distance of the two.
    tangent = half / np.sqrt(1 - half**2)
    width = np.arccos(np.minimum(tangent / math.tan(radius_rad), 1))
    across = np.cross(around, np.eye(3)[np.argmin(np.abs(around), axis=1)])
    up = np.cross(around, across)
    x, y = (np.einsum("nc,nc->n", axis[rim], toward) for axis in (across, up))
    middle, weight = np.arctan2(y, x), visits[near["j"]]
    starts, ends = (middle - width) % (2 * np.pi), (middle + width) % (2 * np.pi)
    from_zero = np.bincount(rim, np.where(starts > ends, weight, 0), len(rims)) + visits[rims]
    # Integers sort several times faster: turn, whether it ends there, and weight.
    bits = int(visits.max()).bit_length()
    turns = np.concatenate([starts, ends]) + 2 * np.pi * np.tile(rim, 2)
    codes = (turns * 2.0 ** (48 - bits)).astype(np.int64) << (bits + 1)
    codes |= np.concatenate([weight, weight | 1 << bits])
    codes.sort()
    opened = np.cumsum((codes & ((1 << bits) - 1)) * (1 - 2 * (codes >> bits & 1)))
    inside = opened + np.repeat(from_zero, 2 * np.bincount(rim, minlength=len(rims)))
    return int(inside.max(initial=0))


def _unlike(angles_deg: Floats, radius_rad: float) -> NDArray[np.intp]:
    """Some of different directions (n, 2), such that all others have no more neighbours around.

    All, unless they are whole rows and columns. A turn in azimuth moves a column onto another, with
    which it shares at most its neighbours; where rows mirror each other, half of them will do.
    """
    step_deg = np.degrees(radius_rad) * STEP
    column, row = np.rint(angles_deg / step_deg).T
    (columns, first), rows = np.unique(column, return_index=True), np.unique(row)
    if len(columns) * len(rows) != len(angles_deg):
        return np.arange(len(angles_deg))
    widest_deg = np.degrees(_widest_rad(angles_deg, 2 * radius_rad))
    apart_deg = angles_deg[first, 0] - angles_deg[first, 0][:, None]
    around = {
        frozenset(np.rint(each[np.abs(each) <= widest_deg] / step_deg).tolist()): at
        for at, each in zip(columns, apart_deg, strict=True)
    }
    kept: list[frozenset[float]] = []
    for neighbours in sorted(around, key=len, reverse=True):
        if not any(neighbours <= other for other in kept):
            kept.append(neighbours)
    looked_at = np.isin(column, [around[each] for each in kept])
    if np.array_equal(rows, -rows[::-1]):
        looked_at &= row >= 0
    return np.flatnonzero(looked_at)


def _widest_rad(angles_deg: Floats, angle_rad: float) -> float:
    """Maximum difference in azimuth or elevation between directions (n, 2) and others so close."""
    least = math.cos(min(np.radians(np.abs(angles_deg[:, 1]).max()) + angle_rad, math.pi / 2))
    return 2 * math.asin(min(math.sin(angle_rad / 2) / max(least, EXCESS), 1.0))


def _worst_times(
    angles_deg: Floats, beams: int, radius_rad: float, hazard: Floats, least: float
) -> Floats:
    """Beams at once, and hazard of any time, of the worst apertures of beams by frame and beam."""
    tree, frames = KDTree(directions(angles_deg)), np.arange(len(angles_deg)) // beams
    best = bound = np.array([0.0, least])
    low, high = angles_deg.min(axis=0), angles_deg.max(axis=0)
    half_rad = np.radians((high - low).max() / 2) + _widest_rad(angles_deg, radius_rad)
    tiles_deg = (low + high)[None] / 2

    def figures(tiles_deg: Floats, reach_rad: float) -> Floats:
        near = KDTree(directions(tiles_deg)).sparse_distance_matrix(
            tree, 2 * math.sin(min(reach_rad, math.pi) / 2), output_type="ndarray"
        )
        tile, point = np.divmod(np.sort(near["i"] * len(frames) + near["j"]), len(frames))
        return _figures(tile, frames[point], len(tiles_deg), hazard, best[1])

    while len(tiles_deg):
        kept = [tiles_deg[:0]]
        for first in range(0, len(tiles_deg), BATCH):
            batch = tiles_deg[first : first + BATCH]
            upper = figures(batch, radius_rad + math.sqrt(2) * half_rad)
            worse = (upper > best[:, None]).any(axis=0)
            batch, upper = batch[worse], upper[:, worse]
            if len(batch):
                best = np.maximum(best, figures(batch, radius_rad).max(axis=1))
            splits = (upper > best[:, None] * (1 + TOLERANCE)).any(axis=0) & (
                half_rad > EXCESS * radius_rad
            )
            bound = np.maximum(bound, upper[:, ~splits].max(axis=1, initial=0.0))
            kept.append(batch[splits])
        half_rad /= 2
        corners = np.concatenate(kept)[:, None] + np.degrees(half_rad) * CORNERS
        tiles_deg = corners.reshape(-1, 2)
    return np.maximum(best, bound)


def _figures(tile: Any, frame: Any, tiles: int, hazard: Floats, least: float) -> Floats:
    """Beams at once, and hazard of the worst time (2, tiles), of beams sorted by tile and frame.

    A time that has the most hazard begins and ends with a run of frames that have a beam, as limits
    grow no faster than the time. A hazard up to `least` may come out lower.
    """
    frames = len(hazard)
    key = tile * (2 * frames) + frame  # leaves a gap of a whole scan between tiles
    starts = np.flatnonzero(np.diff(key, prepend=-1))
    most, worst = np.zeros(tiles, np.intp), np.zeros(tiles)
    np.maximum.at(most, tile[starts], np.diff(np.append(starts, len(key))))
    begins = starts[np.diff(key[starts], prepend=-2) != 1]
    ends = np.append(begins, len(key))[1:]
    first, last = (key[each].astype(np.int32) for each in (begins, ends - 1))
    of_run, of_span = np.zeros(len(begins)), np.append(hazard, 0.0)
    longest, later = np.ptp([begins, ends], axis=0).max(initial=1), 0
    while later < len(begins):
        left = len(begins) - later
        spans, counts = last[later:] - first[:left], ends[later:] - begins[:left]
        highest, most_counts = of_span[int(spans.min()) :].max(initial=0.0), int(counts.max())
        if highest == 0:
            break
        if most_counts * highest > least:
            hazards = counts * of_span.take(spans, mode="clip")
            np.maximum(of_run[:left], hazards, out=of_run[:left])
            later += 1
        else:  # times of more runs are no shorter
            later += 1 + int((least / highest - most_counts) / longest)
    np.maximum.at(worst, tile[begins], of_run)
    return np.array([most, worst])


def flood_fraction(zones: Zones, radius_rad: float) -> float:
    """Maximum fraction of a flood's power that an aperture takes in.

    A flood that falls off is brightest on its axis; one that rises, at its edge, over which the
    aperture may stand out.
    """
    edge, falloff = math.radians(zones.flood_deg) / 2, zones.flood_falloff
    places = np.linspace(max(edge - radius_rad, 0.0), edge, PLACES) if falloff < 0 else np.zeros(1)
    low = np.maximum(places - radius_rad, 0.0)[:, None]
    high = np.minimum(places + radius_rad, edge)[:, None]
    # Rings around the axis, by x from 0 to 1 as the aperture's rim has roots there.
    x = (np.arange(ACROSS) + 0.5) / ACROSS
    angle = low + (high - low) * (1 - np.cos(np.pi * x)) / 2
    weight = (high - low) * np.pi / 2 * np.sin(np.pi * x) / ACROSS
    place = places[:, None]
    cosine = (math.cos(radius_rad) - np.cos(place) * np.cos(angle)) / np.maximum(
        np.sin(place) * np.sin(angle), 1e-300
    )
    lit = 2 * np.arccos(np.clip(cosine, -1, 1)) * np.sin(angle) * np.cos(angle) ** falloff
    taken = zones.axial_intensity * np.sum(lit * weight, axis=1).max()
    return min(1.0, float(taken))

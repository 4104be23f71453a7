"""Where an aperture in front of beams takes in most, which is mostly between them.

The one with most visits touches a beam, or lies anywhere around a single one: of the apertures
whose rim runs through a beam, others take up arcs, and the most arcs at a point are wanted. Times
with many beams are bounded: a cube of centres by an aperture that is larger by its half diagonal,
split in eight while that beats what an aperture at the centre of any cube has reached.
"""

import math
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import KDTree

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.instrument.steering import directions
from spisim.instrument.zones import Zones

#: Relative excess of the aperture, so that none takes in more for rounding, and its least size.
EXCESS, LEAST_RAD = 1e-7, 1e-9
#: Relative excess of a hazard that is not resolved any more.
TOLERANCE = 0.01
#: Cubes, or beams, that are looked at together.
BATCH = 1024
CORNERS = np.array(list(product((-1, 1), repeat=3)))
NEIGHBOURS = np.array(list(product((-1, 0, 1), repeat=3)))
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
    points = directions(angles_deg).reshape(-1, 3)
    radius_rad = max(radius_rad, LEAST_RAD) * (1 + EXCESS)
    mean = _most_visits(points, radius_rad) / frames
    most, worst = _worst_times(points, beams, radius_rad, hazard, mean * of_mean)
    return Worst(int(most), mean, float(worst))


def _most_visits(points: Floats, radius_rad: float) -> int:
    """Maximum number of unit vectors (n, 3) within an angle of any direction."""
    points, visits = np.unique(points, axis=0, return_counts=True)
    tree, reach = KDTree(points), 2 * math.sin(radius_rad)
    most = int(visits.max())
    for first in range(0, len(points), BATCH):
        rims = points[first : first + BATCH]
        near = KDTree(rims).sparse_distance_matrix(tree, reach, output_type="ndarray")
        near = near[(near["i"] + first != near["j"]) & (near["v"] < reach)]
        rim, other, half = near["i"], near["j"], np.arcsin(near["v"] / 2)
        # On the rim around p, at an angle from a neighbour, the neighbour is within reach where
        # cos(angle) is at least tan(d/2) / tan(radius), d being the distance of the two.
        width = np.arccos(np.minimum(np.tan(half) / math.tan(radius_rad), 1))
        across = np.cross(rims, np.eye(3)[np.argmin(np.abs(rims), axis=1)])
        up = np.cross(rims, across)
        toward = points[other]
        middle = np.arctan2((up[rim] * toward).sum(axis=1), (across[rim] * toward).sum(axis=1))
        starts, ends = (middle - width) % (2 * np.pi), (middle + width) % (2 * np.pi)
        from_zero = np.bincount(rim, np.where(starts > ends, visits[other], 0), len(rims))
        turns = np.concatenate([starts, ends]) + 2 * np.pi * np.tile(rim, 2)
        order = np.argsort(turns)
        opened = np.cumsum(np.concatenate([visits[other], -visits[other]])[order])
        inside = opened + (from_zero + visits[first : first + BATCH])[np.tile(rim, 2)[order]]
        most = max(most, int(inside.max(initial=0)))
    return most


def _worst_times(
    points: Floats, beams: int, radius_rad: float, hazard: Floats, least: float
) -> Floats:
    """Beams at once, and hazard of any time, of the worst apertures of points by frame and beam."""
    # A cap of half angle α is what a ball of radius sin α around a point at cos α holds.
    radius, shell, tree = math.sin(radius_rad), math.cos(radius_rad), KDTree(points)
    best = bound = np.array([0.0, least])
    half = radius / 2
    middles = np.unique(np.rint(points * shell / (2 * half)), axis=0)
    middles = np.unique((middles[:, None] + NEIGHBOURS).reshape(-1, 3), axis=0) * 2 * half
    while len(middles):
        diagonal = math.sqrt(3) * half
        middles = middles[np.abs(np.linalg.norm(middles, axis=1) - shell) <= diagonal]
        kept = [middles[:0]]
        for first in range(0, len(middles), BATCH):
            batch = middles[first : first + BATCH]
            near = KDTree(batch).sparse_distance_matrix(
                tree, radius + diagonal, output_type="ndarray"
            )
            near = near[np.lexsort((near["j"], near["i"]))]
            inside = near[near["v"] <= radius]
            upper = _figures(near["i"], near["j"] // beams, len(batch), hazard)
            lower = _figures(inside["i"], inside["j"] // beams, len(batch), hazard)
            best = np.maximum(best, lower.max(axis=1))
            splits = (upper > best[:, None] * (1 + TOLERANCE)).any(axis=0) & (
                half > EXCESS * radius
            )
            bound = np.maximum(bound, upper[:, ~splits].max(axis=1, initial=0.0))
            kept.append(batch[splits])
        half /= 2
        middles = (np.concatenate(kept)[:, None] + half * CORNERS).reshape(-1, 3)
    return np.maximum(best, bound)


def _figures(cube: Any, frame: Any, cubes: int, hazard: Floats) -> Floats:
    """Beams at once, and hazard of the worst time (2, cubes), of beams sorted by cube and frame.

    A time that has the most hazard begins and ends with a run of frames that have a beam, as limits
    grow no faster than the time.
    """
    key = cube * (len(hazard) + 1) + frame  # leaves a gap between cubes
    starts = np.flatnonzero(np.diff(key, prepend=-1))
    most, worst = np.zeros(cubes, np.intp), np.zeros(cubes)
    np.maximum.at(most, cube[starts], np.diff(np.append(starts, len(key))))
    begins = starts[np.diff(key[starts], prepend=-2) != 1]
    ends = np.append(begins[1:], len(key)) - 1
    for runs in range(len(begins)):
        first, last = begins[: len(begins) - runs], ends[runs:]
        same = cube[first] == cube[last]
        if not same.any():
            break
        first, last = first[same], last[same]
        hazards = (last - first + 1) * hazard[frame[last] - frame[first]]
        np.maximum.at(worst, cube[first], hazards)
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

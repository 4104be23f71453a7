"""Light that a drop scatters once, back into a detector."""

from typing import NamedTuple

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.atmosphere.drop_optics import Scatterer
from spisim.instrument.views import DetectorView
from spisim.simulation.drops.discs import length


class Echo(NamedTuple):
    """Fraction of the light on drops that reaches a detector's aperture, and its path length."""

    fraction: Floats
    length_m: Floats  # from the pinhole to the drop and on to the detector


def echo(
    positions_m: Floats,
    diameters_mm: Floats,
    optics: Scatterer,
    detector: DetectorView,
    number: int,
    fog_per_m: float,
    aperture_points: int = 1,
) -> Echo:
    """Echo of points (n, 3) on drops (n,) in detector `number`, attenuated by fog: exp(-σ L).

    Light comes from the pinhole. The edge of a narrow field is as wide as the lens, which then
    needs several `aperture_points`.
    """
    back = detector.positions_m[number] - positions_m
    out_m, back_m = length(positions_m), length(back)
    cosine = np.einsum("dk,dk->d", positions_m, back) / (out_m * back_m)
    path_m = out_m + back_m
    scattered = optics.scattered_per_sr(cosine, diameters_mm)
    solid_angle = _collection(positions_m, detector, number, aperture_points)
    return Echo(scattered * solid_angle * np.exp(-fog_per_m * path_m), path_m)


def _collection(
    positions_m: Floats, detector: DetectorView, number: int, aperture_points: int
) -> Floats:
    """Solid angle of the aperture from each point, where the point lies in its field."""
    axis, minimum = detector.axes[number], np.cos(detector.half_angle_rad)
    total = np.zeros(len(positions_m))
    for point in _aperture(axis, np.sqrt(detector.area_m2 / np.pi), aperture_points):
        towards = positions_m - (detector.positions_m[number] + point)
        ahead, squared = towards @ axis, np.einsum("dk,dk->d", towards, towards)
        cosine = ahead / np.sqrt(squared)
        inside = (cosine >= minimum) & (cosine > 0)
        total[inside] += cosine[inside] ** (1 + detector.vignetting) / squared[inside]
    return total * detector.area_m2 / aperture_points


def _aperture(axis: Floats, radius_m: float, count: int) -> Floats:
    """Points (count, 3) spread over a disc across `axis` (Vogel's spiral); its centre for one."""
    if count == 1:
        return np.zeros((1, 3))
    rank = np.arange(count) + 0.5
    turn, radius = rank * np.pi * (3 - np.sqrt(5)), radius_m * np.sqrt(rank / count)
    sideways = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    sideways /= np.linalg.norm(sideways)
    return np.asarray(
        np.outer(radius * np.cos(turn), sideways)
        + np.outer(radius * np.sin(turn), np.cross(axis, sideways))
    )

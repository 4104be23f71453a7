"""Overlap of a laser beam and the field of its detector, by distance."""

import numpy as np

from ...base.arrays import Floats
from ...base.errors import InputError
from ...capture.spots import SpotOptics

TINY_M = 1e-12
"""Replaces 0 in denominators."""
INSIDE_M = 0.1
"""Light from nearer than this does not make a detector useful."""
NEEDED = ("detector_axes", "half_fields_rad", "falloffs", "aperture_radii_m",
          "beam_divergence_rad", "beam_waist_m")  # fmt: skip
NODES, WEIGHTS = np.polynomial.hermite_e.hermegauss(5)


def require_optics(optics: SpotOptics) -> None:
    """Raise InputError if lasers or detectors are not known well enough for `overlap`."""
    for name in NEEDED:
        if np.isnan(getattr(optics, name)).any():
            raise InputError(
                f"spots/{name} is unknown (nan), but ranging in fog needs it for the overlap of "
                "beams and detector fields"
            )


def overlap(optics: SpotOptics, range_m: Floats) -> tuple[Floats, Floats]:
    """Collection weights and path lengths along the laser beams.

    A weight is the mean over the aperture, times its area, of cos / distance^2 and the field's
    response: the power collected from a diffuser of unit radiance per incident power. Raises
    InputError if a detector sees nothing of its beam.

    Parameters
    ----------
    range_m : array, (R,)
        Ranges along the lasers.

    Returns
    -------
    weight_sr, path_m : array, (spots, R)
    """
    weights = []
    for number in range(len(optics.directions)):
        total = np.zeros(len(range_m))
        for points, fraction in _pencils(optics, optics.directions[number], range_m):
            total += fraction * _collected(optics, number, points)
        if not total[range_m > INSIDE_M].any():
            raise InputError(
                f"the detector of spot {number} sees nothing of its laser's beam up to "
                f"{range_m[-1]:.3g} m: its position, axis or field in spots/ must be wrong"
            )
        weights.append(total)
    return np.array(weights), path_lengths(optics, range_m)


def _collected(optics: SpotOptics, number: int, points: Floats) -> Floats:
    """Weights (R,) of points (R, 3) for one detector.

    A point is seen from the part of the aperture within the cone of the field about it, which is a
    circle in the aperture's plane; cos / distance^2 is that of the middle of this area.
    """
    axis, aperture = optics.detector_axes[number], optics.aperture_radii_m[number]
    away = points - optics.detector_positions_m[number]
    ahead = np.maximum(away @ axis, 0)
    aside = np.linalg.norm(away - (away @ axis)[:, None] * axis, axis=1)
    field = ahead * np.tan(optics.half_fields_rad[number])
    middle = (np.maximum(aside - field, -aperture) + np.minimum(aside + field, aperture)) / 2
    distance = np.maximum(np.hypot(ahead, aside - middle), TINY_M)
    cosine = ahead / distance
    area = _common_area(aperture, field, aside)
    return np.asarray(area * cosine ** (1 + optics.falloffs[number]) / distance**2)


def _common_area(one: float, other: Floats, apart: Floats) -> Floats:
    """Area (...) common to two circles: the segments on both sides of their chord."""
    apart = np.maximum(apart, TINY_M)
    total = np.zeros_like(apart)
    for near, far in ((one, other), (other, one)):
        cosine = (apart**2 + near**2 - far**2) / (2 * apart * np.maximum(near, TINY_M))
        angle = np.arccos(np.clip(cosine, -1, 1))
        total += near**2 * (angle - np.sin(angle) * np.cos(angle))
    return total


def path_lengths(optics: SpotOptics, range_m: Floats) -> Floats:
    """Path lengths (spots, R) via points at ranges (R,) along the lasers to the detectors."""
    points = range_m[:, None] * optics.directions[:, None]
    back = np.linalg.norm(points - optics.detector_positions_m[:, None], axis=-1)
    return np.asarray(range_m + back)


def _pencils(optics: SpotOptics, direction: Floats, range_m: Floats) -> list[tuple[Floats, float]]:
    """Points (R, 3) on pencils of a Gaussian beam, and the fraction of light in each."""
    centre = range_m[:, None] * direction
    width = np.hypot(optics.beam_waist_m, optics.beam_divergence_rad * range_m)[:, None]
    if not width.any():
        return [(centre, 1.0)]
    right, down = _across(direction)
    fractions = WEIGHTS / WEIGHTS.sum()
    return [
        (centre + width * (x * right + y * down), float(a * b))
        for x, a in zip(NODES, fractions, strict=True)
        for y, b in zip(NODES, fractions, strict=True)
    ]


def _across(axis: Floats) -> tuple[Floats, Floats]:
    right = np.cross([0.0, 1.0, 0.0], axis)
    right /= np.linalg.norm(right)
    return right, np.cross(axis, right)

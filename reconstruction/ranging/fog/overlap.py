"""How much of what a laser lights up at a distance its detector sees."""

import numpy as np

from ...arrays import Floats
from ...capture.spots import SpotOptics
from ...errors import InputError

APERTURE_POINTS = 512
NEEDED = ("detector_axes", "half_fields_rad", "falloffs", "aperture_radii_m",
          "beam_divergence_rad", "beam_waist_m")  # fmt: skip
NODES, WEIGHTS = np.polynomial.hermite_e.hermegauss(5)


def check_known(optics: SpotOptics) -> None:
    """InputError where lasers and detectors are not known well enough for `overlap`."""
    for name in NEEDED:
        if np.isnan(getattr(optics, name)).any():
            raise InputError(
                f"spots/{name} is not known (nan), and ranging in fog needs it: what the "
                "detectors see of the beams follows from it"
            )


def overlap(optics: SpotOptics, range_m: Floats) -> tuple[Floats, Floats]:
    """Weights w in sr (4, R) and path lengths in metres (4, R) at ranges (R,) along the lasers.

    w is the mean over the aperture, times its area, of cos / distance^2 and the field's response;
    light that a diffuser sends back with unit radiance per incident power is collected so.
    Raises InputError for a detector that sees nothing of its beam.
    """
    weights = []
    for number in range(4):
        direction = optics.directions[number]
        axis = optics.detector_axes[number]
        position = optics.detector_positions_m[number]
        aperture = position + optics.aperture_radii_m[number] * _disc(axis)
        limit = np.cos(optics.half_fields_rad[number])
        total = np.zeros(len(range_m))
        for beam, share in _pencils(optics, direction, range_m):
            towards = beam[:, None] - aperture
            distance = np.linalg.norm(towards, axis=-1)
            with np.errstate(divide="ignore", invalid="ignore"):
                cosine = np.nan_to_num(towards @ axis / distance)
                seen = np.where(cosine >= limit, cosine, 0.0) / distance**2
            seen *= np.maximum(cosine, 0) ** optics.falloffs[number]
            total += share * np.nan_to_num(seen).mean(axis=1)
        if not total.any():
            raise InputError(
                f"the detector of spot {number} sees nothing of its laser's beam up to "
                f"{range_m[-1]:.3g} m: its position, axis or field in spots/ cannot be right"
            )
        weights.append(np.pi * optics.aperture_radii_m[number] ** 2 * total)
    return np.array(weights), path_lengths(optics, range_m)


def path_lengths(optics: SpotOptics, range_m: Floats) -> Floats:
    """Lengths (4, R) of the paths over points at ranges (R,) along the lasers to the detectors."""
    points = range_m[:, None] * optics.directions[:, None]
    back = np.linalg.norm(points - optics.detector_positions_m[:, None], axis=-1)
    return np.asarray(range_m + back)


def _pencils(optics: SpotOptics, direction: Floats, range_m: Floats) -> list[tuple[Floats, float]]:
    """Points (R, 3) on pencils of a Gaussian beam, and the share of light in each."""
    centre = range_m[:, None] * direction
    width = np.hypot(optics.beam_waist_m, optics.beam_divergence_rad * range_m)[:, None]
    if not width.any():
        return [(centre, 1.0)]
    right, down = _across(direction)
    shares = WEIGHTS / WEIGHTS.sum()
    return [
        (centre + width * (x * right + y * down), float(a * b))
        for x, a in zip(NODES, shares, strict=True)
        for y, b in zip(NODES, shares, strict=True)
    ]


def _disc(axis: Floats) -> Floats:
    """Evenly spread points (P, 3) of the unit disc across an axis."""
    number = np.arange(APERTURE_POINTS) + 0.5
    radius = np.sqrt(number / APERTURE_POINTS)
    angle = number * np.pi * (3 - np.sqrt(5))  # the golden angle
    right, down = _across(axis)
    return np.outer(radius * np.cos(angle), right) + np.outer(radius * np.sin(angle), down)


def _across(axis: Floats) -> tuple[Floats, Floats]:
    right = np.cross([0.0, 1.0, 0.0], axis)
    right /= np.linalg.norm(right)
    return right, np.cross(axis, right)

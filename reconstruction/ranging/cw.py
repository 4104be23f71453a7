"""Continuous-wave indirect time of flight: taps -> phase -> path length -> range.

Tap k reads S_k = B + A cos(phi - theta_k), phi = 2 pi f L / c + phase_offset, with L the whole
optical path from the laser over the spot to the detector.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.constants import c

from ..spots import CwSpots
from .geometry import range_from_path
from .ranges import LEAST_SIGNAL, Ranges

Floats = NDArray[np.float64]


def cw_ranges(spots: CwSpots, frame: int = 0) -> Ranges:
    """Ranges of one frame by least squares over any number of taps >= 3.

    There is none, and the spot's status says why, if a tap is saturated, if it shows no signal
    (amplitude below LEAST_SIGNAL standard deviations), or if its path is shorter than the way from
    projector to detector, which is too close. The path is unambiguous below c / f only.
    """
    electrons = spots.electrons(spots.taps[frame])
    variance = spots.variance(electrons)
    phases = spots.tap_phases_rad - spots.phase_offsets_rad
    phase, amplitude, offset, phase_sigma = demodulate(electrons, variance, phases)

    metres_per_radian = c / (2 * np.pi * spots.tap_frequencies_hz[0])
    path = np.mod(phase, 2 * np.pi) * metres_per_radian
    range_m, slope = range_from_path(path, spots.directions, spots.detector_positions_m)
    trouble = [
        spots.saturated[frame].any(axis=1),
        phase_sigma > 1 / LEAST_SIGNAL,
        path <= np.linalg.norm(spots.detector_positions_m, axis=1),
    ]
    status = np.select(trouble, ["saturated", "no signal", "too close"], "ok")
    valid = status == "ok"
    return Ranges(
        range_m=np.where(valid, range_m, np.nan),
        sigma_m=np.where(valid, slope * phase_sigma * metres_per_radian, np.nan),
        signal_electrons=amplitude,
        background_electrons=offset,
        status=tuple(status.tolist()),
    )


def demodulate(
    taps: Floats, variance: Floats, tap_phases_rad: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Phase, amplitude, offset and standard deviation of the phase, each (...,), of taps (..., K).

    Least squares on B + (A cos phi) cos theta_k + (A sin phi) sin theta_k; four taps at quarter
    periods give atan2(S1 - S3, S0 - S2). The variance of each tap is carried to the phase to first
    order: [sin^2 phi (v0 + v2) + cos^2 phi (v1 + v3)] / 4 A^2 for four taps. It is infinite where
    there is no amplitude.
    """
    model = np.stack(
        [np.ones_like(tap_phases_rad), np.cos(tap_phases_rad), np.sin(tap_phases_rad)], axis=1
    )
    inverse = np.linalg.pinv(model)
    offset, cosine, sine = np.moveaxis(taps @ inverse.T, -1, 0)
    phase, amplitude = np.arctan2(sine, cosine), np.hypot(cosine, sine)
    tangential = np.cos(phase)[..., None] * inverse[2] - np.sin(phase)[..., None] * inverse[1]
    deviation = np.sqrt((tangential**2 * variance).sum(axis=-1))
    with np.errstate(divide="ignore", invalid="ignore"):
        return phase, amplitude, offset, np.where(amplitude > 0, deviation / amplitude, np.inf)

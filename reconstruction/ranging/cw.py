"""Continuous-wave indirect time of flight: taps -> phase -> path length -> range.

Tap k reads S_k = B + A cos(phi - theta_k), phi = 2 pi f L / c + phase_offset, with L the whole
optical path from the laser over the spot to the detector.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.constants import c

from ..capture import Spots

Floats = NDArray[np.float64]
Status = Literal["ok", "saturated", "no signal", "too close"]

LEAST_SIGNAL = 3.0
"""A spot counts as seen when its amplitude exceeds its own standard deviation this many times."""


@dataclass(frozen=True, eq=False)
class Ranges:
    """Ranges of the four spots of one frame, each (4,).

    ``range_m`` from the projector's pinhole along the spot's direction, ``sigma_m`` its standard
    deviation from shot and electronics noise, without the bias of light that came another way, such
    as the echo of fog; both nan where ``status`` is not "ok". ``amplitude_electrons`` and
    ``offset_electrons`` are A and B of one tap.
    """

    range_m: Floats
    sigma_m: Floats
    amplitude_electrons: Floats
    offset_electrons: Floats
    status: tuple[Status, ...]

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Where there is a range (4,)."""
        return np.array(self.status) == "ok"


def measure_ranges(spots: Spots, frame: int = 0) -> Ranges:
    """Ranges of one frame by least squares over any number of taps >= 3.

    There is none, and the spot's status says why, if a tap is saturated, if it shows no signal
    (amplitude below LEAST_SIGNAL standard deviations), or if its path is shorter than the way from
    projector to detector, which is too close. The path is unambiguous below c / f only.
    """
    electrons = (spots.taps[frame] - spots.offset_counts) * spots.electrons_per_count
    electronics = np.nan_to_num(spots.noise_electrons) ** 2
    variance = np.maximum(electrons, 1) + electronics  # a dead tap is no perfect tap
    phase, amplitude, offset, phase_sigma = demodulate(electrons, variance, spots.tap_phases_rad)

    metres_per_radian = c / (2 * np.pi * spots.modulation_frequency_hz)
    path = np.mod(phase - spots.phase_offset_rad, 2 * np.pi) * metres_per_radian
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
        amplitude_electrons=amplitude,
        offset_electrons=offset,
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


def range_from_path(
    path_m: Floats, directions: Floats, detector_positions_m: Floats
) -> tuple[Floats, Floats]:
    """Range r along a spot's direction d from the path r + |r d - b|, and its derivative.

    r = (L^2 - |b|^2) / 2 (L - d.b), dr/dL = (L - r) / (L - d.b), b the detector's position.
    """
    squared = (detector_positions_m**2).sum(axis=-1)
    along = (directions * detector_positions_m).sum(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        range_m = (path_m**2 - squared) / (2 * (path_m - along))
        return range_m, (path_m - range_m) / (path_m - along)

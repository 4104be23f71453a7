"""Continuous-wave indirect time of flight: taps -> phases -> path length.

Tap k reads S_k = B + A cos(phi + phase_offset_k - phase_k), phi = 2 pi f L / c, with L the whole
optical path from the laser over the spot to the detector.
"""

import numpy as np
from numpy.typing import NDArray

from ..spots import CwSpots
from .ranges import LEAST_SIGNAL, Paths
from .unwrap import path_from_phases

Floats = NDArray[np.float64]


def cw_paths(spots: CwSpots, frame: int) -> Paths:
    """Paths of one frame by least squares over any number of taps >= 3 of each frequency.

    A frequency shows no signal if its amplitude is below LEAST_SIGNAL standard deviations, and a
    spot none if one of its frequencies does not. With one frequency f paths are unambiguous below
    c / f only; with several, see `path_from_phases`.
    """
    electrons = spots.electrons(spots.taps[frame])
    variance = spots.variance(electrons)
    tap_phases = spots.tap_phases_rad - spots.phase_offsets_rad
    frequencies = np.unique(spots.tap_frequencies_hz)
    of_each = [spots.tap_frequencies_hz == frequency for frequency in frequencies]
    phases, amplitudes, offsets, sigmas = (
        np.stack(values)
        for values in zip(
            *(demodulate(electrons[:, of], variance[:, of], tap_phases[of]) for of in of_each),
            strict=True,
        )
    )
    path, sigma, ambiguous = path_from_phases(phases, sigmas, frequencies)
    first = int(np.searchsorted(frequencies, spots.tap_frequencies_hz[0]))
    return Paths(
        path_m=path,
        sigma_m=sigma,
        signal_electrons=amplitudes[first],
        background_electrons=offsets[first],
        saturated=spots.saturated[frame].any(axis=1),
        no_signal=np.any(sigmas > 1 / LEAST_SIGNAL, axis=0),
        ambiguous=ambiguous,
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
    inverse = quadrature_weights(tap_phases_rad)
    offset, cosine, sine = np.moveaxis(taps @ inverse.T, -1, 0)
    phase, amplitude = np.arctan2(sine, cosine), np.hypot(cosine, sine)
    tangential = np.cos(phase)[..., None] * inverse[2] - np.sin(phase)[..., None] * inverse[1]
    deviation = np.sqrt((tangential**2 * variance).sum(axis=-1))
    with np.errstate(divide="ignore", invalid="ignore"):
        return phase, amplitude, offset, np.where(amplitude > 0, deviation / amplitude, np.inf)


def quadrature_weights(tap_phases_rad: Floats) -> Floats:
    """The (3, K) matrix that takes K taps to B, A cos phi and A sin phi by least squares."""
    model = [np.ones_like(tap_phases_rad), np.cos(tap_phases_rad), np.sin(tap_phases_rad)]
    return np.linalg.pinv(np.stack(model, axis=1))

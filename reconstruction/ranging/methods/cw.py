"""Continuous-wave indirect time of flight: taps -> phases -> path length.

Tap k reads S_k = B + A cos(phi + phase_offset_k - phase_k), phi = 2 pi f L / c, with L the optical
path from the laser via the spot to the detector.
"""

import numpy as np

from ...base.arrays import Floats
from ...capture import Optics, Spots
from ...capture.readings.cw import CwSpots
from ..brightness import Brightness
from ..method import RangingSolver
from ..ranges import MIN_SIGNAL, Paths, Ranges, ranges_from_paths
from ..unwrap import path_from_phases, unambiguous_path_m


class Cw:
    """Phases by least squares over three or more taps of each frequency.

    A frequency has no signal if its amplitude is below MIN_SIGNAL standard deviations, and a spot
    has none if one of its frequencies has none. With one frequency f, paths are unambiguous below c
    / f only; with several, see `path_from_phases`.
    """

    title = "phase"
    reads = CwSpots

    def compile(self, spots: Spots, optics: Optics | None = None) -> RangingSolver:
        """Solver for a recording's taps; raises InputError if their noise is unknown."""
        assert isinstance(spots, CwSpots)
        spots.check_noise(len(spots.directions))
        frequencies = np.unique(spots.tap_frequencies_hz)
        first = int(np.searchsorted(frequencies, spots.tap_frequencies_hz[0]))
        tap_phases = spots.phases_rad
        of_each = [spots.tap_frequencies_hz == frequency for frequency in frequencies]
        weights = [quadrature_weights(tap_phases[of]) for of in of_each]

        def solve(spots: Spots, brightness: Brightness | None = None) -> Ranges:
            assert isinstance(spots, CwSpots)
            electrons = spots.electrons(spots.taps[0])
            variance = spots.variance(electrons)
            phases, amplitudes, offsets, sigmas = (
                np.stack(values)
                for values in zip(
                    *(
                        demodulate(electrons[:, of], variance[:, of], inverse)
                        for of, inverse in zip(of_each, weights, strict=True)
                    ),
                    strict=True,
                )
            )
            path, sigma, ambiguous = path_from_phases(phases, sigmas, frequencies)
            paths = Paths(
                path_m=path,
                sigma_m=sigma,
                signal_electrons=amplitudes[first],
                background_electrons=offsets[first],
                saturated=spots.saturated[0].any(axis=1),
                no_signal=np.any(sigmas > 1 / MIN_SIGNAL, axis=0),
                ambiguous=ambiguous,
            )
            return ranges_from_paths(paths, spots)

        return solve

    def unambiguous_range_m(self, spots: Spots) -> float:
        """Range beyond which a spot appears nearer than it is."""
        assert isinstance(spots, CwSpots)
        return unambiguous_path_m(spots.tap_frequencies_hz) / 2


def demodulate(
    taps: Floats, variance: Floats, inverse: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Demodulate taps by least squares.

    Fits B + (A cos phi) cos theta_k + (A sin phi) sin theta_k; four taps at quarter periods give
    atan2(S1 - S3, S0 - S2). The variance of the taps propagates to first order: [sin^2 phi (v0 +
    v2) + cos^2 phi (v1 + v3)] / 4 A^2 for four taps; it is infinite without amplitude.

    Parameters
    ----------
    taps, variance : array, (..., K)
    inverse : array, (3, K)
        `quadrature_weights` of the taps' phases.

    Returns
    -------
    phase, amplitude, offset, sigma : array, (...,)
        With the standard deviation of the phase.
    """
    offset, cosine, sine = np.moveaxis(taps @ inverse.T, -1, 0)
    phase, amplitude = np.arctan2(sine, cosine), np.hypot(cosine, sine)
    tangential = np.cos(phase)[..., None] * inverse[2] - np.sin(phase)[..., None] * inverse[1]
    sigma = np.sqrt((tangential**2 * variance).sum(axis=-1))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return phase, amplitude, offset, np.where(amplitude > 0, sigma / amplitude, np.inf)


def quadrature_weights(tap_phases_rad: Floats) -> Floats:
    """Matrix (3, K) from K taps to B, A cos phi and A sin phi by least squares."""
    model = [np.ones_like(tap_phases_rad), np.cos(tap_phases_rad), np.sin(tap_phases_rad)]
    return np.linalg.pinv(np.stack(model, axis=1))


METHOD = Cw()

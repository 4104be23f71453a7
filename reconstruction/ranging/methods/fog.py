"""Ranges through fog: target and the fog's echo fitted together, all four spots at once.

For readings that are linear in light, taps of continuous wave and windows of pulses. The fog is
taken to be alike in all directions and of unknown extinction and backscattering; what it deviates
from that counts as noise. See `reconstruction.ranging.fog`.
"""

from dataclasses import replace

import numpy as np
from scipy.constants import c
from scipy.linalg import null_space

from ...arrays import Floats
from ...capture import Spots
from ...capture.readings.cw import CwSpots
from ...capture.readings.dtof import HistogramSpots
from ...capture.readings.pulsed import PulsedSpots
from ...errors import InputError
from ..fog.answer import ranges_of
from ..fog.echoes import with_echoes
from ..fog.edges import explained
from ..fog.histograms import find_histogram_modes, make_histogram_templates
from ..fog.modes import find_modes
from ..fog.overlap import check_known
from ..fog.posterior import posterior
from ..fog.templates import make_templates
from ..method import RangingSolver
from ..ranges import MIN_SIGNAL, Ranges
from ..unwrap import unambiguous_path_m

LONGEST_M = 40.0
"""Ranges beyond this are not looked for."""


class Fog:
    """A joint likelihood of the four spots and the fog that they share.

    Needs to know what the detectors see of the beams, and the laser's light in each reading.
    """

    title = "fog and target together"
    reads = (CwSpots, PulsedSpots, HistogramSpots)

    def compile(self, spots: Spots) -> RangingSolver:
        """Solver of one recording's readings."""
        check_known(spots)
        if isinstance(spots, HistogramSpots):
            return self._of_histograms(spots)
        assert isinstance(spots, CwSpots | PulsedSpots)
        scaled = bool(np.isfinite(spots.electrons_per_joule))
        electrons = spots.electrons_per_joule if scaled else 1.0
        longest_m = min(self.unambiguous_range_m(spots), LONGEST_M)
        combine = _combinations(spots, longest_m)

        def response(path_m: Floats) -> Floats:
            return combine @ (electrons * spots.response(path_m))

        templates = make_templates(spots, response, longest_m)

        def solve(spots: Spots) -> Ranges:
            assert isinstance(spots, CwSpots | PulsedSpots)
            readings = spots.electrons(spots.taps[0])
            variance = spots.variance(readings)
            saturated = spots.saturated[0].any(axis=1)
            covariance = (combine * variance[:, None]) @ combine.T
            echoes = readings @ combine.T
            dark = _deviations(echoes, covariance) < MIN_SIGNAL
            modes = find_modes(templates, echoes, covariance, ~saturated, scaled)
            known = posterior(modes, templates.extinction_per_m)
            spots_known = zip(known.spots, echoes, covariance, range(4), strict=True)
            known = replace(
                known,
                spots=tuple(
                    explained(each, templates, echo, noise, spot)
                    for each, echo, noise, spot in spots_known
                ),
            )
            return ranges_of(known, saturated, dark, readings.mean(axis=1))

        return solve

    def _of_histograms(self, spots: HistogramSpots) -> RangingSolver:
        if not spots.piles_up:
            raise InputError(
                "ranging in fog needs histograms of single photons; stamps of whole pulses, as "
                "those of a threshold, do not show how much light the fog sends back"
            )
        for name in ("response_sigma_s", "laser_energy_j"):
            if np.isnan(getattr(spots, name)):
                raise InputError(f"spots/{name} is not known (nan), and ranging in fog needs it")
        scaled = bool(np.isfinite(spots.electrons_per_joule))
        arrivals = (spots.electrons_per_joule if scaled else 1.0) * spots.laser_energy_j
        longest_m = min(self.unambiguous_range_m(spots), LONGEST_M)
        templates = make_histogram_templates(spots, arrivals / spots.pulses, longest_m)

        def solve(spots: Spots) -> Ranges:
            assert isinstance(spots, HistogramSpots)
            counts, saturated = spots.counts[0].astype(np.float64), spots.saturated[0]
            modes = find_histogram_modes(templates, counts, spots.pulses, ~saturated, scaled)
            known = posterior(modes, templates.extinction_per_m)
            known = replace(
                known,
                spots=tuple(
                    with_echoes(each, templates, counts[spot], spots.pulses, spot)
                    for spot, each in enumerate(known.spots)
                ),
            )
            background = np.median(counts, axis=1)
            dark = np.array([spot.strength < MIN_SIGNAL for spot in known.spots])
            return ranges_of(known, saturated, dark, background)

        return solve

    def unambiguous_range_m(self, spots: Spots) -> float:
        """Range from which on a spot looks nearer than it is, or is not looked for."""
        if isinstance(spots, CwSpots):
            return unambiguous_path_m(spots.tap_frequencies_hz) / 2
        if isinstance(spots, HistogramSpots):
            gate_s = spots.start_s + spots.counts.shape[-1] * spots.bin_width_s
            return float(c * (gate_s - spots.delay_offset_s) / 2)
        assert isinstance(spots, PulsedSpots)
        return float(c * (spots.window_starts_s[-1] - spots.delay_offset_s) / 2)


def _deviations(echoes: Floats, covariance: Floats) -> Floats:
    """How much more than noise echoes (4, n) are, in standard deviations of its chi squared."""
    n = echoes.shape[1]
    squares = (echoes * np.linalg.solve(covariance, echoes[..., None])[..., 0]).sum(axis=1)
    return np.asarray((squares - n) / np.sqrt(2 * n))


def _combinations(spots: CwSpots | PulsedSpots, longest_m: float) -> Floats:
    """Combinations (n, readings) of readings that steady light leaves at 0 and an echo does not.

    Raises InputError where the laser's light is not known, and where all echoes look alike.
    """
    told = spots.response(np.linspace(0, 2 * longest_m, 4001))
    if np.isnan(told).any():
        raise InputError(
            "the energy of the laser in each reading, or its contrast, is not known (nan), and "
            "ranging in fog needs it: echoes of different readings are compared"
        )
    free = null_space(spots.steady.T).T
    left, strength, _ = np.linalg.svd(free @ told, full_matrices=False)
    combine: Floats = left[:, strength > 1e-9 * strength[0]].T @ free
    return combine


METHOD = Fog()

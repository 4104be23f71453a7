"""Ranges through fog: target and the fog's echo fitted together, all four spots at once.

For readings that are linear in light, taps of continuous wave and windows of pulses. The fog is
taken to be alike in all directions and of unknown extinction and backscattering; what it deviates
from that counts as noise. See `reconstruction.ranging.fog`.
"""

import numpy as np
from scipy.linalg import null_space

from ...arrays import Floats
from ...capture import Spots
from ...capture.readings.cw import CwSpots
from ...capture.readings.pulsed import PulsedSpots
from ...errors import InputError
from ..fog.modes import find_modes
from ..fog.overlap import check_known
from ..fog.posterior import posterior
from ..fog.templates import make_templates
from ..method import RangingSolver
from ..ranges import MIN_SIGNAL, Ranges
from ..unwrap import unambiguous_path_m

CERTAIN = 0.9
"""Probability of its likeliest range from which on a spot has one."""
NARROW_M = 0.3
"""A range is one if so much of its probability lies within this much of its mean."""


class Fog:
    title = "fog and target together"
    reads = (CwSpots, PulsedSpots)

    def compile(self, spots: Spots) -> RangingSolver:
        assert isinstance(spots, CwSpots | PulsedSpots)
        check_known(spots)
        if np.isnan(spots.response(np.ones(1))).any():
            raise InputError("spots/laser energy unknown")
        scaled = bool(np.isfinite(spots.electrons_per_joule))
        electrons = spots.electrons_per_joule if scaled else 1.0
        longest_m = self.unambiguous_range_m(spots)
        combine = _combinations(spots, longest_m)

        def response(path_m: Floats) -> Floats:
            return combine @ (electrons * spots.response(path_m))

        templates = make_templates(spots, response, longest_m)

        def solve(spots: Spots):
            assert isinstance(spots, CwSpots | PulsedSpots)
            taps = spots.electrons(spots.taps[0])
            variance = spots.variance(taps)
            usable = ~spots.saturated[0].any(axis=1)
            covariance = (combine * variance[:, None]) @ combine.T
            modes = find_modes(templates, taps @ combine.T, covariance, usable, scaled)
            return posterior(modes, templates.extinction_per_m)

        return solve

    def unambiguous_range_m(self, spots: Spots) -> float:
        if isinstance(spots, CwSpots):
            return unambiguous_path_m(spots.tap_frequencies_hz) / 2
        raise NotImplementedError


def _combinations(spots, longest_m: float) -> Floats:
    """Combinations (n, readings) of readings that steady light leaves at 0 and an echo does not."""
    free = null_space(spots.steady.T).T
    told = free @ spots.response(np.linspace(0, 2 * longest_m, 4001))
    left, strength, _ = np.linalg.svd(told, full_matrices=False)
    return (left[:, strength > 1e-9 * strength[0]]).T @ free


METHOD = Fog()

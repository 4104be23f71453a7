"""From the readings of a frame and what is held of the fog to ranges, and what is held then."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.special import chdtri, ndtr

from ...arrays import Floats, Mask
from ...capture import Spots
from ...capture.readings.cw import CwSpots
from ...capture.readings.dtof import HistogramSpots
from ...capture.readings.pulsed import PulsedSpots
from ...errors import InputError
from ..histogram import BLOCKS
from ..ranges import MIN_SIGNAL, Ranges
from .answer import ranges_of
from .belief import FogBelief
from .echoes import with_echoes
from .edges import with_edges
from .histograms import find_histogram_modes, make_histogram_templates
from .modes import find_modes
from .overlap import check_known
from .posterior import posterior
from .templates import make_templates

NOMINAL_ELECTRONS_PER_JOULE = 5e18
"""Where it is not known: 7 in 10 photons of 1550 nm, behind a lens and a filter."""

FogSolver = Callable[[Spots, FogBelief], tuple[Ranges, FogBelief]]


def fog_solver(spots: Spots, longest_m: float) -> FogSolver:
    """Solver of one recording's readings, of targets up to a range.

    Raises InputError where the recording does not tell what the detectors see of the beams, or how
    much light the lasers send.
    """
    check_known(spots)
    if isinstance(spots, HistogramSpots):
        return _of_histograms(spots, longest_m)
    assert isinstance(spots, CwSpots | PulsedSpots)
    return _of_charge(spots, longest_m)


def _of_charge(spots: CwSpots | PulsedSpots, longest_m: float) -> FogSolver:
    scaled = bool(np.isfinite(spots.electrons_per_joule))
    combine, response = echo_combinations(spots, longest_m)
    templates = make_templates(spots, response, longest_m)

    def solve(spots: Spots, belief: FogBelief) -> tuple[Ranges, FogBelief]:
        assert isinstance(spots, CwSpots | PulsedSpots)
        readings = spots.electrons(spots.taps[0])
        variance = spots.variance(readings)
        saturated = spots.saturated[0].any(axis=1)
        covariance = (combine * variance[:, None]) @ combine.T
        echoes = readings @ combine.T
        dark = _squares(echoes, covariance) < chdtri(len(combine), ndtr(-MIN_SIGNAL))
        modes = find_modes(templates, echoes, covariance, ~saturated, scaled)
        known = posterior(modes, belief)
        known = with_edges(known, modes, belief, templates, echoes, covariance)
        mean = readings.mean(axis=1)
        return ranges_of(known, saturated, dark, mean, len(combine)), known.fog

    return solve


def _of_histograms(spots: HistogramSpots, longest_m: float) -> FogSolver:
    if not spots.piles_up:
        raise InputError(
            "ranging in fog needs histograms of single photons; stamps of whole pulses, as those "
            "of a threshold, do not show how much light the fog sends back"
        )
    for name in ("response_sigma_s", "laser_energy_j"):
        if np.isnan(getattr(spots, name)):
            raise InputError(f"spots/{name} is not known (nan), and ranging in fog needs it")
    scaled = bool(np.isfinite(spots.electrons_per_joule))
    electrons = spots.electrons_per_joule if scaled else NOMINAL_ELECTRONS_PER_JOULE
    arrivals = electrons * spots.laser_energy_j
    templates = make_histogram_templates(spots, arrivals / spots.pulses, longest_m)

    def solve(spots: Spots, belief: FogBelief) -> tuple[Ranges, FogBelief]:
        assert isinstance(spots, HistogramSpots)
        counts, saturated = spots.counts[0].astype(np.float64), spots.saturated[0]
        modes = find_histogram_modes(templates, counts, spots.pulses, ~saturated, scaled)
        known = posterior(modes, belief)
        revised = tuple(
            with_echoes(each, templates, counts[spot], spots.pulses, spot)
            for spot, each in enumerate(known.spots)
        )
        known = replace(known, spots=revised)
        dark = _is_even(counts)
        median = np.median(counts, axis=1)
        return ranges_of(known, saturated, dark, median, counts.shape[1]), known.fog

    return solve


def _squares(echoes: Floats, covariance: Floats) -> Floats:
    """Chi squared (4,) of echoes (4, n) that are but noise."""
    return np.asarray((echoes * np.linalg.solve(covariance, echoes[..., None])[..., 0]).sum(axis=1))


def _is_even(counts: Floats) -> Mask:
    """Whether histograms (4, B) show no more than arrivals at any time, (4,)."""
    blocks = np.stack([part.sum(axis=1) for part in np.array_split(counts, BLOCKS, axis=1)])
    mean = np.maximum(blocks.mean(axis=0), 1e-12)
    squares = ((blocks - mean) ** 2 / mean).sum(axis=0)
    return np.asarray(squares < chdtri(BLOCKS - 1, ndtr(-MIN_SIGNAL)))


def echo_combinations(
    spots: CwSpots | PulsedSpots, longest_m: float
) -> tuple[Floats, Callable[[Floats], Floats]]:
    """Combinations (n, readings) of readings that steady light leaves at 0 and an echo does not.

    With them what all of a laser's light leaves in these, (n, ...), by its path (...). Raises
    InputError where the laser's light is not known, and where all echoes look alike.
    """
    told = spots.response(np.linspace(0, 2 * longest_m, 4001))
    if np.isnan(told).any():
        raise InputError(
            "the energy of the laser in each reading, or its contrast, is not known (nan), and "
            "ranging in fog needs it: echoes of different readings are compared"
        )
    free = _unmoved(spots.steady)
    left, strength, _ = np.linalg.svd(free @ told, full_matrices=False)
    combine: Floats = left[:, strength > 1e-9 * strength[0]].T @ free
    known = np.isfinite(spots.electrons_per_joule)
    electrons = spots.electrons_per_joule if known else NOMINAL_ELECTRONS_PER_JOULE

    def response(path_m: Floats) -> Floats:
        return combine @ (electrons * spots.response(path_m))

    return combine, response


def _unmoved(steady: Floats) -> Floats:
    """Orthonormal combinations (n, readings) of readings in which steady light cancels."""
    _, strength, combinations = np.linalg.svd(steady.T)
    tiny = np.finfo(np.float64).eps * max(steady.shape) * strength.max()
    return np.asarray(combinations[np.count_nonzero(strength > tiny) :])

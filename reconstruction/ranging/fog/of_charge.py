"""Fits of fog and targets to charges of taps or windows."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...base.arrays import Floats
from ...base.errors import InputError
from ...capture import Optics, Spots
from ...capture.readings.cw import CwSpots
from ...capture.readings.pulsed import PulsedSpots
from ..brightness import Brightness
from ..ranges import MIN_SIGNAL, Ranges
from ..weather import weather_of
from .answer import TOLERANCE_M, ranges_of, statuses
from .edges import UNLIKELY, disagreement, odd_spots, with_edges
from .fog_state import FogSolver, FogState
from .fog_visibility import visibility_of
from .modes import find_modes
from .numerics import chi_squared_limit, normal_cdf
from .posterior import Posterior, SpotPosterior, posterior
from .target_prior import INTERVALS, REACH_M
from .templates import (
    EXTINCTIONS_PER_M,
    NOMINAL_ELECTRONS_PER_JOULE,
    STEP_M,
    Templates,
    make_templates,
)
from .underdetermined import PER_TARGET, underdetermined_solver

DOUBTFUL = 0.1
"""Probability of the spots' disagreement on the fog, below which"""
ROUGH = 4.0
"""uneven fog with this many times the usual deviation is tried, as at the end of a bank."""
STANDS_OUT = 20.0
"""Minimum strength of targets in such fog, in standard deviations; weaker ones may be fog."""
MAX_ODD = 0.5
"""Maximum fraction of the spots that are on edges at once."""


def charge_solver(
    spots: CwSpots | PulsedSpots, optics: Optics | None, max_range_m: float
) -> FogSolver:
    """Solver of a recording's charges; raises InputError as `echo_combinations`."""
    spots.check_noise(len(spots.directions))
    combine, response = echo_combinations(spots, max_range_m)
    if len(combine) == PER_TARGET:
        return underdetermined_solver(spots, optics, combine, response, max_range_m)
    scaled = bool(np.isfinite(spots.electrons_per_joule))
    twice_m = INTERVALS * max_range_m
    repeats = isinstance(spots, CwSpots) and scaled and twice_m <= REACH_M
    ends_m = twice_m + 2 * STEP_M if repeats else max_range_m
    templates = make_templates(spots, response, ends_m, unambiguous_m=max_range_m)
    rough = templates.rougher(ROUGH)
    noise = chi_squared_limit(len(combine), normal_cdf(-MIN_SIGNAL))

    def solve(
        spots: Spots, prior: FogState, brightness: Brightness | None
    ) -> tuple[Ranges, FogState]:
        assert isinstance(spots, CwSpots | PulsedSpots)
        readings = spots.electrons(spots.taps[0])
        variance = spots.variance(readings)
        saturated = spots.saturated[0].any(axis=1)
        covariance = (combine * variance[:, None]) @ combine.T
        echoes = readings @ combine.T
        chi_squared = (echoes * np.linalg.solve(covariance, echoes[..., None])[..., 0]).sum(axis=1)
        dark = chi_squared < noise

        def fit(templates: Templates) -> tuple[Posterior, Posterior]:
            modes = find_modes(templates, echoes, covariance, ~saturated, scaled)
            estimate = posterior(modes, prior, len(echoes))
            return estimate, with_edges(estimate, modes, prior, templates, echoes, covariance)

        single, estimate = fit(templates)
        chance = disagreement(single, len(combine))
        if chance < DOUBTFUL:
            _, other = fit(rough)
            if chance < UNLIKELY:
                estimate = _of_a_bank(other, estimate, odd_spots(single, len(combine)))
            else:
                estimate = _unless_rough(estimate, other)
        ranges = ranges_of(
            estimate.spots,
            statuses(estimate, saturated, dark),
            readings.mean(axis=1),
            estimate.fog.optics(EXTINCTIONS_PER_M),
            visibility_of(estimate.fog, EXTINCTIONS_PER_M) if scaled else None,
            max_range_m if repeats else np.inf,
        )
        return ranges, estimate.fog

    return FogSolver(FogState.prior(EXTINCTIONS_PER_M, weather_of(spots)), solve)


def _of_a_bank(rough: Posterior, even: Posterior, odd: list[int]) -> Posterior:
    """Posterior of rough fog, with the ``odd`` spots, if few, taken for edges."""
    spots = (
        even.spots[number]
        if number in odd and len(odd) <= MAX_ODD * len(rough.spots)
        else replace(spot, needed=STANDS_OUT)
        for number, spot in enumerate(rough.spots)
    )
    return Posterior(tuple(spots), rough.fog)


def _unless_rough(even: Posterior, rough: Posterior) -> Posterior:
    """Posterior of even fog, replaced for spots that rough fog puts elsewhere."""

    def same(one: SpotPosterior, other: SpotPosterior) -> bool:
        ranges_m = [each.alternatives[0].range_m for each in (one, other) if each.alternatives]
        return len(ranges_m) == 2 and abs(ranges_m[0] - ranges_m[1]) < TOLERANCE_M

    spots = (
        one if one.on_edge or same(one, other) else other
        for one, other in zip(even.spots, rough.spots, strict=True)
    )
    return Posterior(tuple(spots), even.fog)


def echo_combinations(
    spots: CwSpots | PulsedSpots, max_range_m: float
) -> tuple[Floats, Callable[[Floats], Floats]]:
    """Combinations (n, readings) that cancel steady light but not an echo.

    Also returns the response of these, (n, ...), to all of a laser's light by path length (...).
    Raises InputError if the laser's light is unknown, or no echo changes the readings.
    """
    response_table = spots.response(np.linspace(0, 2 * max_range_m, 4001))
    if np.isnan(response_table).any():
        raise InputError(
            "the energy of the laser in each reading, or its contrast, is unknown (nan), but "
            "ranging in fog needs it to compare the echoes of different readings"
        )
    free = _unmoved(spots.steady)
    left, strength, _ = np.linalg.svd(free @ response_table, full_matrices=False)
    if not strength[0] > 0:
        raise InputError(
            f"no echo from within {max_range_m:.3g} m reaches any reading: the times of the "
            "windows or spots/delay_offset_s must be wrong"
        )
    combine: Floats = left[:, strength > 1e-9 * strength[0]].T @ free
    finite = np.isfinite(spots.electrons_per_joule)
    electrons = spots.electrons_per_joule if finite else NOMINAL_ELECTRONS_PER_JOULE

    def response(path_m: Floats) -> Floats:
        return combine @ (electrons * spots.response(path_m))

    return combine, response


def _unmoved(steady: Floats) -> Floats:
    """Orthonormal combinations (n, readings) in which steady light cancels."""
    _, strength, combinations = np.linalg.svd(steady.T)
    tiny = np.finfo(np.float64).eps * max(steady.shape) * strength.max()
    return np.asarray(combinations[np.count_nonzero(strength > tiny) :])

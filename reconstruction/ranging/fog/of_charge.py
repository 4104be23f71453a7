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
from .answer import ranges_of, statuses
from .edges import with_edges
from .fog_state import FogSolver, FogState
from .fog_visibility import visibility_of
from .modes import find_modes
from .numerics import chi_squared_limit, normal_cdf
from .posterior import Posterior, posterior
from .target_prior import INTERVALS, REACH_M
from .templates import (
    EXTINCTIONS_PER_M,
    NOMINAL_ELECTRONS_PER_JOULE,
    STEP_M,
    make_templates,
)
from .underdetermined import PER_TARGET, underdetermined_solver
from .uneven import ROUGH, averaged

MAX_ON_EDGES = 0.5
"""Maximum fraction of the spots that are on edges at once; more are fog that differs."""
CLEAR = 0.5
"""Probability of clear air above which,"""
MAX_CLEAR_MISFIT = 10.0
"""and misfit of every spot below which, the fog is not tried for being uneven."""


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

        modes = find_modes(templates, echoes, covariance, ~saturated, scaled)
        even = posterior(modes, prior, len(echoes))
        estimate = with_edges(even, modes, prior, templates, echoes, covariance)
        edges = [number for number, each in enumerate(estimate.spots) if each.on_edge]
        if len(edges) > MAX_ON_EDGES * len(echoes):
            estimate, edges = even, []
        if not _is_clear(estimate):
            uneven = find_modes(rough, echoes, covariance, ~saturated, scaled)
            estimate = replace(estimate, spots=averaged(estimate, uneven, prior, edges))
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


def _is_clear(estimate: Posterior) -> bool:
    """Whether clear air explains the readings of all spots."""
    misfits = [each.misfit for each in estimate.spots if each.alternatives and not each.on_edge]
    return estimate.fog.probability[0] > CLEAR and max(misfits, default=0.0) < MAX_CLEAR_MISFIT


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

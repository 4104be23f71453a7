"""Fits of fog and targets to charges that were collected in taps or delayed windows."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...arrays import Floats
from ...capture import Spots
from ...capture.readings.cw import CwSpots
from ...capture.readings.pulsed import PulsedSpots
from ...errors import InputError
from ..ranges import MIN_SIGNAL, Ranges
from .answer import ranges_of
from .belief import FogBelief, FogSolver
from .chances import chi_squared_limit, normal_share
from .edges import contradicted, odd_spots, with_edges
from .modes import find_modes
from .posterior import Posterior, posterior
from .templates import NOMINAL_ELECTRONS_PER_JOULE, Templates, make_templates

ROUGH = 4.0
"""Where spots do not agree on a fog, its density deviates so many times more than usual: by as much
as there is, as at the end of a bank,"""
STANDS_OUT = 20.0
"""and targets weaker than this, in standard deviations, may be a part of it."""
MANY = 3
"""So many spots are not on edges at once."""


def charge_solver(spots: CwSpots | PulsedSpots, longest_m: float) -> FogSolver:
    """Solver of one recording's charges; raises InputError as `echo_combinations`."""
    scaled = bool(np.isfinite(spots.electrons_per_joule))
    combine, response = echo_combinations(spots, longest_m)
    templates = make_templates(spots, response, longest_m)
    rough = templates.rougher(ROUGH)
    noise = chi_squared_limit(len(combine), normal_share(-MIN_SIGNAL))

    def solve(spots: Spots, belief: FogBelief) -> tuple[Ranges, FogBelief]:
        assert isinstance(spots, CwSpots | PulsedSpots)
        readings = spots.electrons(spots.taps[0])
        variance = spots.variance(readings)
        saturated = spots.saturated[0].any(axis=1)
        covariance = (combine * variance[:, None]) @ combine.T
        echoes = readings @ combine.T
        dark = _squares(echoes, covariance) < noise

        def fit(templates: Templates) -> tuple[Posterior, Posterior]:
            modes = find_modes(templates, echoes, covariance, ~saturated, scaled)
            known = posterior(modes, belief)
            return known, with_edges(known, modes, belief, templates, echoes, covariance)

        single, known = fit(templates)
        if contradicted(single, len(combine)):
            edges = odd_spots(single, len(combine))
            known = _in_rough_fog(fit(rough)[1], known, edges if len(edges) < MANY else [])
        mean = readings.mean(axis=1)
        return ranges_of(known, saturated, dark, mean, len(combine)), known.fog

    return solve


def _in_rough_fog(rough: Posterior, even: Posterior, edges: list[int]) -> Posterior:
    """What rough fog leaves of the spots, but of those that are on ``edges`` rather."""
    spots = (
        even.spots[number] if number in edges else replace(spot, needed=STANDS_OUT)
        for number, spot in enumerate(rough.spots)
    )
    return Posterior(tuple(spots), rough.fog)


def _squares(echoes: Floats, covariance: Floats) -> Floats:
    """Chi squared (4,) of echoes (4, n) that are but noise."""
    return np.asarray((echoes * np.linalg.solve(covariance, echoes[..., None])[..., 0]).sum(axis=1))


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

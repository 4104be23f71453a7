"""Fits of fog and targets to charges that were collected in taps or delayed windows."""

from collections.abc import Callable

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
from .edges import with_edges
from .modes import find_modes
from .posterior import posterior
from .templates import NOMINAL_ELECTRONS_PER_JOULE, make_templates


def charge_solver(spots: CwSpots | PulsedSpots, longest_m: float) -> FogSolver:
    """Solver of one recording's charges; raises InputError as `echo_combinations`."""
    scaled = bool(np.isfinite(spots.electrons_per_joule))
    combine, response = echo_combinations(spots, longest_m)
    templates = make_templates(spots, response, longest_m)
    noise = chi_squared_limit(len(combine), normal_share(-MIN_SIGNAL))

    def solve(spots: Spots, belief: FogBelief) -> tuple[Ranges, FogBelief]:
        assert isinstance(spots, CwSpots | PulsedSpots)
        readings = spots.electrons(spots.taps[0])
        variance = spots.variance(readings)
        saturated = spots.saturated[0].any(axis=1)
        covariance = (combine * variance[:, None]) @ combine.T
        echoes = readings @ combine.T
        dark = _squares(echoes, covariance) < noise
        modes = find_modes(templates, echoes, covariance, ~saturated, scaled)
        known = posterior(modes, belief)
        known = with_edges(known, modes, belief, templates, echoes, covariance)
        mean = readings.mean(axis=1)
        return ranges_of(known, saturated, dark, mean, len(combine)), known.fog

    return solve


def _squares(echoes: Floats, covariance: Floats) -> Floats:
    """Chi squared (4,) of echoes (4, n) that are but noise."""
    return np.asarray((echoes * np.linalg.solve(covariance, echoes[..., None])[..., 0]).sum(axis=1))


def echo_combinations(
    spots: CwSpots | PulsedSpots, longest_m: float
) -> tuple[Floats, Callable[[Floats], Floats]]:
    """Combinations (n, readings) of readings that steady light leaves at 0 and an echo does not.

    With them what all of a laser's light leaves in these, (n, ...), by its path (...). Raises
    InputError where the laser's light is not known, and where no echo tells anything.
    """
    told = spots.response(np.linspace(0, 2 * longest_m, 4001))
    if np.isnan(told).any():
        raise InputError(
            "the energy of the laser in each reading, or its contrast, is not known (nan), and "
            "ranging in fog needs it: echoes of different readings are compared"
        )
    free = _unmoved(spots.steady)
    left, strength, _ = np.linalg.svd(free @ told, full_matrices=False)
    if not strength[0] > 0:
        raise InputError(
            f"no echo from within {longest_m:.3g} m comes into any reading: the times of the "
            "windows and spots/delay_offset_s cannot be right"
        )
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

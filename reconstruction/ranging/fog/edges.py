"""Spots on two surfaces at once: on an edge, a twig, a pane.

If target and fog do not explain the readings of a spot, two targets are tried in every pair of
ranges, and the best pairs refined by Gauss-Newton. Surfaces closer than about a quarter of the
shortest wavelength of the readings always look like one between them.
"""

from dataclasses import replace

import numpy as np

from ...base.arrays import Floats
from ..ranges import Alternative
from .fog_state import FogState
from .modes import MAX_STEP_M, MIN_RANGE_M, Indices, Modes
from .numerics import chi_squared_limit, inverse, solved
from .posterior import Posterior, SpotPosterior, joined, posterior
from .target_prior import even_log_prior
from .templates import SEARCH, STEP_M, Templates

UNLIKELY = 1e-3
"""Misfits less probable than this need another explanation."""
MIN_GAIN = 12.0
"""Minimum reduction of chi squared by a second target."""
MAX_EDGE_M = 12.0
"""Maximum range of two targets: the pairs are as many as the square of the ranges."""
MIN_SEPARATION_M = 0.05
"""Two targets closer to each other count as one."""
PAIRS = 24
STEPS = 8


def with_edges(
    given: Posterior,
    modes: Modes,
    prior: FogState,
    templates: Templates,
    readings: Floats,
    covariance: Floats,
) -> Posterior:
    """Posterior of S spots, readings (S, n) of covariance (S, n, n), two targets considered.

    Spots on edges say nothing about the fog, which follows from the others. If even two targets do
    not explain the readings, sigmas grow with the remaining misfit.
    """
    n = readings.shape[1]
    odd = odd_spots(given, n)
    if not odd:
        return given
    fog = _without(odd, modes, prior, given).fog
    pairs = {
        spot: _two_targets(
            given.spots[spot].misfit, fog, templates, readings[spot], covariance[spot], spot
        )
        for spot in odd
    }
    edges = [spot for spot, pair in pairs.items() if pair]
    others = _without(edges, modes, prior, given)

    def revised(number: int) -> SpotPosterior:
        if number in edges:
            return replace(given.spots[number], alternatives=pairs[number], on_edge=True)
        spot = others.spots[number]
        return _wider(spot, n) if number in odd else spot

    spots = tuple(map(revised, range(len(given.spots))))
    return Posterior(spots, others.fog, others.log_evidence)


def _without(spots: list[int], modes: Modes, prior: FogState, given: Posterior) -> Posterior:
    """Posterior without these spots; the given one if none are left."""
    others = ~np.isin(modes.spot, spots)
    return (
        posterior(modes.only(others), prior, len(given.spots)) if spots and others.any() else given
    )


def _wider(spot: SpotPosterior, readings: int) -> SpotPosterior:
    growth = max(1.0, np.sqrt(spot.misfit / _freedom(readings)))
    wider = tuple(each._replace(sigma_m=growth * each.sigma_m) for each in spot.alternatives)
    return replace(spot, alternatives=wider, noise_m=growth * spot.noise_m)


def odd_spots(given: Posterior, readings: int) -> list[int]:
    """Spots whose misfit with a single target is improbable."""
    limit = chi_squared_limit(_freedom(readings), UNLIKELY)
    spots = enumerate(given.spots)
    return [number for number, spot in spots if spot.alternatives and spot.misfit > limit]


def _freedom(readings: int) -> int:
    return max(readings - 2, 1)


def _two_targets(
    single: float,
    prior: FogState,
    templates: Templates,
    readings: Floats,
    covariance: Floats,
    spot: int,
) -> tuple[Alternative, ...]:
    """Ranges of two targets, none unless they fit much better than a ``single`` one."""
    node = int(prior.probability.argmax())
    backscatter = float(np.exp(prior.log_median[node]))
    target, fog = templates.target[spot, node], templates.fog[spot, node]
    noise = covariance + backscatter**2 * templates.typical_uneven[spot, node]
    white = np.linalg.inv(np.linalg.cholesky(noise))
    first = np.searchsorted(templates.range_m, MIN_RANGE_M)
    last = np.searchsorted(templates.range_m, min(templates.unambiguous_m, MAX_EDGE_M)) - 1
    positions = np.arange(first, last, SEARCH)
    a = white @ target[:, positions]
    y = white @ (readings - backscatter * fog[:, last])
    near, far = _best_pairs(a, y)
    at = np.stack([positions[near], positions[far]], axis=1).astype(np.float64)
    at, rho, misfit, information = _refined(white @ target, y, at)
    apart = np.abs(at[:, 1] - at[:, 0]) * STEP_M > MIN_SEPARATION_M
    variance = np.diagonal(inverse(information), axis1=1, axis2=2)[:, :2]
    localised = (variance < MIN_SEPARATION_M**2).all(axis=1)
    retained = (rho > 0).all(axis=1) & (misfit < single - MIN_GAIN) & apart & localised
    if not retained.any():
        return ()
    at, rho, misfit, information, variance = (
        each[retained] for each in (at, rho, misfit, information, variance)
    )
    log_weight = -(misfit + np.linalg.slogdet(information)[1]) / 2
    log_weight += even_log_prior(rho).sum(axis=1)
    weight = np.exp(log_weight - log_weight.max())
    fraction = weight[:, None] * rho / rho.sum(axis=1, keepdims=True)
    range_m = templates.range_m[0] + STEP_M * at
    return joined(np.stack([range_m, variance, fraction], axis=-1).reshape(-1, 3).tolist())


def _best_pairs(a: Floats, y: Floats) -> tuple[Indices, Indices]:
    """Columns of the pairs of targets (n, R) with the least misfit of readings (n,)."""
    gram, ya = a.T @ a, y @ a
    own = np.diagonal(gram)
    determinant = np.outer(own, own) - gram**2
    with np.errstate(divide="ignore", invalid="ignore"):
        one = (ya[:, None] * own - ya * gram) / determinant
        other = (ya * own[:, None] - ya[:, None] * gram) / determinant
        gained = one * ya[:, None] + other * ya
    possible = (one > 0) & (other > 0) & (determinant > 1e-9 * np.outer(own, own))
    gained = np.triu(np.where(possible, gained, 0), 1)
    inner = gained[1:-1, 1:-1]
    peak = inner > 0
    for rows in (slice(0, -2), slice(1, -1), slice(2, None)):
        for columns in (slice(0, -2), slice(1, -1), slice(2, None)):
            peak &= inner >= gained[rows, columns]
    near, far = np.nonzero(peak)
    best = np.argsort(-inner[near, far])[:PAIRS]
    return near[best] + 1, far[best] + 1


def _refined(targets: Floats, y: Floats, at: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Indices (P, 2), reflectances (P, 2), misfits (P,) and information (P, 4, 4) of pairs."""
    max_index = targets.shape[1] - 2.0
    rho = np.zeros_like(at)
    for step in range(STEPS + 1):
        low = np.clip(at.astype(int), 0, int(max_index))
        fraction = (at - low)[..., None]
        here, there = targets.T[low], targets.T[low + 1]
        value = here + fraction * (there - here)  # (P, 2, n)
        if step == 0:
            rho = solved(value @ value.swapaxes(1, 2), value @ y)
        slope = rho[..., None] * (there - here) / STEP_M
        jacobian = np.concatenate([slope, value], axis=1)  # (P, 4, n)
        residual = y - (rho[..., None] * value).sum(axis=1)
        information = jacobian @ jacobian.swapaxes(1, 2)
        if step == STEPS:
            break
        move = solved(information, (jacobian @ residual[..., None])[..., 0])
        at = np.clip(at + np.clip(move[:, :2], -MAX_STEP_M, MAX_STEP_M) / STEP_M, 1, max_index)
        rho = rho + move[:, 2:]
    return at, rho, (residual**2).sum(axis=1), information

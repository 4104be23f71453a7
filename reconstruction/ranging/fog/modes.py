"""Modes of the likelihood of a spot: ranges at which target and fog explain its readings.

For each spot and extinction of the tables, reflectance and backscattering are linear; with them in
closed form the misfit is known at all ranges. Its minima are refined by Gauss-Newton over range,
reflectance and backscattering. Around each, the misfit is a parabola.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Floats, Mask
from .numerics import RIDGE, cholesky, whitened
from .target_prior import even_log_prior, range_log_prior
from .templates import PATCH_STEP, SEARCH, STEP_M, Templates

Indices = NDArray[np.intp]

BACKSCATTER_PER_SR = 0.035
"""Median of albedo times phase function at 180 degrees over fogs (Mie, 1550 nm),"""
LOG_SIGMA = 0.6
"""and sigma of its logarithm."""
MIN_RANGE_M = 0.3
MAX_EXCESS_MISFIT = 40.0
"""Minima worse than the best by more, in chi squared, are dropped: of each spot, extinction and
unambiguous interval. Only at searched ranges is chi squared known, and two minima of equal phases
lie differently between them."""
MIN_STRENGTH = 0.3
"""Modes of weaker targets, in standard deviations, count as none."""
STEPS = 3
UNEVEN_STEPS = 2
"""Steps that update the noise of uneven fog."""
MAX_STEP_M = 0.05
BLOCK = 8
"""Spots searched at once, so that their tables stay in the processor's cache."""
EMPTY = 0.5
"""Prior probability that a spot has no target within range."""


@dataclass(frozen=True, eq=False)
class Modes:
    """Minima of the misfit, each (C,): indices of spot and extinction, and the parabola around it.

    With all else optimal, the log likelihood at backscattering beta is ``log_weight + slope x -
    curvature x^2 / 2``, x = beta - ``backscatter``; the range then is ``range_m + drift x`` with
    variance ``variance_m2``, nan without a target. ``strength`` is the target's signal in standard
    deviations, ``signal`` in electrons, ``misfit`` chi squared.
    """

    spot: Indices
    node: Indices
    range_m: Floats
    backscatter: Floats
    log_weight: Floats
    slope: Floats
    curvature: Floats
    drift: Floats
    variance_m2: Floats
    strength: Floats
    signal: Floats
    misfit: Floats

    @classmethod
    def of_fog(cls, spot: Indices, node: Indices, *fitted: Floats, misfit: Floats) -> "Modes":
        """Modes without a target; ``fitted`` are the fields from backscatter to curvature."""
        beta, log_weight, slope, curvature = fitted
        no, nan = np.zeros(spot.size), np.full(spot.size, np.nan)
        return cls(spot, node, nan, beta, log_weight, slope, curvature, no, no, no, no, misfit)

    def only(self, chosen: Mask | Indices) -> "Modes":
        """A subset of the modes."""
        return Modes(*(values[chosen] for values in vars(self).values()))

    def joined_with(self, others: "Modes") -> "Modes":
        """These modes and others."""
        pairs = zip(vars(self).values(), vars(others).values(), strict=True)
        return Modes(*(np.concatenate(pair) for pair in pairs))


def expected_backscatter(extinction_per_m: Floats) -> Floats:
    """Median backscattering, 1 / (m sr), of fog of an extinction."""
    return BACKSCATTER_PER_SR * extinction_per_m


def find_modes(
    templates: Templates, readings: Floats, covariance: Floats, usable: Mask, scaled: bool
) -> Modes:
    """Modes of readings (spots, n) with covariance (spots, n, n), of the ``usable`` ones (spots,).

    ``scaled``: the templates are in units of the readings, so that reflectances have a prior.
    """
    blocks = [slice(first, first + BLOCK) for first in range(0, len(readings), BLOCK)]
    is_minimum = [_is_minimum(templates, readings, covariance, block) for block in blocks]
    minima = np.nonzero(np.concatenate(is_minimum) & usable[:, None, None])
    result = _refine(templates, readings, covariance, minima, scaled)
    return result.joined_with(_without_target(templates, readings, covariance, usable))


def _without_target(
    templates: Templates, readings: Floats, covariance: Floats, usable: Mask
) -> Modes:
    """Modes of fog alone: likely where the target is too weak."""
    guess = expected_backscatter(templates.extinction_per_m)
    spot, node = np.nonzero(np.repeat(usable[:, None], guess.size, axis=1))
    beta = guess[node]
    uneven = templates.uneven[spot, node, -1]
    lower = cholesky(covariance[spot] + (beta**2)[:, None, None] * uneven)
    vectors = [readings[spot].T, templates.fog[spot, node, :, -1].T]
    y, g = whitened(lower, np.stack(vectors, axis=1)).swapaxes(0, 1)
    residual = y - beta * g
    misfit = (residual**2).sum(axis=0)
    root = np.log(np.diagonal(lower)).sum(axis=1)  # of the determinant
    odds = EMPTY / (1 - EMPTY)
    # Over ranges and reflectances a target's likelihood integrates to 2 pi / determinant^(1/2).
    log_weight = np.log(odds / (2 * np.pi)) - misfit / 2 - root
    slope, curvature = (g * residual).sum(axis=0), (g * g).sum(axis=0)
    return Modes.of_fog(spot, node, beta, log_weight, slope, curvature, misfit=misfit)


def _is_minimum(templates: Templates, readings: Floats, covariance: Floats, block: slice) -> Mask:
    """Minima (spots, K, R) of the misfit at the inner searched ranges, of a block of spots."""
    guess = expected_backscatter(templates.extinction_per_m)
    uneven = guess[:, None, None] ** 2 * templates.typical_uneven[block]
    noise = covariance[block, None] + uneven
    white = np.linalg.inv(np.linalg.cholesky(noise))  # (spots, K, n, n)
    a, g = (white @ table[block] for table in templates.searched)
    y = readings[block, None, None] @ white.swapaxes(2, 3)
    prior = 1 / (guess * LOG_SIGMA) ** 2
    aa, ag, gg = (np.einsum("sknr,sknr->skr", *pair) for pair in ((a, a), (a, g), (g, g)))
    gg += prior[:, None]
    ya, yg = ((y @ each)[:, :, 0] for each in (a, g))
    yg += (prior * guess)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        shared, alone = ag / aa, ya / aa
        pull = yg - shared * ya
        beta = np.maximum(pull / (gg - shared * ag), 0)
        rho = alone - shared * beta
        misfit = (y**2).sum(axis=3) + (prior * guess**2)[:, None] - alone * ya - beta * pull
    misfit = np.where((rho > 0) & (templates.range_m[::SEARCH] > MIN_RANGE_M), misfit, np.inf)
    inner = misfit[..., 1:-1]
    beyond = templates.range_m[SEARCH:-SEARCH:SEARCH] > templates.unambiguous_m
    likely = np.zeros(inner.shape, dtype=bool)
    for interval in (~beyond, beyond):
        if interval.any():
            some = inner[..., interval]
            least = some.min(axis=-1, keepdims=True)
            likely[..., interval] = some < least + MAX_EXCESS_MISFIT
    return likely & (inner <= misfit[..., :-2]) & (inner < misfit[..., 2:])


def _refine(
    templates: Templates,
    readings: Floats,
    covariance: Floats,
    minima: tuple[Indices, ...],
    scaled: bool,
) -> Modes:
    spot, node, minimum = minima
    guess = expected_backscatter(templates.extinction_per_m)[node]
    prior = 1 / (guess * LOG_SIGMA) ** 2
    beta, at = guess, SEARCH * (minimum + 1.0)
    max_index = templates.range_m.size - 2.0
    patches = templates.uneven.shape[2] - 1
    for step in range(STEPS + 1):
        below = np.clip(at.astype(int), 0, int(max_index))
        row = (spot * templates.extinction_per_m.size + node) * templates.range_m.size + below
        target, along = _between(templates.target, row, at - below)
        fog, _ = _between(templates.fog, row, at - below)
        if step < UNEVEN_STEPS:
            uneven = templates.uneven[spot, node, np.minimum(below // PATCH_STEP, patches)]
            lower = cholesky(covariance[spot] + (beta**2)[:, None, None] * uneven)
        vectors = np.stack([readings[spot].T, target, along, fog], axis=1)
        y, t, d, f = whitened(lower, vectors).swapaxes(0, 1)
        if step == 0:
            rho = np.maximum((t * (y - beta * f)).sum(axis=0) / (t * t).sum(axis=0), 1e-6)
        along = rho * d + np.pi * beta * t  # also more fog in front
        jacobian, residual = np.stack([along, t, f]), y - rho * t - beta * f
        information = (jacobian[:, None] * jacobian).sum(axis=2)
        gradient = (jacobian * residual).sum(axis=1)
        inner, cross = information[:2, :2], information[:2, 2]
        aa, bb = np.maximum(np.diagonal(inner).T, 1e-100) * (1 + RIDGE)
        ab, determinant = inner[0, 1], aa * bb - inner[0, 1] ** 2
        conditional = np.array([[bb, -ab], [-ab, aa]]) / determinant  # given the backscattering
        across = (conditional * cross).sum(axis=1)
        slope = gradient[2] - (across * gradient[:2]).sum(axis=0)
        curvature = information[2, 2] - (across * cross).sum(axis=0)
        if step == STEPS:
            break
        more = (slope + prior * (guess - beta)) / (curvature + prior)
        move = (conditional * gradient[:2]).sum(axis=1) - across * more
        at = np.clip(at + np.clip(move[0], -MAX_STEP_M, MAX_STEP_M) / STEP_M, 1, max_index)
        rho = np.maximum(rho + move[1], 1e-9)
        beta = np.maximum(beta + more, 0)
    strength = rho / np.sqrt(conditional[1, 1] + across[1] ** 2 / (curvature + prior))
    misfit = (residual**2).sum(axis=0)
    determinant = np.maximum(inner[0, 0] * inner[1, 1] - ab**2, 1e-300)
    log_weight = -(misfit + np.log(determinant)) / 2 - np.log(np.diagonal(lower)).sum(axis=1)
    range_m = templates.range_m[0] + STEP_M * at
    log_weight += range_log_prior(range_m)
    if scaled:
        log_weight += even_log_prior(rho)
    result = Modes(
        spot=spot,
        node=node,
        range_m=range_m,
        backscatter=beta,
        log_weight=log_weight,
        slope=slope,
        curvature=curvature,
        drift=-across[0],
        variance_m2=conditional[0, 0],
        strength=strength,
        signal=rho * np.linalg.norm(target, axis=0),
        misfit=misfit,
    )
    return result.only((strength > MIN_STRENGTH) & (at > 1) & (at < max_index))


def _between(table: Floats, row: Indices, fraction: Floats) -> tuple[Floats, Floats]:
    """Readings (n, C) of a table interpolated between ranges, and their slope per metre."""
    rows = np.moveaxis(table, 2, 3).reshape(-1, table.shape[2])
    here, there = (np.ascontiguousarray(rows.take(at, axis=0).T) for at in (row, row + 1))
    return here + fraction * (there - here), (there - here) / STEP_M

"""Modes of the likelihood of a spot: ranges at which target and fog explain its readings.

For each spot and extinction of the tables, reflectance and backscattering are linear; with them in
closed form the misfit is known at all ranges. Its minima are refined by Gauss-Newton over range,
reflectance and backscattering. Around each, the misfit is a parabola.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Floats, Mask
from .numerics import inverse, solved
from .templates import PATCH_STEP, SEARCH, STEP_M, Templates

Indices = NDArray[np.intp]

BACKSCATTER_PER_SR = 0.035
"""Median of albedo times phase function at 180 degrees over fogs (Mie, 1550 nm),"""
LOG_SIGMA = 0.6
"""and sigma of its logarithm."""
MIN_RANGE_M = 0.3
MAX_EXCESS_MISFIT = 40.0
"""Minima worse than the best of spot and extinction by more, in chi squared, are dropped."""
MIN_STRENGTH = 0.3
"""Modes of weaker targets, in standard deviations, count as none."""
STEPS = 3
UNEVEN_STEPS = 2
"""Steps that update the noise of uneven fog."""
MAX_STEP_M = 0.05
BRIGHT = 1.0
"""Reflectance beyond which the prior falls."""
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
    spot, node, position = _search(templates, readings, covariance, usable)
    result = _refine(templates, readings, covariance, spot, node, position, scaled)
    return result.joined_with(_without_target(templates, readings, covariance, usable))


def _without_target(
    templates: Templates, readings: Floats, covariance: Floats, usable: Mask
) -> Modes:
    """Modes of fog alone: likely where the target is too weak."""
    spot, node = (each.ravel() for each in np.indices(templates.fog.shape[:2]))
    retained = usable[spot]
    spot, node = spot[retained], node[retained]
    beta = expected_backscatter(templates.extinction_per_m)[node]
    noise = covariance[spot] + (beta**2)[:, None, None] * templates.uneven[spot, node, -1]
    white = np.linalg.inv(np.linalg.cholesky(noise))
    y, g = (
        np.einsum("cij,cj->ci", white, each)
        for each in (readings[spot], templates.fog[spot, node, :, -1])
    )
    residual = y - beta[:, None] * g
    max_index = templates.range_m[-1]
    misfit, zeros = (residual**2).sum(axis=1), np.zeros(len(spot))
    return Modes(
        spot=spot,
        node=node,
        range_m=np.full(len(spot), np.nan),
        backscatter=beta,
        log_weight=np.log(EMPTY * max_index) - (misfit + np.linalg.slogdet(noise)[1]) / 2,
        slope=(g * residual).sum(axis=1),
        curvature=(g * g).sum(axis=1),
        drift=zeros,
        variance_m2=zeros,
        strength=zeros,
        signal=zeros,
        misfit=misfit,
    )


def _search(
    templates: Templates, readings: Floats, covariance: Floats, usable: Mask
) -> tuple[Indices, Indices, Indices]:
    """Spot, extinction and range index of all minima."""
    guess = expected_backscatter(templates.extinction_per_m)
    typical = templates.uneven[:, :, templates.uneven.shape[2] // 2]
    noise = covariance[:, None] + guess[:, None, None] ** 2 * typical
    white = np.linalg.inv(np.linalg.cholesky(noise))  # (spots, K, n, n)
    a, g = (white @ table for table in templates.searched)
    y = white @ readings[:, None, :, None]
    prior = 1 / (guess * LOG_SIGMA) ** 2
    aa, ag = (a * a).sum(axis=2), (a * g).sum(axis=2)
    gg = (g * g).sum(axis=2) + prior[:, None]
    ya, yg = (y * a).sum(axis=2), (y * g).sum(axis=2) + (prior * guess)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        determinant = aa * gg - ag**2
        rho = (ya * gg - yg * ag) / determinant
        beta = np.maximum((yg * aa - ya * ag) / determinant, 0)
        rho = np.where(beta > 0, rho, ya / aa)
        misfit = (y**2).sum(axis=2) + (prior * guess**2)[:, None] - rho * ya - beta * yg
    range_m = templates.range_m[::SEARCH]
    misfit = np.where((rho > 0) & (range_m > MIN_RANGE_M), misfit, np.inf)
    inner = misfit[..., 1:-1]
    is_minimum = (inner <= misfit[..., :-2]) & (inner < misfit[..., 2:]) & np.isfinite(inner)
    is_minimum &= inner < inner.min(axis=-1, keepdims=True) + MAX_EXCESS_MISFIT
    spot, node, position = np.nonzero(is_minimum & usable[:, None, None])
    return spot, node, (position + 1) * SEARCH


def _refine(
    templates: Templates,
    readings: Floats,
    covariance: Floats,
    spot: Indices,
    node: Indices,
    position: Indices,
    scaled: bool,
) -> Modes:
    guess = expected_backscatter(templates.extinction_per_m)[node]
    prior = 1 / (guess * LOG_SIGMA) ** 2
    beta, at = guess, position.astype(np.float64)
    max_index = templates.range_m.size - 2.0
    patches = templates.uneven.shape[2] - 1
    noise = np.zeros((len(spot), *covariance.shape[1:]))
    for step in range(STEPS + 1):
        below = np.clip(at.astype(int), 0, int(max_index))
        fraction = (at - below)[:, None]
        target, slope = _between(templates.target, spot, node, below, fraction)
        fog, _ = _between(templates.fog, spot, node, below, fraction)
        if step < UNEVEN_STEPS:
            patch = np.minimum(below // PATCH_STEP, patches)
            uneven = templates.uneven[spot, node, patch]
            noise = covariance[spot] + (beta**2)[:, None, None] * uneven
            precision = np.linalg.inv(noise)
        if step == 0:
            left = readings[spot] - beta[:, None] * fog
            rho = np.maximum(
                _product(target, precision, left) / _product(target, precision, target), 1e-6
            )
        along = rho[:, None] * slope + np.pi * beta[:, None] * target  # also more fog in front
        jacobian = np.stack([along, target, fog], axis=-1)
        residual = readings[spot] - rho[:, None] * target - beta[:, None] * fog
        weighted = (precision @ jacobian).swapaxes(1, 2)
        information = weighted @ jacobian
        gradient = (weighted @ residual[..., None])[..., 0]
        if step == STEPS:
            break
        regular = information.copy()
        regular[:, 2, 2] += prior
        pull = gradient.copy()
        pull[:, 2] += prior * (guess - beta)
        move = solved(regular, pull)
        at = np.clip(at + np.clip(move[:, 0], -MAX_STEP_M, MAX_STEP_M) / STEP_M, 1, max_index)
        rho = np.maximum(rho + move[:, 1], 1e-9)
        beta = np.maximum(beta + move[:, 2], 0)
    regular = information.copy()
    regular[:, 2, 2] += prior
    strength = rho / np.sqrt(inverse(regular)[:, 1, 1])
    inner, cross = information[:, :2, :2], information[:, :2, 2]
    across = solved(inner, cross)
    misfit = _product(residual, precision, residual)
    log_weight = -(misfit + np.linalg.slogdet(noise)[1] + np.linalg.slogdet(inner)[1]) / 2
    if scaled:
        log_weight -= 2 * np.log1p((rho / BRIGHT) ** 2)
    result = Modes(
        spot=spot,
        node=node,
        range_m=templates.range_m[0] + STEP_M * at,
        backscatter=beta,
        log_weight=log_weight,
        slope=gradient[:, 2] - (across * gradient[:, :2]).sum(axis=1),
        curvature=information[:, 2, 2] - (across * cross).sum(axis=1),
        drift=-across[:, 0],
        variance_m2=inverse(inner)[:, 0, 0],
        strength=strength,
        signal=rho * np.linalg.norm(target, axis=1),
        misfit=misfit,
    )
    return result.only((strength > MIN_STRENGTH) & (at > 1) & (at < max_index))


def _product(left: Floats, matrix: Floats, right: Floats) -> Floats:
    """Products (C,) of vectors (C, n) and matrices (C, n, n)."""
    return np.asarray((left * (matrix @ right[..., None])[..., 0]).sum(axis=1))


def _between(
    table: Floats, spot: Indices, node: Indices, below: Indices, fraction: Floats
) -> tuple[Floats, Floats]:
    """Rows (C, n) of a table interpolated between ranges, and their slope per metre."""
    here, there = table[spot, node, :, below], table[spot, node, :, below + 1]
    return here + fraction * (there - here), (there - here) / STEP_M

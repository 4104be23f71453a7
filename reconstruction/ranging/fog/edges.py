"""Spots on two surfaces at once: on an edge, a twig, a pane.

Where target and fog do not explain the readings of a spot, two targets are tried in every pair of
places, and the best pairs refined by Gauss-Newton. Surfaces nearer to each other than about a
quarter of the shortest wavelength of the readings look like one between them, whatever is tried.
"""

from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from ...arrays import Floats
from ..ranges import Alternative
from .algebra import inverse, solved
from .modes import MAX_STEP_M, NEAREST_M, SEARCH, Places
from .posterior import SpotPosterior, joined
from .templates import STEP_M, Templates

UNLIKELY = 1e-3
"""Misfits that chance makes less often than this need another explanation."""
GAIN = 12.0
"""Two targets have to explain so much more, in chi squared, than one."""
PAIRS = 24
STEPS = 8


def explained(
    known: SpotPosterior, templates: Templates, readings: Floats, covariance: Floats, spot: int
) -> SpotPosterior:
    """What is known of a spot with readings (n,) of covariance (n, n), two targets considered.

    Where not even two explain the readings, deviations grow with what is left unexplained.
    """
    freedom = max(readings.size - 2, 1)
    if not known.alternatives or known.misfit < chi2.isf(UNLIKELY, freedom):
        return known
    pair = _two_targets(known, templates, readings, covariance, spot)
    if pair:
        return replace(known, alternatives=pair, on_edge=True)
    growth = np.sqrt(known.misfit / freedom)
    wider = tuple(each._replace(sigma_m=growth * each.sigma_m) for each in known.alternatives)
    return replace(known, alternatives=wider, noise_m=growth * known.noise_m)


def _two_targets(
    known: SpotPosterior, templates: Templates, readings: Floats, covariance: Floats, spot: int
) -> tuple[Alternative, ...]:
    """Ranges of two targets, none unless they are much better than one."""
    node, backscatter = known.node, known.backscatter
    target, fog = templates.target[spot, node], templates.fog[spot, node]
    patch = templates.uneven.shape[2] // 2
    noise = covariance + backscatter**2 * templates.uneven[spot, node, patch]
    white = np.linalg.inv(np.linalg.cholesky(noise))
    first = np.searchsorted(templates.range_m, NEAREST_M)
    places = np.arange(first, templates.range_m.size - 1, SEARCH)
    a = white @ target[:, places]
    y = white @ (readings - backscatter * fog[:, -1])
    near, far = _best_pairs(a, y)
    at = np.stack([places[near], places[far]], axis=1).astype(np.float64)
    pair = _Pairs(white @ target, y)
    at, rho, misfit, information = pair.refined(at)
    kept = (rho > 0).all(axis=1) & (misfit < known.misfit - GAIN)
    if not kept.any():
        return ()
    at, rho, misfit, information = at[kept], rho[kept], misfit[kept], information[kept]
    log_weight = -(misfit + np.linalg.slogdet(information)[1]) / 2
    weight = np.exp(log_weight - log_weight.max())
    share = weight[:, None] * rho / rho.sum(axis=1, keepdims=True)
    variance = np.diagonal(inverse(information), axis1=1, axis2=2)[:, :2]
    range_m = templates.range_m[0] + STEP_M * at
    return joined(range_m.ravel(), variance.ravel(), share.ravel())


def _best_pairs(a: Floats, y: Floats) -> tuple[Places, Places]:
    """Columns of the pairs of targets (n, R) that leave least of readings (n,)."""
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


class _Pairs:
    """Whitened targets (n, R) and readings (n,), in which pairs of places are refined."""

    def __init__(self, target: Floats, readings: Floats) -> None:
        self._target = target
        self._readings = readings

    def refined(self, at: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Places (P, 2), reflectances (P, 2), misfits (P,), information (P, 4, 4) about both."""
        longest = self._target.shape[1] - 2.0
        rho = np.zeros_like(at)
        for step in range(STEPS + 1):
            low = np.clip(at.astype(int), 0, int(longest))
            share = (at - low)[..., None]
            here, there = self._target.T[low], self._target.T[low + 1]
            value = here + share * (there - here)  # (P, 2, n)
            if step == 0:
                rho = solved(value @ value.swapaxes(1, 2), value @ self._readings)
            slope = rho[..., None] * (there - here) / STEP_M
            jacobian = np.concatenate([slope, value], axis=1)  # (P, 4, n)
            residual = self._readings - (rho[..., None] * value).sum(axis=1)
            information = jacobian @ jacobian.swapaxes(1, 2)
            if step == STEPS:
                break
            move = solved(information, (jacobian @ residual[..., None])[..., 0])
            at = np.clip(at + np.clip(move[:, :2], -MAX_STEP_M, MAX_STEP_M) / STEP_M, 1, longest)
            rho = rho + move[:, 2:]
        return at, rho, (residual**2).sum(axis=1), information

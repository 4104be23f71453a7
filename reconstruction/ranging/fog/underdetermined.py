"""Ranges of spots with just two readings each: one frequency, or two windows.

Range and reflectance use up both, so nothing is left to estimate the fog. In a fog of extinction
sigma and backscattering beta one range (and its wraps) explains a spot's readings exactly. The
evidence on the fog comes from

* the prior of the weather (`fog_state`): clear air, fog of any extinction, or the stated weather,
* the prior of reflectances: fog taken for clear air makes its echo a near target that is far too
dark, clear air taken for fog makes targets too bright,
* the image: patterns light the same surfaces and fog from another angle, so a spot's pixel must
match its reflectance, its range and the fog's veil, and
* all spots at once, as far as they share the fog (`uneven`).

The result is the posterior over fogs on a grid: for each fog the roots of the range, weighted by
their prior over the Jacobian of the readings. Their mean and spread give the range and a sigma that
includes the uncertainty of the fog. Texture within a pixel and uneven fog are noise of `TEXTURE`,
`VEIL` and `templates.UNEVENNESS`.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...base.arrays import Floats, Mask
from ...capture import Optics, Spots
from ...capture.readings.cw import CwSpots
from ...capture.readings.pulsed import PulsedSpots
from ..brightness import Brightness
from ..ranges import MIN_SIGNAL, Alternative, Ranges, Status
from ..weather import weather_of
from .answer import MIN_PROBABILITY, ranges_of, unless_uneven
from .fog_state import FogSolver, FogState
from .numerics import chi_squared_limit, normal_cdf
from .posterior import Posterior, SpotPosterior
from .roots import Roots, RootTables, Symmetric
from .target_prior import flat_log_prior, surface_log_prior
from .uneven import probability_of_uneven

EXTINCTIONS_PER_M = np.array(
    [1e-4, 0.003, 0.006, 0.01, 0.016, 0.025, 0.04, 0.06, 0.09, 0.13, 0.19, 0.28]
)
"""From negligible extinction to 13 m of visibility, in small steps of range."""
PER_TARGET = 2
"""Readings that range and reflectance use up."""
CLEAR = 0.2
"""Prior probability of clear air if nothing is stated; all extinctions are equally likely."""
EMPTY = 0.2
"""Prior probability that a spot has no target within range."""
NODES, WEIGHTS = np.polynomial.hermite_e.hermegauss(7)
"""Quadrature of log-normal backscattering at each extinction."""
ASIDE_NODES, ASIDE_WEIGHTS = np.polynomial.hermite_e.hermegauss(5)
ASIDE, LOG_ASIDE_SIGMA = 0.35, 0.6
"""Scattering 10 to 16 degrees off the way back, where the patterns' detector sees most of its fog,
over that straight back: by Mie theory 0.2 (advection fog, beside its glory) to 1 (haze, smoke)."""
GAIN_NODES, GAIN_WEIGHTS = np.polynomial.hermite_e.hermegauss(3)
LOG_GAIN_SIGMA = 0.2
"""Log sigma of the image's calibration, common to all spots."""
ASIDES, GAINS = ASIDE * np.exp(LOG_ASIDE_SIGMA * ASIDE_NODES), np.exp(LOG_GAIN_SIGMA * GAIN_NODES)
"""Factors on fog in the image, and on all light: A combinations, asides the faster,"""
LIGHT_PRIOR = np.outer(GAIN_WEIGHTS, ASIDE_WEIGHTS).ravel()
"""and their prior probabilities (A,)."""
LIGHT_PRIOR /= LIGHT_PRIOR.sum()
"""and how probable each is (A,)."""
TEXTURE = 0.35
"""Relative rms difference in brightness between a pixel and a spot in it,"""
VEIL = 0.15
"""and the same for the fog's veil."""
SUPPORT = 2.0
"""If neither image nor user states the fog, the prior of the weather outweighs the readings. Sigma
then covers every fog within two units of log likelihood of the best (support; A. Edwards,
Likelihood, 1972),"""
MAX_SIGMA_M = 0.18
"""up to this sigma: nine in ten ranges should be within 0.3 m."""
FREEDOM = 4.0
"""Degrees of freedom of Student's t between a pixel and its spot: edges are frequent."""
APART_M = 0.5
"""Roots farther apart are different alternatives."""
NEGLIGIBLE = 1e-6
"""Fraction of a spot's probability below which a root is dropped."""
UNAFFECTED = 1.15
"""Maximum sigma, over that in known fog, of ranges that do not depend on the prior."""
MAX_RELATIVE_SIGMA = 0.3
"""Maximum sigma over range."""


def underdetermined_solver(
    spots: CwSpots | PulsedSpots,
    optics: Optics | None,
    combine: Floats,
    response: Callable[[Floats], Floats],
    max_range_m: float,
) -> FogSolver:
    """Solver for a recording's readings, which ``combine`` (2, readings) reduces to two."""
    scaled = bool(np.isfinite(spots.electrons_per_joule))
    tables = RootTables(spots, optics if scaled else None, response, max_range_m, EXTINCTIONS_PER_M)
    log_density = surface_log_prior if scaled else flat_log_prior
    stated = weather_of(spots)
    visibility_stated = not np.isnan(stated.visibility_m)
    noise = chi_squared_limit(PER_TARGET, normal_cdf(-MIN_SIGNAL))

    def solve(
        spots: Spots, prior: FogState, brightness: Brightness | None
    ) -> tuple[Ranges, FogState]:
        assert isinstance(spots, CwSpots | PulsedSpots)
        readings = spots.electrons(spots.taps[0])
        covariance = Symmetric.of((combine * spots.variance(readings)[:, None]) @ combine.T)
        pairs = readings @ combine.T
        saturated = spots.saturated[0].any(axis=1)
        dark = covariance.squares(*pairs.T) < noise
        backscatter = np.exp(prior.log_median[:, None] + prior.log_sigma[:, None] * NODES)
        roots = tables.roots(pairs, covariance, backscatter, log_density)
        image_known = brightness is not None and np.isfinite(brightness.electrons).any()
        seen = brightness if image_known and tables.empty_pixel is not None else None
        guessed = seen is None and not visibility_stated
        weight, by_root, support, uneven = _weights(
            tables, roots, pairs, covariance, ~saturated & ~dark, backscatter, prior, seen
        )
        supported = np.zeros(support.shape, dtype=bool)
        if guessed:
            plausibility = support - NODES**2 / 2 + prior.log_ratio(CLEAR)[:, None]
            supported = plausibility >= plausibility.max(axis=(1, 2), keepdims=True) - SUPPORT
        supporting = supported[roots.spot, roots.node, roots.draw]
        estimate = Posterior(
            tuple(
                replace(each, uneven=uneven)
                for each in _spot_posteriors(roots, by_root, supporting, len(pairs))
            ),
            prior.update(weight, backscatter),
        )
        max_sigma_m = MAX_SIGMA_M if guessed else np.inf
        statuses = tuple(
            "saturated"
            if saturated[k]
            else "weak"
            if dark[k]
            else unless_uneven(_status(each, max_range_m, max_sigma_m), each)
            for k, each in enumerate(estimate.spots)
        )
        fog = estimate.fog.optics(EXTINCTIONS_PER_M)
        return ranges_of(estimate.spots, statuses, readings.mean(axis=1), fog), estimate.fog

    return FogSolver(FogState.prior(EXTINCTIONS_PER_M, stated, CLEAR), solve)


def _weights(
    tables: RootTables,
    roots: Roots,
    pairs: Floats,
    covariance: Symmetric,
    usable: Mask,
    backscatter: Floats,
    prior: FogState,
    brightness: Brightness | None,
) -> tuple[Floats, Floats, Floats, float]:
    """Posterior (K, B) of shared fogs, of each root (C,) within its spot, and support of fogs.

    The support is a log likelihood (spots, K, B), to which other spots contribute as far as they
    are evidence of their own. Without a target a spot has the echo of fog alone, and its pixel the
    veil. Spots may have fogs of their own, with the probability that is returned, too.
    """
    log_empty = np.log(EMPTY) + _log_density_of_fog(tables, pairs, covariance, backscatter)
    log_target = np.log(1 - EMPTY) + roots.log_prior
    fogs = log_empty.shape[1:]  # (K, B)
    group = (roots.spot * fogs[0] + roots.node) * fogs[1] + roots.draw
    starts = np.flatnonzero(np.append(-1, group[:-1]) != group)
    having = group[starts]
    peak = log_empty.flatten()
    if starts.size:
        peak[having] = np.maximum(peak[having], np.maximum.reduceat(log_target, starts))
    empty, target = np.exp(log_empty.ravel() - peak)[None], np.exp(log_target - peak[group])[None]
    light_prior = np.ones(1)
    if brightness is not None:
        assert tables.empty_pixel is not None
        light_prior = LIGHT_PRIOR
        veil = (tables.empty_pixel[..., None] * backscatter).ravel()
        own = np.repeat(np.arange(len(log_empty)), fogs[0] * fogs[1])
        empty = empty * _likelihood_of_pixel(
            np.zeros(veil.size), veil, *(each[own] for each in brightness)
        )
        target = target * _likelihood_of_pixel(
            roots.pixel_surface, roots.pixel_veil, *(each[roots.spot] for each in brightness)
        )
    total = empty.copy()
    if starts.size:
        total[:, having] += np.add.reduceat(target, starts, axis=1)
    by_spot = np.log(total).reshape(light_prior.size, len(log_empty), -1)
    by_spot += peak.reshape(len(log_empty), -1)
    # Evidence is that of priors, which err for all spots of a scene alike (their ln R correlate by
    # 0.4 to 0.5), so that n are worth the square root of n.
    counted = 1 / np.sqrt(max(int(usable.sum()), 1))
    evidence = counted * by_spot[:, usable].sum(axis=1)
    others = evidence[:, None] - counted * by_spot * usable[:, None]
    support = (by_spot + others).max(axis=0).reshape(-1, *fogs)
    fog_prior = np.maximum(prior.probability, 1e-300)[:, None] * WEIGHTS / WEIGHTS.sum()
    log_prior = np.log(light_prior)[:, None] + np.log(fog_prior).ravel()
    weight, log_shared = _normalised(evidence[:, None] + log_prior[:, None])
    alone, log_alone = _normalised(by_spot + log_prior[:, None])
    uneven = probability_of_uneven(float(counted * log_alone[usable].sum() - log_shared[0]))
    mixed = (1 - uneven) * weight + uneven * alone  # (A, spots, fogs)
    of_each = mixed.reshape(light_prior.size, -1) / total
    by_root = np.einsum("ac,ac->c", target, of_each[:, group])
    return weight.sum(axis=(0, 1)).reshape(fogs), by_root, support, uneven


def _normalised(log: Floats) -> tuple[Floats, Floats]:
    """Probabilities (A, spots, fogs) that sum to one per spot, and the logarithms (spots,) of the
    sums."""
    peak = log.max(axis=(0, 2), keepdims=True)
    result = np.exp(log - peak)
    whole = result.sum(axis=(0, 2), keepdims=True)
    return result / whole, (peak + np.log(whole))[0, :, 0]


def _log_density_of_fog(
    tables: RootTables, pairs: Floats, covariance: Symmetric, backscatter: Floats
) -> Floats:
    """Log density (spots, K, B) of each spot's readings in each fog, without a target."""
    beta = backscatter[None]
    x, y = pairs.T[..., None, None]
    own = Symmetric(*(each[:, None, None] for each in vars(covariance).values()))
    uneven = Symmetric(*(each[..., None] for each in vars(tables.empty_uneven).values()))
    noise = own.plus(uneven, beta**2)
    left = x - beta * tables.empty_x[..., None], y - beta * tables.empty_y[..., None]
    return np.asarray(-(noise.squares(*left) + np.log(noise.determinant)) / 2 - np.log(2 * np.pi))


def _likelihood_of_pixel(surface: Floats, veil: Floats, electrons: Floats, sigma: Floats) -> Floats:
    """Likelihood (A, n) of pixels (n,) with so much of surface and, times `ASIDES`, veil.

    Student's t, up to a factor; 1 if the pixel is unknown.
    """
    veil = ASIDES[:, None] * veil
    spread = (TEXTURE * surface) ** 2 + (VEIL * veil) ** 2
    square = sigma**2 + GAINS[:, None, None] ** 2 * spread  # (gains, asides, n)
    away = electrons - GAINS[:, None, None] * (surface + veil)
    wider = square + away**2 / FREEDOM
    with np.errstate(divide="ignore", invalid="ignore"):
        likelihood = (square / wider) ** (FREEDOM / 2) / np.sqrt(wider)
    likelihood = likelihood.reshape(GAINS.size * ASIDES.size, veil.shape[1])
    return np.where(np.isfinite(likelihood) & (likelihood > 0), likelihood, 1.0)


def _spot_posteriors(
    roots: Roots, by_root: Floats, supporting: Mask, spots: int
) -> tuple[SpotPosterior, ...]:
    """Posterior of each spot, with close roots merged into alternatives.

    Sigma covers the farthest of the ``supporting`` roots (C,).
    """
    of_spot = np.bincount(roots.spot, by_root, minlength=spots)
    here = np.flatnonzero(by_root > NEGLIGIBLE * of_spot[roots.spot])
    if not here.size:
        return (SpotPosterior(),) * spots
    here = here[np.lexsort((roots.range_m[here], roots.spot[here]))]
    spot, range_m, weight = roots.spot[here], roots.range_m[here], by_root[here]
    apart = (np.diff(range_m) > APART_M) | (np.diff(spot) > 0)
    starts = np.flatnonzero(np.append(True, apart))
    total = np.add.reduceat(weight, starts)

    def mean(values: Floats) -> Floats:
        return np.asarray(np.add.reduceat(weight * values, starts) / total)

    centre, noise_m2 = mean(range_m), mean(roots.noise_m2[here])
    away_m = range_m - np.repeat(centre, np.diff(np.append(starts, here.size)))
    farthest_m2 = np.maximum.reduceat(np.where(supporting[here], away_m**2, 0.0), starts)
    sigma_m = np.sqrt(noise_m2 + np.maximum(mean(away_m**2), farthest_m2))
    strength, signal = mean(roots.strength[here]), mean(roots.signal[here])
    noise_m = np.sqrt(mean(roots.reading_m2[here]))

    def of(number: int) -> SpotPosterior:
        branches = np.flatnonzero(spot[starts] == number)
        if not branches.size:
            return SpotPosterior()
        branches = branches[np.argsort(-total[branches])]
        best, target = branches[0], float(total[branches].sum())
        return SpotPosterior(
            alternatives=tuple(
                Alternative(float(centre[k]), float(sigma_m[k]), float(total[k]) / target)
                for k in branches
            ),
            target=target,
            strength=float(strength[best]),
            signal=float(signal[best]),
            noise_m=float(noise_m[best]),
        )

    return tuple(of(number) for number in range(spots))


def _status(spot: SpotPosterior, max_range_m: float, max_sigma_m: float) -> Status:
    """Status of a range."""
    if not spot.alternatives or spot.target < MIN_PROBABILITY or spot.strength < spot.needed:
        return "fog"
    likeliest = spot.alternatives[0]
    if (
        likeliest.weight < MIN_PROBABILITY
        or likeliest.range_m > max_range_m - MIN_SIGNAL * likeliest.sigma_m
    ):
        return "ambiguous"
    if likeliest.sigma_m > min(max_sigma_m, MAX_RELATIVE_SIGMA * likeliest.range_m):
        return "fog"
    return "ok" if likeliest.sigma_m <= UNAFFECTED * spot.noise_m else "weather prior"

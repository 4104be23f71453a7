"""Ranges of spots of which the readings are two numbers each: one frequency, or two windows.

Range and reflectance take both, so nothing is left to estimate the fog from. In a fog of extinction
sigma and backscattering beta one range (and its wraps) explains a spot's readings exactly. Evidence
of which fog it is comes from

* the prior over weather (`belief`): clear air, or fog of any extinction, or what the user states,
* reflectances that exist (`reflectance`): where fog is taken for clear air, its echo has to be a
  near target that is far too dark, and where clear air is taken for fog, targets are too bright,
* the image: the patterns light the same surfaces and the same fog from another angle, so a spot's
  pixel has to be as bright as its reflectance, its range and the fog's veil make it, and
* all four spots at once, for they share the fog.

The answer is the posterior over fogs on a grid: for each fog the roots of the range, with the prior
of each over the Jacobian of the readings as their weight; their mean and spread is the range, its
sigma includes what remains unknown of the fog. Surfaces whose texture differs within a pixel, and
fog that is uneven, are noise of `TEXTURE`, `VEIL` and `templates.UNEVENNESS`.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...arrays import Floats, Mask
from ...capture import Optics, Spots
from ...capture.readings.cw import CwSpots
from ...capture.readings.pulsed import PulsedSpots
from ..brightness import Brightness, bucket_optics
from ..ranges import MIN_SIGNAL, Alternative, Ranges, Status
from ..weather import weather_of
from .answer import CERTAIN, ranges_of
from .belief import FogBelief, FogSolver
from .chances import chi_squared_limit, normal_share
from .modes import Places
from .overlap import overlap, path_lengths
from .posterior import Posterior, SpotPosterior
from .reflectance import log_of_anything, log_of_surfaces
from .templates import PATCH_STEP, STEP_M, make_templates

EXTINCTIONS_PER_M = np.array(
    [1e-4, 0.003, 0.006, 0.01, 0.016, 0.025, 0.04, 0.06, 0.09, 0.13, 0.19, 0.28]
)
"""From what no range feels to 13 m of visibility, so close that ranges between differ little."""
PER_TARGET = 2
"""Numbers that range and reflectance take."""
CLEAR = 0.2
"""Prior probability of clear air where nothing is stated; all extinctions are likely alike."""
EMPTY = 0.2
"""Prior probability that a spot has no target within range."""
STRIDE = 8
"""Steps of the templates between ranges where roots are looked for."""
OUTSIDE = 2.0
"""Steps by which a root may lie beside the one that it was found in, as amplitudes bend."""
NODES, WEIGHTS = np.polynomial.hermite_e.hermegauss(7)
"""Of backscattering, log-normal at each extinction."""
ASIDE_NODES, ASIDE_WEIGHTS = np.polynomial.hermite_e.hermegauss(5)
ASIDE, LOG_ASIDE_SIGMA = 0.35, 0.6
"""Scattering 10 to 16 degrees off the way back, where the patterns' detector sees most of its fog,
over that straight back: by Mie theory 0.2 (advection fog, beside its glory) to 1 (haze, smoke)."""
GAIN_NODES, GAIN_WEIGHTS = np.polynomial.hermite_e.hermegauss(3)
LOG_GAIN_SIGMA = 0.2
"""Of the image's calibration, common to all spots."""
TEXTURE = 0.35
"""Brightness of a pixel over that of a spot in it, relative rms,"""
VEIL = 0.15
"""and the same of the fog's veil."""
BEYOND = 0.05
"""Prior probability of a target that is as far again as phases tell apart, and looks near: that of
spots up to there in drawn worlds."""
SUPPORT = 2.0
"""Where neither image nor user tells the fog, the prior over weather outweighs the readings. Sigma
reaches to every fog with so little less log likelihood than the best (two units of support;
A. Edwards, Likelihood, 1972),"""
SURE_M = 0.18
"""and a range that is less certain is none: nine in ten should be within 0.3 m."""
FREEDOM = 4.0
"""Of Student's t, with which a pixel may differ from its spot: edges are frequent."""
APART_M = 0.5
"""Roots that are farther apart than this are different alternatives."""
NEGLIGIBLE = 1e-6
"""Fraction of a spot's probability below which a root does not count."""
UNAFFECTED = 1.15
"""Ranges whose sigma is at most so many times that of known fog do not rest on the prior."""
LARGEST = 0.3
"""Sigma over range beyond which fog leaves a range too uncertain."""


@dataclass(frozen=True, eq=False)
class _Tables:
    """Readings, as complex numbers, by spot, extinction and range (R,).

    ``target`` (4, K, R) for unit reflectance, ``fog`` (4, K, R) for unit backscattering in front
    of that range, ``uneven`` (4, K, P, 2, 2) as in `Templates`; ``pixel_target`` and ``pixel_fog``
    (4, K, R) electrons of a pixel by the same, None without an image.
    """

    range_m: Floats
    target: Floats
    fog: Floats
    uneven: Floats
    pixel_target: Floats | None
    pixel_fog: Floats | None


@dataclass(frozen=True, eq=False)
class _Roots:
    """Ranges that explain a spot's readings in a fog, each (C,), exactly.

    ``spot``, ``node`` (of extinction) and ``draw`` (of backscattering) are indices; ``noise_m2`` is
    the variance of the range in this fog, uneven as it is, ``reading_m2`` that of noise alone,
    ``strength`` the target in standard deviations, ``log_prior`` the logarithm of range's and
    reflectance's prior over the Jacobian of the readings.
    """

    spot: Places
    node: Places
    draw: Places
    range_m: Floats
    noise_m2: Floats
    reading_m2: Floats
    strength: Floats
    signal: Floats
    log_prior: Floats
    pixel_surface: Floats
    pixel_veil: Floats


def underdetermined_solver(
    spots: CwSpots | PulsedSpots,
    optics: Optics | None,
    combine: Floats,
    response: Callable[[Floats], Floats],
    longest_m: float,
) -> FogSolver:
    """Solver of one recording's readings, which ``combine`` (2, readings) makes two numbers."""
    reach_m = longest_m * (2 if isinstance(spots, CwSpots) else 1)
    scaled = bool(np.isfinite(spots.electrons_per_joule))
    tables = _tables(spots, optics if scaled else None, response, reach_m)
    log_density = log_of_surfaces if scaled else log_of_anything
    stated = weather_of(spots)
    told = not np.isnan(stated.visibility_m)
    noise = chi_squared_limit(PER_TARGET, normal_share(-MIN_SIGNAL))

    def solve(
        spots: Spots, belief: FogBelief, brightness: Brightness | None
    ) -> tuple[Ranges, FogBelief]:
        assert isinstance(spots, CwSpots | PulsedSpots)
        readings = spots.electrons(spots.taps[0])
        covariance = (combine * spots.variance(readings)[:, None]) @ combine.T
        pairs = readings @ combine.T
        saturated = spots.saturated[0].any(axis=1)
        dark = _squares(pairs, covariance) < noise
        backscatter = np.exp(belief.log_median[:, None] + belief.log_deviation[:, None] * NODES)
        roots = _roots(tables, pairs @ [1, 1j], covariance, backscatter, longest_m, log_density)
        shown = brightness is not None and np.isfinite(brightness.electrons).any()
        seen = brightness if shown and tables.pixel_fog is not None else None
        guessed = seen is None and not told
        weight, by_root, support = _weights(
            tables, roots, pairs, covariance, ~saturated & ~dark, backscatter, belief, seen
        )
        supported = np.zeros(support.shape, dtype=bool)
        if guessed:
            held = support - NODES**2 / 2 + belief.log_ratio(CLEAR)[:, None]
            supported = held >= held.max() - SUPPORT
        reaching = supported[roots.node, roots.draw]
        estimate = Posterior(
            tuple(_spot_posterior(roots, by_root, reaching, spot) for spot in range(4)),
            belief.updated(weight, backscatter),
        )
        widest_m = SURE_M if guessed else np.inf
        statuses = tuple(
            "saturated"
            if saturated[k]
            else "weak"
            if dark[k]
            else _status(each, longest_m, widest_m)
            for k, each in enumerate(estimate.spots)
        )
        fog = estimate.fog.optics(EXTINCTIONS_PER_M)
        return ranges_of(estimate.spots, statuses, readings.mean(axis=1), fog), estimate.fog

    return FogSolver(FogBelief.prior(EXTINCTIONS_PER_M, stated, CLEAR), solve)


def _tables(
    spots: CwSpots | PulsedSpots,
    optics: Optics | None,
    response: Callable[[Floats], Floats],
    reach_m: float,
) -> _Tables:
    made = make_templates(spots, response, reach_m + STRIDE * STEP_M, EXTINCTIONS_PER_M)

    def pairs(table: Floats) -> Floats:
        return np.asarray(table[:, :, 0] + 1j * table[:, :, 1])

    pixel_target = pixel_fog = None
    if photodiodes := bucket_optics(optics, spots):
        assert optics is not None
        weight = np.sum([overlap(each, made.range_m)[0] for each in photodiodes], axis=0)
        path_m = np.mean([path_lengths(each, made.range_m) for each in photodiodes], axis=0)
        damped = np.exp(-EXTINCTIONS_PER_M[:, None] * path_m[:, None])
        seen = np.mean(optics.pixel_electrons) * weight[:, None] * damped
        in_front = (np.cumsum(seen, axis=-1) - seen / 2) * STEP_M
        pixel_target, pixel_fog = seen / np.pi, in_front
    return _Tables(
        range_m=made.range_m,
        target=pairs(made.target),
        fog=pairs(made.fog),
        uneven=made.uneven,
        pixel_target=pixel_target,
        pixel_fog=pixel_fog,
    )


def _roots(
    tables: _Tables,
    pairs: Floats,
    covariance: Floats,
    backscatter: Floats,
    longest_m: float,
    log_density: Callable[[Floats], Floats],
) -> _Roots:
    """All of them, for readings (4,) and backscattering (K, B), between neighbouring ranges."""
    coarse = slice(None, None, STRIDE)
    turned = np.conj(tables.target[..., coarse])
    whole = (pairs[:, None, None] * turned)[:, :, None]
    echo = (tables.fog[..., coarse] * turned)[:, :, None]
    beta = backscatter[:, :, None]
    across, along = whole.imag - beta * echo.imag, whole.real - beta * echo.real
    crossing = (across[..., 1:] * across[..., :-1] <= 0) & (along[..., 1:] > 0)
    spot, node, draw, cell = np.nonzero(crossing & (along[..., :-1] > 0))
    beta = backscatter[node, draw]
    before, behind = across[spot, node, draw, cell], across[spot, node, draw, cell + 1]
    at = cell * STRIDE + (STRIDE * _crossed(before, behind)).astype(int)
    at = np.minimum(at, tables.range_m.size - 2)
    before, behind = (
        (
            (pairs[spot] - beta * tables.fog[spot, node, end])
            * np.conj(tables.target[spot, node, end])
        ).imag
        for end in (at, at + 1)
    )
    fraction = np.clip(_crossed(before, behind), -OUTSIDE, 1 + OUTSIDE)

    def here(table: Floats) -> Floats:
        ends = table[spot, node, at], table[spot, node, at + 1]
        return np.asarray((1 - fraction) * ends[0] + fraction * ends[1])

    target = here(tables.target)
    slope = (tables.target[spot, node, at + 1] - tables.target[spot, node, at]) / STEP_M
    size = np.abs(target)
    reflectance = ((pairs[spot] - beta * here(tables.fog)) * np.conj(target)).real / size**2
    reflectance = np.maximum(reflectance, 1e-12)
    farther = reflectance * slope + np.pi * beta * target  # more fog in front, too
    jacobian = np.abs((np.conj(farther) * target).imag)
    patch = np.minimum(at // PATCH_STEP, tables.uneven.shape[2] - 1)
    noise = covariance[spot] + (beta**2)[:, None, None] * tables.uneven[spot, node, patch]
    unit = target / size
    perpendicular = np.stack([-unit.imag, unit.real], axis=-1)
    radial = np.stack([unit.real, unit.imag], axis=-1)

    def variance(direction: Floats, covariance: Floats) -> Floats:
        return np.asarray((direction * (covariance @ direction[..., None])[..., 0]).sum(axis=-1))

    with np.errstate(divide="ignore", over="ignore"):
        noise_m2, reading_m2 = (
            variance(perpendicular, each) * (size / jacobian) ** 2
            for each in (noise, covariance[spot])
        )
        log_prior = log_density(reflectance) - np.log(jacobian * longest_m)
    range_m = tables.range_m[at] + fraction * STEP_M
    log_prior += np.log(np.where(range_m > longest_m, BEYOND, 1 - BEYOND))
    pixel_target = np.zeros(len(spot)) if tables.pixel_target is None else here(tables.pixel_target)
    pixel_fog = np.zeros(len(spot)) if tables.pixel_fog is None else here(tables.pixel_fog)
    return _Roots(
        spot=spot,
        node=node,
        draw=draw,
        range_m=range_m,
        noise_m2=noise_m2,
        reading_m2=reading_m2,
        strength=reflectance * size / np.sqrt(variance(radial, noise)),
        signal=reflectance * size,
        log_prior=np.where(jacobian > 0, log_prior, -np.inf),
        pixel_surface=reflectance * pixel_target,
        pixel_veil=beta * pixel_fog,
    )


def _crossed(before: Floats, behind: Floats) -> Floats:
    """Where a line through two values is 0, as a fraction of the way between them."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.nan_to_num(before / (before - behind), posinf=0.0, neginf=0.0)


def _weights(
    tables: _Tables,
    roots: _Roots,
    pairs: Floats,
    covariance: Floats,
    usable: Mask,
    backscatter: Floats,
    belief: FogBelief,
    brightness: Brightness | None,
) -> tuple[Floats, Floats, Floats]:
    """Posterior (K, B) of fogs, of each root (C,) within its spot, and log likelihood (K, B).

    A spot without a target has the echo of fog alone, and a pixel with its veil.
    """
    aside = np.repeat(ASIDE * np.exp(LOG_ASIDE_SIGMA * ASIDE_NODES), GAIN_NODES.size)
    gain = np.tile(np.exp(LOG_GAIN_SIGMA * GAIN_NODES), ASIDE_NODES.size)
    beta = backscatter[..., None]
    alone = pairs[:, None, None] - beta * _as_pairs(tables.fog[..., -1])[:, :, None]
    noise = covariance[:, None, None] + beta[..., None] ** 2 * tables.uneven[:, :, None, -1]
    empty = np.log(EMPTY) - _squares(alone, noise) / 2
    empty = (empty - np.log(2 * np.pi) - np.linalg.slogdet(noise)[1] / 2)[..., None]
    target = (np.log(1 - EMPTY) + roots.log_prior)[:, None]
    if brightness is None:
        aside = np.ones(1)
    else:
        assert tables.pixel_fog is not None
        veil = backscatter * tables.pixel_fog[:, :, None, -1]
        at = (roots.spot,)
        target = target + _log_likelihood_of_pixel(
            aside, gain, roots.pixel_surface, roots.pixel_veil, *(each[at] for each in brightness)
        )
        own = (each[:, None, None] for each in brightness)
        empty = empty + _log_likelihood_of_pixel(aside, gain, np.zeros_like(veil), veil, *own)
    empty = np.broadcast_to(empty, (*empty.shape[:-1], aside.size))
    target = np.broadcast_to(target, (len(roots.spot), aside.size))
    peak = empty.copy()
    index = (roots.spot, roots.node, roots.draw)
    np.maximum.at(peak, index, target)
    relative = np.exp(target - peak[index])
    total = np.exp(empty - peak)
    np.add.at(total, index, relative)
    evidence = (peak + np.log(total))[usable].sum(axis=0)
    support = evidence.max(axis=-1)
    evidence = evidence + np.log(np.maximum(belief.share, 1e-300))[:, None, None]
    evidence = evidence + np.log(WEIGHTS / WEIGHTS.sum())[:, None]
    if aside.size > 1:
        prior = np.outer(ASIDE_WEIGHTS, GAIN_WEIGHTS).ravel()
        evidence = evidence + np.log(prior / prior.sum())
    weight = np.exp(evidence - evidence.max())
    weight /= weight.sum()
    by_root = (relative / total[index] * weight[roots.node, roots.draw]).sum(axis=-1)
    return weight.sum(axis=-1), by_root, support


def _log_likelihood_of_pixel(
    aside: Floats, gain: Floats, surface: Floats, veil: Floats, electrons: Floats, sigma: Floats
) -> Floats:
    """Log likelihood (..., A) of a pixel with so much of surface and, times ``aside``, veil.

    ``aside`` and ``gain`` (A,), by which all light of the image is brighter.
    """
    surface, veil = gain * surface[..., None], gain * aside * veil[..., None]
    light, spread = surface + veil, np.hypot(TEXTURE * surface, VEIL * veil)
    scale = np.hypot(sigma[..., None], spread)
    away = (electrons[..., None] - light) / scale
    likelihood = -(FREEDOM + 1) / 2 * np.log1p(away**2 / FREEDOM) - np.log(scale)
    return np.where(np.isfinite(likelihood), likelihood, 0.0)


def _spot_posterior(roots: _Roots, by_root: Floats, reaching: Mask, spot: int) -> SpotPosterior:
    """Roots of one spot by alternatives; sigma reaches to the farthest of some (C,)."""
    here = np.flatnonzero(roots.spot == spot)
    weight = by_root[here]
    here = here[weight > NEGLIGIBLE * weight.sum()]
    if not here.size:
        return SpotPosterior()
    here = here[np.argsort(roots.range_m[here])]
    range_m, weight = roots.range_m[here], by_root[here]
    branch = np.cumsum(np.diff(range_m, prepend=range_m[0]) > APART_M)
    total = np.bincount(branch, weight)

    def mean(values: Floats) -> Floats:
        return np.asarray(np.bincount(branch, weight * values) / total)

    centre, noise_m2 = mean(range_m), mean(roots.noise_m2[here])
    away_m2 = (range_m - centre[branch]) ** 2
    farthest_m2 = np.zeros(total.size)
    np.maximum.at(farthest_m2, branch, np.where(reaching[here], away_m2, 0.0))
    sigma_m = np.sqrt(noise_m2 + np.maximum(mean(away_m2), farthest_m2))
    best = int(total.argmax())
    return SpotPosterior(
        alternatives=tuple(
            Alternative(float(centre[k]), float(sigma_m[k]), float(total[k] / total.sum()))
            for k in np.argsort(-total)
        ),
        target=float(total.sum()),
        strength=float(mean(roots.strength[here])[best]),
        signal=float(mean(roots.signal[here])[best]),
        noise_m=float(np.sqrt(mean(roots.reading_m2[here])[best])),
    )


def _status(spot: SpotPosterior, longest_m: float, widest_m: float) -> Status:
    """What a range rests on, or why there is none."""
    if not spot.alternatives or spot.target < CERTAIN or spot.strength < spot.needed:
        return "fog"
    likeliest = spot.alternatives[0]
    if likeliest.weight < CERTAIN or likeliest.range_m > longest_m - MIN_SIGNAL * likeliest.sigma_m:
        return "ambiguous"
    if likeliest.sigma_m > min(widest_m, LARGEST * likeliest.range_m):
        return "fog"
    return "ok" if likeliest.sigma_m <= UNAFFECTED * spot.noise_m else "weather prior"


def _as_pairs(values: Floats) -> Floats:
    return np.stack([values.real, values.imag], axis=-1)


def _squares(pairs: Floats, covariance: Floats) -> Floats:
    """Chi squared (...) of pairs (..., 2) that are but noise."""
    solved = np.linalg.solve(covariance, pairs[..., None])[..., 0]
    return np.asarray((pairs * solved).sum(axis=-1))

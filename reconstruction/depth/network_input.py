"""Input of the depth network: image, ranges and fog of a frame, as maps and numbers.

Physics enters as features, not as rules. The light that returns from a surface of reflectance rho
at depth z is proportional to rho / z^2, so that log z = (log rho - log I) / 2 + constant, where the
constant is interpolated between the spots; their laser light determines rho. The veil of the fog is
subtracted from the image as far as the fog is known.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats, Mask
from ..base.layers import Channels
from ..capture import Optics
from ..capture.spots import USUAL_SPOTS
from .kriging import BRIGHT, AnchoredImage, AnchoredPrior, LogDepth
from .pixels import pixel_of, pixel_rays, squared_distances, wide_hats

DARKEST = 0.01
"""Minimum brightness, relative to the 90th percentile."""
USUAL_M = 5.0
"""Mean depth if no spot has a range."""
NARROW = 0.1
"""Standard deviation of a spot's neighbourhood, relative to the image's longer side."""
SOFTENING = 0.02
"""Offset of squared distances in inverse squares, relative to that side squared."""
SURE = 0.1
"""Relative sigma at which a range counts half."""
VEIL_FROM_M = 0.4
"""Range from which the detector sees fog lit by the projector."""
BRIGHTEST = 10.0
"""Maximum veil, relative to bright pixels."""
DARKEST_OF_ALL, DARK = 1, 5
"""Percentiles of dark pixels."""
MAX_VEIL = 0.95
"""Maximum veil, relative to the darkest hundredth of the pixels."""
TYPICAL_LOG_REFLECTANCE = -1.2
START = AnchoredPrior(
    log_depth_sigma=0.4,
    log_reflectance_sigma=0.7,
    correlation_length=0.5,
    similarity=0.7,
    nugget=0.05,
    min_brightness=0.2,
    uncertain=0.05,
    max_nearer=1.3,
    sigma_factor=1.0,
)
"""Constants of the map that the network corrects: part of the training, whatever is fitted later.
"""
SIGMA = 0.01, 1.0
"""Limits of the sigma of that map."""
CLEAR_PER_M = 1e-3
"""Minimum extinction; anything less is clear air."""


class Anchors(NamedTuple):
    """Log depths of the spots: ``log_depth`` and ``log_sigma``, (spots,) each, nan if unknown."""

    log_depth: Floats
    log_sigma: Floats

    @property
    def weight(self) -> Floats:
        """Weight of each spot, 0 if its depth is unknown."""
        finite = np.isfinite(self.log_depth) & np.isfinite(self.log_sigma)
        return np.where(finite, 1 / (1 + (np.where(finite, self.log_sigma, 1) / SURE) ** 2), 0.0)


@dataclass(frozen=True, eq=False)
class NetworkInput:
    """One frame as the network sees it.

    ``image`` (H, W) in any unit; ``directions`` (S, 3) of the spots. ``plain`` are their ranges by
    the chosen method, ``fitted`` those fitted together with the fog, ``lost`` (S,) marks spots
    without a return. ``log_reflectance`` (S,) by the laser light, nan if unknown. ``noise`` is the
    rms noise of a reading over the spread of the readings, ``fraction`` the number of patterns over
    pixels, ``max_range_m`` the unambiguous range. ``extinction_per_m`` and ``backscatter_per_m_sr``
    are those of fog, nan if unknown.
    """

    image: Floats
    optics: Optics
    directions: Floats
    plain: Anchors
    fitted: Anchors
    lost: Mask
    log_reflectance: Floats
    noise: float
    fraction: float
    max_range_m: float
    extinction_per_m: float = np.nan
    backscatter_per_m_sr: float = np.nan

    @cached_property
    def best(self) -> Anchors:
        """Fitted depth of each spot if available, else its plain one."""
        fitted = np.isfinite(self.fitted.log_depth)
        pairs = zip(self.fitted, self.plain, strict=True)
        return Anchors(*(np.where(fitted, *pair) for pair in pairs))

    @property
    def ranged(self) -> bool:
        """Whether any spot has a range; those of lost spots are only probable."""
        return bool(np.any((self.best.weight > 0) & ~self.lost))

    @cached_property
    def percentiles(self) -> tuple[float, float, float]:
        """Brightness of the darkest, of dark and of bright pixels."""
        ranks = np.array([DARKEST_OF_ALL, DARK, BRIGHT]) / 100 * (self.image.size - 1)
        below, above = np.floor(ranks).astype(int), np.ceil(ranks).astype(int)
        ordered = np.partition(self.image, np.append(below, above), axis=None)
        values = ordered[below] + (ranks - below) * (ordered[above] - ordered[below])
        return float(values[0]), float(values[1]), float(values[2])

    @property
    def bright(self) -> float:
        """Brightness of bright pixels."""
        return self.percentiles[-1]

    @cached_property
    def mean_log_depth(self) -> float:
        """Mean of the spots' log depths."""
        best, weight = self.best, self.best.weight
        if not weight.any():
            return float(np.log(USUAL_M))
        return float(weight @ np.nan_to_num(best.log_depth) / weight.sum())


def of_spots(frame: NetworkInput, index: NDArray[np.intp]) -> NetworkInput:
    """The frame with some of its spots."""
    plain, fitted = (
        Anchors(each.log_depth[index], each.log_sigma[index])
        for each in (frame.plain, frame.fitted)
    )
    return replace(
        frame,
        directions=frame.directions[index],
        plain=plain,
        fitted=fitted,
        lost=frame.lost[index],
        log_reflectance=frame.log_reflectance[index],
    )


def four_spots(pixel: Floats, weight: Floats, shape: tuple[int, int]) -> NDArray[np.intp]:
    """Indices of the spots, at pixels (S, 2), next to the middles of the image's quarters.

    All of up to four; of more, those of the greatest ``weight`` (S,), from 0 to 1, first.
    """
    chosen: list[int] = []
    if len(pixel) <= USUAL_SPOTS:
        return np.arange(len(pixel))
    for quarter in product((0.25, 0.75), repeat=2):
        away = np.hypot(*((pixel + 0.5) / np.array(shape) - quarter).T) + 1 - weight
        away[chosen] = np.inf
        chosen.append(int(np.argmin(away)))
    return np.array(chosen)


def raised(frame: NetworkInput, noise: float) -> NetworkInput:
    """The frame with bright pixels as bright as ``noise``.

    Training had images of open sky that noise made brighter than 0, and none that it made darker.
    """
    return replace(frame, image=frame.image + (noise - frame.bright))


class Inputs(NamedTuple):
    """Input of the network, ``maps`` (C, H, W) and ``numbers`` (N,), and the maps it corrects.

    ``start`` (H, W) is the log depth anchored on the best ranges of the spots, ``plain`` on their
    plain ranges alone; the network chooses between them.
    """

    maps: Channels
    numbers: Channels
    start: Channels
    plain: Channels


def inputs_of(frame: NetworkInput) -> Inputs:
    """Maps and numbers of a frame."""
    mean, best = frame.mean_log_depth, frame.best
    spots = spot_geometry(frame)
    measured, fitted, sure = frame.plain.weight, frame.fitted.weight, best.weight
    log_depth = np.nan_to_num(best.log_depth)
    in_front = veil(frame, spots)
    hidden = min(in_front, MAX_VEIL * frame.percentiles[0])
    bright, unveiled = (
        log_brightness(frame.image - each, frame.bright - each) for each in (0.0, max(hidden, 0.0))
    )
    # Log depth over its mean, if all surfaces reflected like those of the spots.
    by_bright, by_unveiled = (
        log_depth - mean + spots.around(log) / 2 for log in (bright, unveiled)
    )
    reflectance = np.nan_to_num(frame.log_reflectance - TYPICAL_LOG_REFLECTANCE)
    finite = np.isfinite(frame.log_reflectance) * sure
    spread = spots.spread(
        (log_depth - mean, sure),
        (frame.plain.log_depth - mean, measured),
        (frame.fitted.log_depth - mean, fitted),
        (by_bright, sure),
        (by_unveiled, sure),
        (reflectance, finite),
    )
    near = spots.summed(spots.near, np.array([measured, fitted, frame.lost]))
    start, unsure, plain = _anchored(frame, spots)
    maps = np.array(
        [
            *(bright, unveiled, start - mean, unsure, spread[0], spread[1], near[0], spread[2]),
            *(near[1], near[2], spread[3] - bright / 2, spread[4] - unveiled / 2, spread[5]),
            *(4 * spots.x, 4 * spots.y, plain - start),
        ],
        np.float32,
    )
    numbers = _numbers(frame, finite, reflectance, in_front)
    return Inputs(maps, numbers, start.astype(np.float32), plain.astype(np.float32))


class SpotGeometry(NamedTuple):
    """Spots among the pixels of an image.

    ``anchors`` (S, 2): their pixels; ``near`` and ``inverse`` (S, H, W): Gaussian and inverse
    squares of distances; ``x`` and ``y`` (H, W): slopes of the rays; ``down`` (S, H) and ``along``
    (S, W): weights of the mean around each spot.
    """

    anchors: Floats
    near: Floats
    inverse: Floats
    x: Floats
    y: Floats
    down: Floats
    along: Floats

    def around(self, image: Floats) -> Floats:
        """Means (S,) of the pixels around the spots."""
        return np.asarray(((self.down @ image) * self.along).sum(axis=1))

    def summed(self, nearness: Floats, weights: Floats) -> Floats:
        """Sums (n, H, W) of maps (S, H, W) of the spots, weighted by (n, S)."""
        whole = weights @ nearness.reshape(len(nearness), -1)
        return whole.reshape(-1, *nearness.shape[1:])

    def spread(self, *pairs: tuple[Floats, Floats]) -> Floats:
        """Interpolate pairs of values and weights, (S,) each: (n, H, W), tending to 0 far away."""
        values, weights = np.array(pairs).swapaxes(0, 1)
        sums = np.where(weights > 0, values, 0) * weights
        both = self.summed(self.inverse, np.concatenate([sums, weights]))
        return np.asarray(both[: len(pairs)] / (both[len(pairs) :] + 0.1))


def spot_geometry(frame: NetworkInput) -> SpotGeometry:
    """Geometry of a frame's spots."""
    return _spot_geometry(frame.optics, frame.image.shape, tuple(frame.directions.flat))


_rays = lru_cache(maxsize=4)(pixel_rays)


@lru_cache(maxsize=4)  # the same for all frames of a recording with fixed spots
def _spot_geometry(
    optics: Optics, shape: tuple[int, int], directions: tuple[float, ...]
) -> SpotGeometry:
    anchors = pixel_of(np.reshape(directions, (-1, 3)), optics, shape)
    squared = np.moveaxis(squared_distances(shape, anchors), -1, 0) / max(shape) ** 2
    rays = _rays(optics, shape)
    return SpotGeometry(
        anchors,
        np.exp(-squared / (2 * NARROW**2)),
        1 / (squared + SOFTENING),
        rays[..., 0],
        rays[..., 1],
        *(wide_hats(position, side) for position, side in zip(anchors.T, shape, strict=True)),
    )


NUMBERS = (
    *("mean depth", "spread", "ranges", "lost", "sigma", "fitted sigma", "noise"),
    *("patterns over pixels", "extinction", "fog known", "unambiguous range", "reflectance"),
    *("reflectance known", "veil", "darkest"),
)
MAPS = 16
_LOGARITHMS = {
    **dict.fromkeys(("sigma", "fitted sigma", "noise", "patterns over pixels"), (1.0, 4, "")),
    "mean depth": (USUAL_M, 1, " m"),
    "extinction": (CLEAR_PER_M, 4, " per m"),
    "unambiguous range": (10.0, 1, " m"),
}
"""For those of `NUMBERS` that are logarithms: reference value, divisor and unit."""


def _anchored(frame: NetworkInput, spots: SpotGeometry) -> tuple[Floats, Floats, Floats]:
    """Log depth (H, W) on the best ranges, log of its sigma, and log depth on the plain ranges."""
    mapped = AnchoredImage(frame.image, frame.bright, spots.anchors, START)
    nowhere = np.full(frame.image.shape, frame.mean_log_depth)

    def of(anchors: Anchors) -> LogDepth | None:
        depth_m = np.exp(anchors.log_depth)
        with np.errstate(invalid="ignore"):
            return mapped.log_depth(depth_m, anchors.log_sigma * depth_m)

    best = of(frame.best)
    if best is None:
        start, unsure = nowhere, np.zeros(nowhere.shape)
    else:
        start, unsure = best.mean, np.log(np.clip(best.sigma(), *SIGMA))
    if not frame.plain.weight.any():
        return start, unsure, start
    plain = of(frame.plain)
    return start, unsure, nowhere if plain is None else plain.mean


def _numbers(frame: NetworkInput, given: Floats, reflectance: Floats, in_front: float) -> Channels:
    """Values of `NUMBERS`; the veil of the fitted fog is comparable with the darkness of pixels.

    Numbers of spots are relative to those of the training: of fewer, the rest count as unknown.
    """
    best = frame.best
    weight = best.weight
    total = max(weight.sum(), 1e-6)
    away = np.nan_to_num(best.log_depth - frame.mean_log_depth)
    foggy = bool(np.isfinite(frame.extinction_per_m))
    numbers = [
        frame.mean_log_depth - np.log(USUAL_M),
        np.sqrt(weight @ away**2 / total),
        np.count_nonzero(frame.plain.weight) / USUAL_SPOTS,
        np.count_nonzero(frame.lost) / USUAL_SPOTS,
        _mean_sigma(frame.plain),
        _mean_sigma(frame.fitted),
        math.log(min(max(frame.noise, 1e-4), 10)) / 4,
        of_fraction(frame.fraction),
        np.log(max(frame.extinction_per_m, CLEAR_PER_M) / CLEAR_PER_M) / 4 if foggy else 0.0,
        float(foggy),
        math.log(min(max(frame.max_range_m, 1), 100) / 10),
        given @ reflectance / max(given.sum(), 1e-6),
        given.sum() / USUAL_SPOTS,
        math.log1p(min(max(in_front / frame.bright, 0), BRIGHTEST)),
        math.log1p(min(max(frame.percentiles[1] / frame.bright, -0.5), 1)),
    ]
    return np.array(numbers, np.float32)


def in_units(name: str, number: float) -> str:
    """One of `NUMBERS`, or another, in the unit of its quantity."""
    multiple, divided_by, unit = _LOGARITHMS.get(name, (None, 1, ""))
    value = number if multiple is None else multiple * np.exp(divided_by * number)
    return f"{value:.3g}{unit}"


def of_fraction(fraction: float) -> float:
    """The number for patterns over pixels."""
    return float(np.log(fraction)) / 4


def _mean_sigma(anchors: Anchors) -> float:
    """Mean scaled log sigma; 1 for a spot without a range."""
    sigma = np.where(np.isfinite(anchors.log_sigma), anchors.log_sigma, 1.0)
    return float(np.log(np.minimum(np.maximum(sigma, 1e-4), 1)).sum()) / USUAL_SPOTS / 4


def veil(frame: NetworkInput, spots: SpotGeometry) -> float:
    """Brightness of the fog in front of everything, as far as the fog is known.

    A surface of reflectance rho at z returns K rho exp(-2 alpha z) / (pi z^2), and fog of
    backscattering beta in front of it K beta times the integral of exp(-2 alpha r) / r^2 from where
    the detector sees it; K follows from the spots, whose rho and z are known. The fog behind a
    surface is missing from its veil, a few per cent at metres of distance.
    """
    best, weight = frame.best, frame.best.weight
    usable = (weight > 0) & np.isfinite(frame.log_reflectance)
    if not (np.isfinite(frame.extinction_per_m) and usable.any()):
        return 0.0
    alpha, beta = frame.extinction_per_m, frame.backscatter_per_m_sr
    depth, reflectance = np.exp(best.log_depth[usable]), np.exp(frame.log_reflectance[usable])
    returned = reflectance * np.exp(-2 * alpha * depth) / (np.pi * depth**2)
    in_fog = beta * np.exp(-2 * alpha * VEIL_FROM_M) / VEIL_FROM_M
    seen = spots.around(frame.image)[usable]
    scale = float(np.median(seen / (returned + in_fog)))
    return max(scale * in_fog, 0.0)


def log_brightness(image: Floats, bright: float) -> Floats:
    """Log brightness relative to bright pixels."""
    return np.log(np.maximum(image, DARKEST * bright) / bright)

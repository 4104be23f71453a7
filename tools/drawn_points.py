"""Points that a flight might remember when it sees a frame, drawn from the frame's true depths.

Scattered ones, as steered spots leave them, or tracks of fixed spots; with errors of ranges and
poses, some of surfaces that are hidden now, some wrapped, and some far off.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats, Mask
from reconstruction.depth.completion import MAX_LOG_SIGMA, Seen
from reconstruction.depth.memory.points import HIDDEN_LOG, HIDDEN_PIXELS
from reconstruction.depth.pixels import distances, in_view

SCATTERED, TRACKS = 0.5, 0.43
"""Fractions of the frames; the others know their own spots alone."""
USUAL_M = 4.0
ALIKE, ALIKE_PX = 0.15, 15.0
"""Differences of ln depth and pixel at which a point errs like a spot."""


@dataclass(frozen=True, eq=False)
class Known:
    """A frame's true ln depth (H, W), nan for nothing, its own spots, and its unambiguous range.

    Of the spots pixels (S, 2), and ln depth and its sigma (S,) as measured, nan for lost ones.
    """

    log_depth: Floats
    pixel: Floats
    measured: Floats
    sigma: Floats
    max_range_m: float


@dataclass(frozen=True, eq=False)
class _Places:
    """Pixels (N, 2) that were met, how long ago, as a fraction of the memory, and by this frame."""

    pixel: Floats
    age: Floats
    own: Mask


def drawn_points(rng: np.random.Generator, known: Known) -> Seen:
    """What a memory of this frame holds; the frame's own spots are among it."""
    places = _drawn_places(rng, known)
    shape = np.array(known.log_depth.shape)
    position_px, white_px = rng.uniform(0, 1.2), rng.uniform(0, 0.6) * (rng.random() < 0.5)
    grown = np.sqrt(1 - np.exp(-places.age * rng.uniform(0.5, 6)))
    turns = np.array([np.cos(2 * places.age), np.sin(2 * places.age)]).T @ rng.normal(size=(2, 2))
    shift = position_px * grown[:, None] * turns
    shift += white_px * rng.normal(size=shift.shape) * ~places.own[:, None]
    source = np.round(places.pixel)
    hidden = (rng.random(len(source)) < rng.uniform(0, 0.06)) & ~places.own
    source[hidden] += rng.integers(-4, 5, (np.count_nonzero(hidden), 2))
    row, column = np.clip(source, 0, shape - 1).astype(np.intp).T
    log_depth = _ranged(rng, known.log_depth[row, column], known.max_range_m)
    log_depth, bias = _as_measured(rng, known, log_depth, source)
    log_sigma = np.exp(rng.uniform(np.log(0.002), np.log(0.04)))
    log_depth = log_depth + log_sigma * rng.normal(size=len(log_depth))
    wrong = (rng.random(len(log_depth)) < rng.uniform(0, 0.02)) & ~places.own
    log_depth[wrong] += rng.normal(0, 0.5, np.count_nonzero(wrong))
    moved_m = rng.uniform(0, 0.05) * grown
    relative = (moved_m / np.exp(np.nan_to_num(log_depth, nan=np.log(USUAL_M)))) ** 2
    log_depth += 0.7 * np.sqrt(relative) * rng.normal(size=len(log_depth))
    variance = (log_sigma**2 + bias**2 / 2) * np.exp(rng.normal(0, 0.4)) + relative
    pixel_variance = (position_px * grown) ** 2 + white_px**2 * ~places.own
    farthest_m = rng.uniform(4, 25) if rng.random() < 0.6 else 25.0
    log_depth[places.own], variance[places.own] = known.measured, known.sigma**2
    seen = Seen(
        np.arange(len(log_depth)),
        places.pixel + shift,
        log_depth,
        np.maximum(variance, 1e-6),
        pixel_variance * np.exp(rng.normal(0, 0.3)),
    )
    with np.errstate(invalid="ignore"):
        usable = (log_depth < np.log(farthest_m)) & (variance < MAX_LOG_SIGMA**2)
    usable &= in_view(seen.pixel, shape) & in_view(places.pixel, shape)
    return _uncovered(seen[usable])


def _drawn_places(rng: np.random.Generator, known: Known) -> _Places:
    shape = np.array(known.log_depth.shape)
    kind, middle = rng.random(), (shape - 1) / 2
    pixels, ages = [np.zeros((0, 2))], [np.zeros(0)]
    if kind < SCATTERED:
        count = int(np.exp(rng.uniform(np.log(4), np.log(500))))
        width = shape / 2 * rng.uniform(0.6, 1.0)
        pixels.append(middle + width * rng.uniform(-1, 1, (count, 2)))
        ages.append(rng.random(count))
    elif kind < SCATTERED + TRACKS:
        age = np.sort(rng.random(int(rng.integers(5, 80))))
        pixels += _tracks(rng, known, age * rng.uniform(0.1, 1))
        ages += [age] * len(known.pixel)
    spots = len(known.pixel)
    pixel = np.concatenate([*pixels, known.pixel])
    age = np.concatenate([*ages, np.zeros(spots)])
    return _Places(pixel, age, np.arange(len(age)) >= len(age) - spots)


def _tracks(rng: np.random.Generator, known: Known, time: Floats) -> list[Floats]:
    """Where fixed spots have been: outwards of one that flies ahead, sideways, or turning."""
    shape = np.array(known.log_depth.shape)
    expansion = (shape - 1) / 2 + rng.normal(0, 4, 2)
    turn, way = np.outer(time, rng.normal(0, 3, 2)), rng.normal(size=2) * np.array([0.3, 1])
    way *= rng.uniform(3, 40) / np.linalg.norm(way)
    motion, tracks = rng.integers(3), []
    for spot in known.pixel:
        row, column = np.clip(np.round(spot), 0, shape - 1).astype(np.intp)
        nearness = USUAL_M / np.exp(np.nan_to_num(known.log_depth[row, column], nan=np.log(10)))
        if motion == 0:
            grown = 1 + rng.uniform(0.5, 1) * nearness * time
            track = expansion + np.outer(grown, spot - expansion)
        elif motion == 1:
            track = spot + np.outer(np.sin(rng.uniform(1, 3) * time), way * nearness)
        else:
            track = spot + np.outer(np.sin(rng.uniform(1, 4) * time), way / 2)
        tracks.append(track + turn)
    return tracks


def _ranged(rng: np.random.Generator, log_depth: Floats, max_range_m: float) -> Floats:
    """Depths as ranging states them: lost beyond its reach, or some of them wrapped, or right."""
    reach_m = max_range_m * rng.integers(1, 3)
    wrapped = rng.uniform(0.3, 1) * (rng.random() < 0.5)
    if rng.random() < 0.25:
        return log_depth
    with np.errstate(invalid="ignore"):
        depth_m = np.exp(log_depth)
        nearer_m = np.fmod(depth_m, reach_m)
        taken = (rng.random(len(depth_m)) < wrapped) & (nearer_m > 0.5)
        beyond = np.where(taken, np.log(np.maximum(nearer_m, 0.5)), np.nan)
        return np.where(depth_m > reach_m, beyond, log_depth)


def _as_measured(
    rng: np.random.Generator, known: Known, log_depth: Floats, pixel: Floats
) -> tuple[Floats, Floats]:
    """Ranges that err like those of the frame's own spots, and that error.

    A point has the error of a spot next to it and at its depth: lost, wrapped or biased, as whole
    surfaces are.
    """
    shape = np.array(known.log_depth.shape)
    row, column = np.clip(np.round(known.pixel), 0, shape - 1).astype(np.intp).T
    true = known.log_depth[row, column]
    error, there = known.measured - true, np.isfinite(true)
    off = np.where(there, np.abs(log_depth[:, None] - true), 1.0)
    unlike = np.nan_to_num(off, nan=1.0) / ALIKE + distances(pixel, known.pixel) / ALIKE_PX
    spot = np.argmin(unlike + rng.gumbel(size=unlike.shape) * 0.5, axis=1)
    like = np.exp(-unlike[np.arange(len(spot)), spot] / 3)
    usual = np.abs(np.nan_to_num(error, nan=np.inf)) < 0.3
    bias = np.where(usual, error, 0.0)[spot] * rng.uniform(0, 1)
    same = (rng.random(len(spot)) < like) & (rng.random() < 0.8)
    lost = np.isnan(known.measured)[spot] & same
    wrapped = (~usual & there & np.isfinite(error))[spot] & same
    result = np.where(wrapped, log_depth + np.nan_to_num(error)[spot], log_depth + bias)
    return np.where(lost, np.nan, result), np.where(wrapped, 0.0, bias)


def _uncovered(seen: Seen) -> Seen:
    """Points that no nearer one hides, as a memory's are."""
    apart: NDArray[np.floating] = distances(seen.pixel, seen.pixel)
    behind = seen.log_depth[:, None] - seen.log_depth
    return seen[~((apart < HIDDEN_PIXELS) & (behind > HIDDEN_LOG)).any(axis=1)]

"""Path offsets: whether a spot's path is calibrated differently from those of the other spots.

In clear air a path offset looks like a farther target. The fog's echo reveals it: it begins at the
instrument, has the same shape at all spots, and is late by the offset. It is a small part of
the light: one frame yields the delay to 10 or 20 cm, many frames together to centimetres. Only
differences between the spots of a frame count, as multiple scattering delays all echoes.

Around the fit of target and fog a frame's readings are linear in the offsets, so each frame adds
its information and score. Uneven fog also separates echoes; it is noise of a size that all frames
estimate together. If frames contradict each other, or their mean residual exceeds the noise, errors
grow by as much (R. T. Birge, Phys. Rev. 40, 207 (1932)).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

from ...base.arrays import Floats, Mask
from ...base.errors import InputError
from ...capture import Spots
from ...capture.readings.cw import CwSpots
from ...capture.readings.pulsed import PulsedSpots
from ...capture.schema import between
from .echo_model import EchoModel
from .modes import LOG_SIGMA, Indices, expected_backscatter
from .numerics import inverse, solved
from .of_charge import echo_combinations
from .solvers import fog_solver, max_fog_range_m
from .templates import EXTINCTIONS_PER_M, UNEVENNESS
from .underdetermined import PER_TARGET

UNEVENNESSES = UNEVENNESS * np.array([0.05, 0.25, 0.5, 1.0, 2.0])
"""Relative rms deviations of the fog's density, of which all frames select one."""
FIRST = UNEVENNESS / 2
"""Deviation for the first fit of target and fog."""
STEPS = 4
"""Gauss-Newton steps from the result of fog ranging."""
MAX_STEP_M, MAX_LOG_STEP, MIN_REFLECTANCE = 0.05, 0.5, 1e-3
"""Maximum step of ranges and of logarithms, and minimum reflectance."""
LOG_EXTINCTION = -3.0, 1.5
"""Prior mean and sigma of ln(extinction in 1/m)."""
UNKNOWN_M = 1e3
"""Prior sigma of offsets, uninformative."""
MODEL_M = 0.01
"""Error of the modelled echo delay at a spot, relative to the others."""
PARTS = 8
"""Parts of a recording that have to agree."""
MIN_SIGNIFICANCE = 3.5
"""Significance of an offset among four, in standard deviations: chance in one of 500 recordings."""
MIN_SPOTS = 3
"""Of two spots that differ, none is called the wrong one."""


@dataclass(frozen=True, eq=False)
class OffsetEvidence:
    """Evidence of a frame on the offsets in metres, for each of U unevennesses.

    The log likelihood of offsets x is ``log`` + ``score`` x - x ``information`` x / 2, up to what
    is common to the S spots: (U,), (U, S) and (U, S, S). ``left`` (U, S, n) are the residuals after
    target, fog and offsets, ``noise`` (U, S, n, n) the covariance of the readings, and ``expected``
    (U, S, n, n) that of the residuals.
    """

    log: Floats
    score: Floats
    information: Floats
    left: Floats
    noise: Floats
    expected: Floats


@dataclass(frozen=True, eq=False)
class PathOffsets:
    """Excess of each spot's measured path over those of the others, in metres.

    ``significant`` (S,) marks at most half of the spots, which are off beyond chance; the others
    are the reference. ``sigma_m`` (S,) is the standard deviation of ``offset_m`` (S,), and
    ``frames`` the number of frames with at least two ranges. Ranges are too far by half an offset.
    """

    offset_m: Floats
    sigma_m: Floats
    significant: Mask
    frames: int


def path_check(spots: Spots) -> Callable[[Spots], OffsetEvidence | None]:
    """Function from a frame's readings to its evidence; None for frames with fewer than two ranges.

    Raises InputError as `fog_solver`, for fewer than three spots, and for histograms, which are not
    supported.
    """
    if spots.pointing is not None:
        raise InputError(
            "path offsets are those of fixed spots; the recording has spots/pointing: record again "
            "with the mirrors at rest"
        )
    if len(spots.directions) < MIN_SPOTS:
        raise InputError(
            "path offsets show by comparison with the other spots, of which there must be two or "
            f"more; the recording has {len(spots.directions)} spot(s) in all"
        )
    if not isinstance(spots, CwSpots | PulsedSpots):
        raise InputError("path offsets can be estimated from taps and windows, not from histograms")
    prior, solve = fog_solver(spots)
    max_range_m = max_fog_range_m(spots)
    combine, response = echo_combinations(spots, max_range_m)
    if len(combine) <= PER_TARGET:
        return lambda spots: None
    model = EchoModel(spots, response, max_range_m)

    def find(spots: Spots) -> OffsetEvidence | None:
        assert isinstance(spots, CwSpots | PulsedSpots)
        ranges, fog = solve(spots, prior, None)
        seen = np.flatnonzero(ranges.valid & (ranges.range_m < max_range_m))
        if seen.size < 2:
            return None
        readings = spots.electrons(spots.taps[0])
        node = int(fog.probability[1:].argmax()) + 1  # the first is clear air
        log_fog = np.array([fog.log_median[node], np.log(EXTINCTIONS_PER_M[node])])
        return _evidence(
            model,
            (readings @ combine.T)[seen],
            ((combine * spots.variance(readings)[:, None]) @ combine.T)[seen],
            seen,
            ranges.range_m[seen],
            log_fog,
        )

    return find


def measure_path_offsets(spots: Spots) -> PathOffsets:
    """Estimate the offsets from all frames of a recording; raises InputError as `path_check`."""
    find = path_check(between(spots, 0, 0))
    frames = range(len(spots.readings))
    evidence = [find(between(spots, frame, frame + 1)) for frame in frames]
    return path_offsets(evidence, len(spots.directions))


def min_significance(spots: int) -> float:
    """Significance of an offset among so many, as rare by chance as MIN_SIGNIFICANCE among four."""
    return float(-ndtri(4 / spots * ndtr(-MIN_SIGNIFICANCE)))


def path_offsets(frames: Sequence[OffsetEvidence | None], spots: int) -> PathOffsets:
    """Estimate the offsets of so many spots from the evidence of successive frames."""
    evidence = [each for each in frames if each is not None]
    off = np.zeros(spots, bool)
    if not evidence:
        return PathOffsets(np.zeros(spots), np.full(spots, np.inf), off, 0)
    uneven = int(np.sum([each.log for each in evidence], axis=0).argmax())
    score = np.array([each.score[uneven] for each in evidence])
    information = np.array([each.information[uneven] for each in evidence])
    covariance = inverse((information.sum(axis=0) + np.eye(spots) / UNKNOWN_M**2)[None])[0]
    offset_m = covariance @ score.sum(axis=0)
    parts = np.linspace(0, len(evidence), min(PARTS, len(evidence)), endpoint=False).astype(int)
    growth = max(
        1.0,
        _scatter(score, information, offset_m),
        _scatter(np.add.reduceat(score, parts), np.add.reduceat(information, parts), offset_m),
        _in_common(evidence, uneven),
    )
    while True:
        beside_m, sigma_m = _beside_others(offset_m, growth**2 * covariance, ~off)
        away = np.where(off, 0, np.abs(beside_m) / sigma_m)
        if away.max() < min_significance(spots) or off.sum() == spots // 2:
            return PathOffsets(beside_m, sigma_m, off, len(evidence))
        off[away.argmax()] = True


def _beside_others(offset_m: Floats, covariance: Floats, right: Mask) -> tuple[Floats, Floats]:
    """Offsets and sigmas (S,) relative to the mean of the other spots that are right."""
    every = np.eye(len(right))
    others = right & (every == 0)
    beside = every - others / others.sum(axis=1, keepdims=True)
    variance = np.diagonal(beside @ covariance @ beside.T)
    return beside @ offset_m, np.sqrt(variance + MODEL_M**2)


def _scatter(score: Floats, information: Floats, offset_m: Floats) -> float:
    """Birge ratio of parts (P, S): scatter around their mean over the expected one.

    Each part has S - 1 differences between its spots.
    """
    if len(score) < 2:
        return 1.0
    beyond = score - information @ offset_m
    parts, spots = score.shape
    valid = information + np.eye(spots) / UNKNOWN_M**2
    squares = (beyond * solved(valid, beyond)).sum()
    return float(np.sqrt(squares / ((spots - 1) * (parts - 1))))


def _in_common(evidence: Sequence[OffsetEvidence], uneven: int) -> float:
    """Mean residual of all frames over its expected size.

    Standing patches of fog are a single sample, however many frames they are in.
    """
    left = np.sum([each.left[uneven] for each in evidence], axis=0)
    noise = np.sum([each.noise[uneven] for each in evidence], axis=0)
    expected = np.sum([each.expected[uneven] for each in evidence], axis=0)
    seen = noise.any(axis=(1, 2))
    left, noise, expected = left[seen], noise[seen], expected[seen]
    squares = (left * np.linalg.solve(noise, left[..., None])[..., 0]).sum()
    by_chance = np.trace(np.linalg.solve(noise, expected), axis1=1, axis2=2).sum()
    return float(np.sqrt(squares / by_chance))


def _evidence(
    model: EchoModel,
    readings: Floats,
    covariance: Floats,
    spots: Indices,
    range_m: Floats,
    log_fog: Floats,
) -> OffsetEvidence:
    """Evidence of readings (m, n) of some spots (m,), around the fit of target and fog.

    The parameters are ln backscattering, ln extinction, and each spot's range, reflectance, offset.
    """
    offsets = np.arange(4, 2 + 3 * spots.size, 3)
    fitted = np.setdiff1d(np.arange(2 + 3 * spots.size), offsets)
    at = np.zeros(2 + 3 * spots.size)
    at[:2], at[2::3] = log_fog, range_m
    left, jacobian, _ = _around(model, readings, spots, at)
    for row in range(spots.size):
        target = jacobian[row, :, 3 + 3 * row]
        at[3 + 3 * row] = max(left[row] @ target / (target @ target), MIN_REFLECTANCE)
    for step in range(STEPS + 1):
        left, jacobian, uneven = _around(model, readings, spots, at)
        if step == STEPS:
            break
        normal, pull, _ = _normal(left, jacobian, covariance + FIRST**2 * uneven, at)
        move = np.zeros(at.size)
        move[fitted] = solved(normal[None][:, fitted][:, :, fitted], pull[None, fitted])[0]
        move[:2] = np.clip(move[:2], -MAX_LOG_STEP, MAX_LOG_STEP)
        move[2::3] = np.clip(move[2::3], -MAX_STEP_M, MAX_STEP_M)
        at = at + move
        at[3::3] = np.maximum(at[3::3], MIN_REFLECTANCE)
    result = [
        _of_offsets(left, jacobian, covariance + unevenness**2 * uneven, at)
        for unevenness in UNEVENNESSES
    ]
    log, score, information, *others = (np.array(each) for each in zip(*result, strict=True))
    every = np.eye(model.spots)[:, spots]
    scattered = (np.einsum("sm,um...->us...", every, each) for each in others)
    return OffsetEvidence(log, score @ every.T, every @ information @ every.T, *scattered)


def _around(
    model: EchoModel, readings: Floats, spots: Indices, at: Floats
) -> tuple[Floats, Floats, Floats]:
    """Residuals of the readings, slopes (m, n, p), and covariance of fog of unit unevenness."""
    jacobian = np.zeros((*readings.shape, at.size))
    left, uneven = [], []
    for row, spot in enumerate(spots):
        own = slice(2 + 3 * row, 5 + 3 * row)
        echo = model(spot, at[own][0], at[own][1], at[:2])
        left.append(readings[row] - echo.readings)
        jacobian[row, :, :2] = echo.of_fog
        jacobian[row, :, own] = echo.of_target
        uneven.append(echo.uneven)
    return np.array(left), jacobian, np.array(uneven)


def _normal(
    left: Floats, jacobian: Floats, noise: Floats, at: Floats
) -> tuple[Floats, Floats, float]:
    """Information (p, p), gradient (p,) and value of the log likelihood."""
    weighted = np.linalg.solve(noise, jacobian).swapaxes(1, 2)
    whitened = np.linalg.solve(noise, left[..., None])
    information = (weighted @ jacobian).sum(axis=0)
    gradient = (jacobian.swapaxes(1, 2) @ whitened)[..., 0].sum(axis=0)
    log = -((left * whitened[..., 0]).sum() + np.linalg.slogdet(noise)[1].sum()) / 2
    median, spread = LOG_EXTINCTION
    for away, slopes, sigma in (
        (at[0] - np.log(expected_backscatter(np.exp(at[1]))), np.array([1.0, -1.0]), LOG_SIGMA),
        (at[1] - median, np.array([0.0, 1.0]), spread),
    ):
        information[:2, :2] += np.outer(slopes, slopes) / sigma**2
        gradient[:2] -= slopes * away / sigma**2
        log -= away**2 / sigma**2 / 2
    return information, gradient, float(log)


def _of_offsets(
    left: Floats, jacobian: Floats, noise: Floats, at: Floats
) -> tuple[float, Floats, Floats, Floats, Floats, Floats]:
    """Fields of `OffsetEvidence` for one unevenness, of the fitted spots alone."""
    information, gradient, log = _normal(left, jacobian, noise, at)
    own = np.arange(4, at.size, 3)
    regularised = information.copy()
    regularised[own, own] += 1 / UNKNOWN_M**2
    covariance = inverse(regularised[None])[0]
    log += (gradient @ covariance @ gradient - np.linalg.slogdet(regularised)[1]) / 2
    # Marginal information about offsets, projected onto differences between the spots.
    precise = inverse(covariance[None][:, own][:, :, own])[0]
    score = precise @ (covariance @ gradient)[own]
    sums = precise.sum(axis=1)
    score = score - sums * score.sum() / sums.sum()
    precise = precise - np.outer(sums, sums) / sums.sum()
    return (
        log,
        score,
        precise.T,
        left - jacobian @ (covariance @ gradient),
        noise,
        noise - jacobian @ covariance @ jacobian.swapaxes(1, 2),
    )

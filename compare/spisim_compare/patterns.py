"""Readings of patterns of two captures as vectors, their noise, and what an image makes of them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats, Mask
from reconstruction.base.errors import InputError
from reconstruction.capture import Buckets, Capture
from reconstruction.operators import PatternPlan, expose

MIN_VARIANCE = 1.0
"""Minimum variance of a difference: of an electron, as a dark reading is not noiseless."""
MIN_FRAMES = 4
"""Minimum number of frames whose scatter shows the noise."""


@dataclass(frozen=True, eq=False)
class Mean:
    """Means of readings (n,) over frames, the variance of each mean, and which are usable.

    ``scatter`` (n,) is the variance of a reading between frames over that stated; nan where it is
    unknown.
    """

    value: Floats
    variance: Floats
    usable: Mask
    frames: NDArray[np.intp]
    scatter: Floats


def mean_over_frames(values: Floats, variance: Floats, usable: Mask) -> Mean:
    """Mean of readings (frames, n)."""
    count = usable.sum(axis=0)
    divisor = np.maximum(count, 1)
    value = np.where(usable, values, 0).sum(axis=0) / divisor
    stated = np.where(usable, variance, 0).sum(axis=0) / divisor
    scatter = np.full(value.shape, np.nan)
    several = count > 1
    squares = np.where(usable, (values - value) ** 2, 0).sum(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        scatter[several] = (squares / (divisor - 1) / stated)[several]
    return Mean(value, stated / divisor, count > 0, count, scatter)


def patterns_mean(capture: Capture) -> Mean:
    """Mean readings of all patterns, plan after plan: (plans * exposures,).

    Noise that is not stated is that of the scatter between frames; nan with too few of them.
    """
    buckets, plans = capture.buckets, len(capture.setup.plans)
    signal, variance, usable = buckets.signal, buckets.variance, buckets.usable
    turns = [slice(turn, None, plans) for turn in range(plans)]
    if np.isnan(variance).any():
        variance = np.broadcast_to(_scatter(signal, usable, turns), signal.shape)
    means = [mean_over_frames(signal[at], variance[at], usable[at]) for at in turns]
    return Mean(*(np.concatenate(each) for each in zip(*map(_fields, means), strict=True)))


def _fields(mean: Mean) -> tuple[NDArray[np.generic], ...]:
    return mean.value, mean.variance, mean.usable, mean.frames, mean.scatter


def _scatter(signal: Floats, usable: Mask, turns: Sequence[slice]) -> float:
    """Variance of readings between frames that show the same patterns, pooled."""
    squares, freedom = 0.0, 0
    for at in turns:
        count = usable[at].sum(axis=0)
        mean = np.where(usable[at], signal[at], 0).sum(axis=0) / np.maximum(count, 1)
        squares += float(np.where(usable[at], (signal[at] - mean) ** 2, 0).sum())
        freedom += int(np.maximum(count - 1, 0).sum())
    return squares / freedom if freedom and len(signal) >= MIN_FRAMES * len(turns) else np.nan


def common_noise(real: Mean, simulated: Mean) -> Floats:
    """Variance (n,) of the difference of two means.

    Readings whose noise is unknown count as exact beside others whose noise is known: they are
    expected values. Raises InputError if the noise of neither is known.
    """
    variances = np.array([real.variance, simulated.variance])
    if np.isnan(variances).all(axis=0).any():
        raise InputError(
            "buckets/noise_electrons or buckets/electrons_per_count is unknown (nan) in both "
            f"captures: state them, or record at least {MIN_FRAMES} frames, whose scatter shows "
            "the noise"
        )
    return np.maximum(np.nansum(variances, axis=0), MIN_VARIANCE)


def exposed(plans: Sequence[PatternPlan], images: Floats) -> Floats:
    """Readings (..., plans * exposures) of images (..., H, W)."""
    return np.concatenate([expose(plan, images) for plan in plans], axis=-1)


def constant(plans: Sequence[PatternPlan]) -> Floats:
    """Readings (n,) of a unit of steady light: none in differences that the recorder formed."""
    return np.concatenate([np.abs(plan.polarity).astype(np.float64) for plan in plans])


def names_of_patterns(plans: Sequence[PatternPlan]) -> list[str]:
    """Names of the readings of all patterns, plan after plan."""
    sign = {1: "on", -1: "complement", 0: "difference"}
    return [
        f"exposure {k}, pattern {index} {sign[polarity]}"
        + (f", plan {turn}" if len(plans) > 1 else "")
        for turn, plan in enumerate(plans)
        for k, (index, polarity) in enumerate(
            zip(plan.index.tolist(), plan.polarity.tolist(), strict=True)
        )
    ]


def light_error(plans: Sequence[PatternPlan], squares: Floats) -> tuple[Floats, Floats]:
    """Variance (n,) of each reading of a pattern, and standard error (n,) common to all.

    ``squares`` (H, W) are the squared errors of an image's pixels, which are independent; that of
    their sum is common to all patterns, in proportion to what they light.
    """
    total = max(float(squares.sum()), np.finfo(np.float64).tiny)
    lit = exposed(plans, squares)
    common = lit / np.sqrt(total)
    whole = np.where(constant(plans) > 0, lit, total)
    return np.maximum(whole - common**2, 0.0), common


def buckets_of(value: Floats, variance: Floats, usable: Mask, like: Capture) -> Buckets:
    """Readings (n,) as those of a capture without dead time, one frame for each plan.

    ``variance`` is that of each reading; nan counts as none.
    """
    plans, own = len(like.setup.plans), like.buckets
    return Buckets(
        counts=value.reshape(plans, -1),
        saturated=~usable.reshape(plans, -1),
        exposure_time_s=own.exposure_time_s,
        pattern_period_s=own.pattern_period_s,
        electrons_per_count=1.0 if own.unit == "electron" else np.nan,
        offset_counts=0.0,
        noise_electrons=float(np.sqrt(np.median(np.nan_to_num(variance)))),
        excess_noise_factor=1e-9,  # all noise is in noise_electrons
        dead_time_s=0.0,
    )

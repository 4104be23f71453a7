"""Calibration of a recording by itself, by recordings of the same patterns, or by a flat field."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from .base.arrays import Floats, Mask
from .base.errors import InputError
from .capture import Capture
from .operators import PatternPlan, Throughput, decoder_for

MIN_REPEATED = 30
"""Minimum number of coefficients that two recordings compare."""


class ThroughputCalibration(NamedTuple):
    """Throughput by pattern.

    ``factors`` (rows,): on differences, relative to the mean, nan where unknown; ``scatter``: rms
    of what pairs pass, all-on not counted.
    """

    factors: Floats
    scatter: float


def throughput_of(recordings: Sequence[Capture]) -> ThroughputCalibration | None:
    """Throughput by pairs of pattern and complement in all frames of recordings.

    Parameters
    ----------
    recordings
        Captures of any scenes with the same patterns; their light adds up.

    Returns
    -------
    ThroughputCalibration or None
        None if noise may explain the scatter of the pairs.

    Raises
    ------
    InputError
        If the patterns differ, their throughput is stated already, or they have no pairs.
    """
    plan = _common_plan(recordings)
    parts = [_added(recording) for recording in recordings]
    signal, variance = (np.sum([part[axis] for part in parts], axis=0) for axis in (0, 1))
    usable = np.all([part[2] for part in parts], axis=0)
    pairs = Throughput(plan, usable)
    if not pairs.pairs:
        raise InputError(
            "no pattern is exposed with its complement, so a recording does not show their "
            "throughput; record a uniform scene (flat field)"
        )
    shown = pairs.estimated(signal, variance)
    factors = pairs.acting(signal, variance)
    if shown is None or factors is None:
        return None
    return ThroughputCalibration(factors, float(np.nanstd(_without_all_on(plan, shown))))


def throughput_of_flat_field(recording: Capture) -> ThroughputCalibration:
    """Throughput by a recording of a uniform scene, where all patterns collect equal light.

    Raises
    ------
    InputError
        If a throughput is stated already, there is no dark exposure to subtract, or a reading is
        not above it.
    """
    plan = _common_plan([recording])
    signal, _, usable = _added(recording)
    dc_row = plan.patterns.dc_row
    dark = usable & (plan.index == dc_row) & (plan.polarity == -1)
    lit = usable & ~dark & (plan.polarity != 0)
    if not dark.any() or np.count_nonzero(lit) < 2:
        raise InputError(
            "a flat field needs patterns as displayed and a dark exposure (the DC row with "
            "polarity -1); these patterns have none"
        )
    net = (signal - signal[dark].mean()) / np.where(plan.index == dc_row, 2, 1)
    rows = np.unique(plan.index[lit])
    means = np.array([net[lit & (plan.index == row)].mean() for row in rows])
    if (means <= 0).any():
        raise InputError(
            f"pattern index {rows[means <= 0][0]} is not above the dark exposure: is this a flat "
            "field?"
        )
    factors = np.full(plan.patterns.rows, np.nan)
    factors[rows] = means / means[rows != dc_row].mean()
    return ThroughputCalibration(factors, float(np.nanstd(_without_all_on(plan, factors))))


def calibrated(capture: Capture, calibration: ThroughputCalibration) -> Capture:
    """Capture whose plans state a throughput; raises InputError if it is not of these patterns."""
    plan, *following = (
        replace(each, throughput=calibration.factors) for each in capture.setup.plans
    )
    return replace(capture, plan=plan, following_plans=tuple(following))


def excess_noise(first: Capture, second: Capture, rows: Mask | None = None) -> tuple[float, float]:
    """Variance of readings over what two recordings of one scene state, by their differences.

    Parameters
    ----------
    first, second
        Recordings with the same patterns, whose noise is known; exposures may differ.
    rows
        Mask (K,) of the coefficients to compare, all but DC by default.

    Returns
    -------
    tuple of float
        Factor of the variance, and its standard error.

    Raises
    ------
    InputError
        If the patterns differ, noise is unknown or too few coefficients are left.
    """
    plan = _common_plan([first, second])
    decoder = decoder_for(plan)
    used = decoder.operator.varying if rows is None else decoder.operator.varying & rows
    values, variances = [], []
    for recording in (first, second):
        signal, variance, usable = _added(recording)
        used = used & decoder.measured(usable)
        values.append(decoder.decode(signal))
        variances.append(decoder.own_variance(variance))
    if np.count_nonzero(used) < MIN_REPEATED:
        raise InputError(f"{np.count_nonzero(used)} coefficients; at least {MIN_REPEATED} needed")
    if not np.isfinite(variances).all():
        raise InputError("the noise of a recording is unknown: state electrons_per_count and noise")
    (one, other), (noise, others_noise) = values, variances
    ratio = float(_added(second)[0].sum() / _added(first)[0].sum())
    squared = (other - ratio * one)[used] ** 2 / (others_noise + ratio**2 * noise)[used]
    return float(squared.mean()), float(squared.std() / np.sqrt(squared.size))


def _common_plan(recordings: Sequence[Capture]) -> PatternPlan:
    first = recordings[0].plan
    for recording in recordings:
        for plan in recording.setup.plans:
            if plan.throughput is not None:
                raise InputError("the capture states the throughput of its patterns already")
            for name in ("shape", "basis", "exposures"):
                if getattr(plan, name) != getattr(first, name):
                    raise InputError(
                        f"other patterns: {name} is {getattr(plan, name)}, not "
                        f"{getattr(first, name)} as of the first recording"
                    )
            same = np.array_equal(plan.index, first.index)
            if not (same and np.array_equal(plan.polarity, first.polarity)):
                raise InputError("other patterns: their index or polarity is not the first's")
    return first


def _added(recording: Capture) -> tuple[Floats, Floats, Mask]:
    """Signal, variance and usability (M,) of all frames of a recording together."""
    buckets = recording.buckets
    usable = np.asarray(buckets.usable.all(axis=0))
    return buckets.signal.sum(axis=0), buckets.variance.sum(axis=0), usable


def _without_all_on(plan: PatternPlan, factors: Floats) -> Floats:
    return factors[np.arange(factors.size) != plan.patterns.dc_row]

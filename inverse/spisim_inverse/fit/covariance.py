"""Covariance of the difference of recorded and expected readings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.capture.readings.dtof import HistogramSpots
from spisim.simulation.light import Transport
from spisim.simulation.measurement.light import pixel_electrons
from spisim_compare.gaussian import Covariance
from spisim_compare.light_error import StatedAccuracy, image_error_of
from spisim_compare.patterns import light_error
from spisim_inverse.fit.readings import Expected, Readings
from spisim_inverse.fit.twin import Twin

STEADY_UNSURE = 0.3
"""Relative standard deviation of daylight, and of the patterns' light on the detectors of spots: a
scene file states them as guesses. Dark current is not part of it."""
DRAWS = 64
"""Draws of the error of the spots' light, from which its covariance is estimated."""


def detector_noise(
    readings: Readings, twin: Twin, light: Transport, expected: Expected
) -> Covariance:
    """Noise of the mean over frames, speckle, and what is not known of the steady light.

    Parameters
    ----------
    readings, twin, light
        The recording, its twin, and the light that is traced of it.
    expected
        What the twin should give.
    """
    factors = [_steady(readings, twin, light, expected)]
    if isinstance(readings.capture.spots, HistogramSpots):
        factors.append(_speckle(readings, twin, light, expected))
    return Covariance(expected.variance / np.maximum(readings.frames, 1), np.hstack(factors))


def with_light_error(
    noise: Covariance,
    readings: Readings,
    twin: Twin,
    light: Transport,
    expected: Expected,
    seed: int,
) -> Covariance:
    """The same with the error of the traced light, and of that which a simulation recorded.

    `seed` is of draws that propagate that of the spots.
    """
    variance, factors = noise.variance.copy(), []
    if readings.patterns:
        own, common = _of_image(readings, twin, light)
        variance[: readings.patterns] += own
        factors.append(_padded(common[:, None], readings, 0))
    if readings.patterns < variance.size:
        own, columns = _of_spots(readings, twin, light, expected, seed)
        variance[readings.patterns :] += own
        factors.append(_padded(columns, readings, readings.patterns))
    return replace(noise, variance=variance).plus(factors)


def _padded(columns: Floats, readings: Readings, start: int) -> Floats:
    whole = np.zeros((readings.mean.size, columns.shape[1]))
    whole[start : start + len(columns)] = columns
    return whole


def _of_image(readings: Readings, twin: Twin, light: Transport) -> tuple[Floats, Floats]:
    """Variance (n,), and error (n,) common to all, of readings of patterns in counts."""
    assert twin.buckets is not None
    capture, per_count = readings.capture, twin.buckets.electrons_per_count
    squares = (light.image_error * pixel_electrons(twin.instrument)) ** 2
    own, common = light_error(capture.setup.plans, squares)
    recorded, recorded_common = image_error_of(capture)
    return (own + recorded) / per_count**2, np.hypot(common, recorded_common) / per_count


def _steady(readings: Readings, twin: Twin, light: Transport, expected: Expected) -> Floats:
    """Columns (n, 1 + spots) of a change of steady light by its standard deviation."""
    dimmed = replace(light, daylight_w=(1 - STEADY_UNSURE) * light.daylight_w)
    columns = [readings.expected(twin, dimmed).counts - expected.counts]
    for spot in range(int(readings.group.max(initial=0))):
        fewer = np.ones(light.spot_daylight_w.size)
        fewer[spot] -= STEADY_UNSURE
        dimmed = replace(
            light,
            spot_daylight_w=fewer * light.spot_daylight_w,
            spot_crosstalk_w=fewer * light.spot_crosstalk_w,
        )
        columns.append(readings.expected(twin, dimmed).counts - expected.counts)
    return np.column_stack(columns)


def _of_spots(
    readings: Readings, twin: Twin, light: Transport, expected: Expected, seed: int
) -> tuple[Floats, Floats]:
    """Variance (m,) and common errors (m, r) of the spots' readings by that of their light."""
    rng = np.random.default_rng(seed)
    some = slice(readings.patterns, None)
    shape = light.spot_histogram.shape
    recorded = StatedAccuracy(readings.capture)("spot_noise_share")
    of_both = np.hypot(1.0, recorded / light.spot_noise_share)
    draws = np.empty((DRAWS, expected.counts[some].size))
    for draw in draws:
        error = light.spot_histogram_error * rng.standard_normal(shape)
        other = replace(light, spot_histogram=light.spot_histogram + error)
        change = readings.expected(twin, other).counts - expected.counts
        draw[:] = of_both * change[some]
    if isinstance(readings.capture.spots, HistogramSpots):
        return np.mean(draws**2, axis=0), np.zeros((draws.shape[1], 0))
    owner, columns = readings.group[some], []
    for spot in np.unique(owner):
        own = draws[:, owner == spot]
        strength, directions = np.linalg.eigh(own.T @ own / DRAWS)
        column = np.zeros((owner.size, strength.size))
        column[owner == spot] = directions * np.sqrt(np.maximum(strength, 0.0))
        columns.append(column)
    return np.zeros(owner.size), np.hstack(columns)


def _speckle(readings: Readings, twin: Twin, light: Transport, expected: Expected) -> Floats:
    """Columns (n, spots) of the echoes, which speckle scatters from frame to frame."""
    contrast = twin.instrument.ranging.tof.speckle_contrast  # type: ignore[attr-defined]
    brighter = replace(light, spot_histogram=(1 + contrast) * light.spot_histogram)
    change = readings.expected(twin, brighter).counts - expected.counts
    change /= np.sqrt(np.maximum(readings.frames, 1))
    spots = np.arange(1, int(readings.group.max(initial=0)) + 1)
    return np.where(readings.group[:, None] == spots, change[:, None], 0.0)

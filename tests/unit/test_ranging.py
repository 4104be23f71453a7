"""CW time of flight: phase, range and its error bar for any taps, and what counts as valid."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.constants import c

from fourspots import (
    CHARGE,
    DETECTORS,
    DIRECTIONS,
    GEOMETRY,
    PATHS,
    RANGES,
    assert_scatter,
    charge,
    counts,
)
from reconstruction.base.errors import InputError
from reconstruction.capture.readings.cw import CwSpots
from reconstruction.ranging import measure_ranges
from reconstruction.ranging.methods.cw import demodulate, quadrature_weights
from reconstruction.ranging.ranges import range_from_path

FREQUENCY = 15e6


def spots(electrons, taps, phase_offset=0.4, **changes):
    """Spots of one frame with two electrons per count and an offset of 50 counts."""
    model = CHARGE | changes
    model["noise_electrons"] = np.full(taps, model["noise_electrons"])
    return CwSpots(
        **GEOMETRY,
        **model,
        taps=counts(electrons[None]),
        saturated=np.zeros((1, 4, taps), dtype=bool),
        tap_frequencies_hz=np.full(taps, FREQUENCY),
        tap_phases_rad=2 * np.pi * np.arange(taps) / taps,
        phase_offsets_rad=np.full(taps, phase_offset),
        periods=1000,
    )


def ideal(taps, phase_offset=0.4, amplitude=1e4, offset=5e4):
    phase = 2 * np.pi * FREQUENCY * PATHS / c + phase_offset
    tap_phases = 2 * np.pi * np.arange(taps) / taps
    return offset + amplitude * np.cos(phase[:, None] - tap_phases)


@pytest.mark.parametrize("taps", [3, 4, 5, 8])
def test_ranges_come_back_with_amplitude_and_offset(taps):
    ranges = measure_ranges(spots(ideal(taps), taps))
    assert ranges.valid.all()
    assert np.allclose(ranges.range_m, RANGES)
    assert np.allclose(ranges.signal_electrons, 1e4)
    assert np.allclose(ranges.background_electrons, 5e4)


def test_unequal_tap_phases_are_solved_by_least_squares():
    tap_phases = np.array([0.1, 1.9, 4.4])
    taps = 7 + 2 * np.cos(1.3 - tap_phases)
    phase, amplitude, offset, _ = demodulate(taps, np.ones(3), quadrature_weights(tap_phases))
    assert (phase, amplitude, offset) == pytest.approx((1.3, 2, 7))


def test_four_taps_reduce_to_the_arctangent_and_the_propagated_variance():
    rng = np.random.default_rng(0)
    taps, variance = rng.uniform(1, 9, (50, 4)), rng.uniform(1, 9, (50, 4))
    weights = quadrature_weights(np.arange(4) * np.pi / 2)
    phase, amplitude, _, sigma = demodulate(taps, variance, weights)
    expected = np.arctan2(taps[:, 1] - taps[:, 3], taps[:, 0] - taps[:, 2])
    assert np.allclose(phase, expected)
    opposite = np.sin(expected) ** 2 * (variance[:, 0] + variance[:, 2])
    quadrature = np.cos(expected) ** 2 * (variance[:, 1] + variance[:, 3])
    assert np.allclose(sigma**2, (opposite + quadrature) / (4 * amplitude**2))


def test_range_solves_the_triangle_and_its_slope_is_the_derivative():
    range_m, slope = range_from_path(PATHS, DIRECTIONS, DETECTORS)
    assert np.allclose(range_m, RANGES)
    step = 1e-6
    further, _ = range_from_path(PATHS + step, DIRECTIONS, DETECTORS)
    assert np.allclose(slope, (further - range_m) / step, rtol=1e-4)


@pytest.mark.parametrize(
    ("taps", "noise", "excess"), [(3, 0.0, 1.0), (4, 150.0, 1.0), (6, 300.0, 1.0), (4, 200.0, 5.5)]
)
def test_sigma_is_the_scatter_of_20000_trials(taps, noise, excess):
    mean = ideal(taps)
    model = {"noise_electrons": noise, "excess_noise_factor": excess}
    expected = measure_ranges(spots(mean, taps, **model))
    everywhere = np.broadcast_to(mean, (20_000, *mean.shape))
    recorded = charge(np.random.default_rng(taps), everywhere, excess, noise)
    # all trials at once, through the functions that do the work
    weights = quadrature_weights(2 * np.pi * np.arange(taps) / taps - 0.4)
    phase, _, _, _ = demodulate(recorded, recorded, weights)
    path = np.mod(phase, 2 * np.pi) * c / (2 * np.pi * FREQUENCY)
    ranges, _ = range_from_path(path, DIRECTIONS, DETECTORS)
    assert_scatter(ranges, RANGES, expected.sigma_m)


def test_sigma_is_that_of_lange_and_seitz():
    """sigma = c / (4 sqrt(2) pi f) sqrt(B) / A for four taps and shot noise (2001, eq. 11)."""
    coaxial = replace(
        spots(ideal(4), 4), detector_positions_m=np.zeros((4, 3)), excess_noise_factor=4.0
    )
    expected = c / (4 * np.sqrt(2) * np.pi * FREQUENCY) * np.sqrt(4.0 * 5e4) / 1e4
    assert np.allclose(measure_ranges(coaxial).sigma_m, expected, rtol=1e-6)


def test_a_saturated_tap_spoils_its_spot_only():
    measured = spots(ideal(4), 4)
    measured.saturated[0, 2, 1] = True
    ranges = measure_ranges(measured)
    assert ranges.status == ("ok", "ok", "saturated", "ok")
    assert ranges.valid.tolist() == [True, True, False, True]
    assert np.isnan(ranges.range_m[2])
    assert np.isnan(ranges.sigma_m[2])


def test_a_spot_without_signal_is_not_valid():
    electrons = ideal(4)
    electrons[1] = 5e4
    electrons[3] = 5e4 + 2 * np.sqrt(5e4) * np.array([1, 0, -1, 0]) * 0.7  # twice its own sigma
    expected = ("ok", "no signal", "ok", "no signal")
    assert measure_ranges(spots(electrons, 4)).status == expected


def test_a_path_shorter_than_the_baseline_is_not_valid():
    electrons = ideal(4)
    path = np.array([0.05, 0.05, 0.05, 0.05])  # the detectors are 10 cm away but the last
    phase = 2 * np.pi * FREQUENCY * path / c + 0.4
    electrons = 5e8 + 1e8 * np.cos(phase[:, None] - np.arange(4) * np.pi / 2)
    assert measure_ranges(spots(electrons, 4)).status == (*["too close"] * 3, "ok")


def test_the_first_reason_counts():
    dark = spots(np.zeros((4, 4)), 4)
    dark.saturated[0, 1] = True
    assert measure_ranges(dark).status == ("no signal", "saturated", "no signal", "no signal")


def test_frames_are_independent():
    first = spots(ideal(4), 4)
    both = replace(
        first,
        taps=np.concatenate([np.zeros((1, 4, 4)), first.taps]),
        saturated=np.zeros((2, 4, 4), dtype=bool),
    )
    assert not measure_ranges(both, 0).valid.any()
    assert np.allclose(measure_ranges(both, 1).range_m, RANGES)


def test_unknown_noise_is_estimated_from_the_tap_to_spare():
    """With four degrees of freedom sigma is wider by the square root of two, in the mean square."""
    rng, rms = np.random.default_rng(5), 1000.0
    away, sigmas = [], []
    for _ in range(300):
        noisy = ideal(4) + rms * rng.standard_normal((4, 4))
        result = measure_ranges(spots(noisy, 4, noise_electrons=np.nan))
        away.append((result.range_m - RANGES) / result.sigma_m)
        sigmas.append(result.sigma_m)
    given = measure_ranges(spots(ideal(4), 4, noise_electrons=rms)).sigma_m
    assert np.nanmean(np.abs(away) > 3) < 0.02
    mean = np.sqrt(np.nanmean(np.square(sigmas), axis=0))
    np.testing.assert_allclose(mean, np.sqrt(2) * given, rtol=0.1)


def test_scatter_below_that_of_the_light_leaves_no_noise_of_the_electronics():
    ranges, quiet = (
        measure_ranges(spots(ideal(4), 4, noise_electrons=noise)) for noise in (np.nan, 0.0)
    )
    np.testing.assert_array_equal(ranges.sigma_m, quiet.sigma_m)


def test_unknown_noise_that_nothing_tells_is_refused():
    with pytest.raises(
        InputError, match=r"noise_electrons is unknown .* readings per frame, not 0"
    ):
        measure_ranges(spots(ideal(3), 3, noise_electrons=np.nan))


def test_next_to_the_wrap_a_range_is_ambiguous():
    """A target at 3 cm may as well be one at the end of the unambiguous range, and is called so."""
    wrap_m = c / FREQUENCY
    near_m = np.array([0.06, 0.06, wrap_m - 0.06, wrap_m / 2])
    phase = 2 * np.pi * FREQUENCY * near_m / c + 0.4
    mean = 5e4 + 1e4 * np.cos(phase[:, None] - 2 * np.pi * np.arange(4) / 4)
    rng = np.random.default_rng(3)
    for _ in range(100):
        noisy = mean + 100.0 * rng.standard_normal((4, 4))
        status = measure_ranges(spots(noisy, 4, noise_electrons=100.0)).status
        assert set(status[:3]) <= {"ambiguous", "too close"}
        assert status[3] == "ok"

"""CW time of flight: phase, range and its error bar for any taps, and what counts as valid."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.constants import c

from reconstruction.ranging import measure_ranges
from reconstruction.ranging.cw import demodulate
from reconstruction.ranging.geometry import range_from_path
from reconstruction.spots import CwSpots

FREQUENCY = 15e6
DIRECTIONS = np.array([[-0.2, -0.1, 1], [0.2, -0.1, 1], [-0.2, 0.1, 1], [0.2, 0.1, 1]])
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1)[:, None]
DETECTORS = np.array([[0.1, 0, 0], [-0.1, 0, 0.02], [0, 0.1, 0], [0, 0, 0]])
RANGES = np.array([1.5, 3.0, 5.0, 8.0])


def spots(electrons, taps, phase_offset=0.4, noise=0.0):
    """Spots of one frame with two electrons per count and an offset of 50 counts."""
    return CwSpots(
        taps=electrons[None] / 2 + 50,
        saturated=np.zeros((1, 4, taps), dtype=bool),
        directions=DIRECTIONS,
        detector_positions_m=DETECTORS,
        tap_frequencies_hz=np.full(taps, FREQUENCY),
        tap_phases_rad=2 * np.pi * np.arange(taps) / taps,
        phase_offsets_rad=np.full(taps, phase_offset),
        periods=1000,
        electrons_per_count=2.0,
        offset_counts=50.0,
        noise_electrons=noise,
        excess_noise_factor=1.0,
    )


def ideal(taps, phase_offset=0.4, amplitude=1e4, offset=5e4):
    path = RANGES + np.linalg.norm(RANGES[:, None] * DIRECTIONS - DETECTORS, axis=1)
    phase = 2 * np.pi * FREQUENCY * path / c + phase_offset
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
    phase, amplitude, offset, _ = demodulate(taps, np.ones(3), tap_phases)
    assert (phase, amplitude, offset) == pytest.approx((1.3, 2, 7))


def test_four_taps_reduce_to_the_arctangent_and_the_propagated_variance():
    rng = np.random.default_rng(0)
    taps, variance = rng.uniform(1, 9, (50, 4)), rng.uniform(1, 9, (50, 4))
    phase, amplitude, _, sigma = demodulate(taps, variance, np.arange(4) * np.pi / 2)
    expected = np.arctan2(taps[:, 1] - taps[:, 3], taps[:, 0] - taps[:, 2])
    assert np.allclose(phase, expected)
    opposite = np.sin(expected) ** 2 * (variance[:, 0] + variance[:, 2])
    quadrature = np.cos(expected) ** 2 * (variance[:, 1] + variance[:, 3])
    assert np.allclose(sigma**2, (opposite + quadrature) / (4 * amplitude**2))


def test_range_solves_the_triangle_and_its_slope_is_the_derivative():
    path = RANGES + np.linalg.norm(RANGES[:, None] * DIRECTIONS - DETECTORS, axis=1)
    range_m, slope = range_from_path(path, DIRECTIONS, DETECTORS)
    assert np.allclose(range_m, RANGES)
    step = 1e-6
    further, _ = range_from_path(path + step, DIRECTIONS, DETECTORS)
    assert np.allclose(slope, (further - range_m) / step, rtol=1e-4)


@pytest.mark.parametrize(("taps", "noise"), [(3, 0.0), (4, 150.0), (6, 300.0)])
def test_sigma_is_the_scatter_of_20000_trials(taps, noise):
    rng = np.random.default_rng(taps)
    trials = 20_000
    mean = ideal(taps)
    recorded = rng.poisson(mean, (trials, *mean.shape)) + rng.normal(
        0, noise, (trials, *mean.shape)
    )
    template = spots(mean, taps, noise=noise)
    measured = replace(
        template,
        taps=recorded / 2 + 50,
        saturated=np.zeros(recorded.shape, dtype=bool),
    )
    ranges = [measure_ranges(measured, frame) for frame in range(0, trials, 40)]
    sigma = np.median([r.sigma_m for r in ranges], axis=0)
    # all trials at once, through the function that does the work
    phase, _, _, _ = demodulate(recorded, np.ones(taps), template.tap_phases_rad)
    path = np.mod(phase - 0.4, 2 * np.pi) * c / (2 * np.pi * FREQUENCY)
    scatter = range_from_path(path, DIRECTIONS, DETECTORS)[0]
    chi_squared = (scatter.std(axis=0, ddof=1) / sigma) ** 2 * (trials - 1)
    z = (chi_squared - (trials - 1)) / np.sqrt(2 * (trials - 1))
    assert np.abs(z).max() < stats.norm.isf(0.0005 / 4) + 1  # sigma itself is estimated to 0.5 %
    bias = (scatter.mean(axis=0) - RANGES) / (sigma / np.sqrt(trials))
    assert np.abs(bias).max() < stats.norm.isf(0.0005 / 4)


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
    electrons = 5e4 + 1e4 * np.cos(phase[:, None] - np.arange(4) * np.pi / 2)
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


def test_unknown_electronics_noise_counts_shot_noise_only():
    known = measure_ranges(spots(ideal(4), 4, noise=0.0))
    unknown = measure_ranges(spots(ideal(4), 4, noise=np.nan))
    assert np.array_equal(known.sigma_m, unknown.sigma_m)

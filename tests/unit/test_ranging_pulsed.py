"""Pulsed time of flight: range and error bar from three windows, and pulses outside of them."""

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
from reconstruction.capture.readings.pulsed import PulsedSpots
from reconstruction.ranging import MIN_SIGNAL, measure_ranges
from reconstruction.ranging.methods.pulsed import second_window_fraction
from reconstruction.ranging.ranges import range_from_path

WIDTH_S = 65e-9  # ranges up to 9.7 m
STARTS_S = np.array([-70e-9, 3e-9, 68e-9])
DELAY_S = 4e-9


def windows(paths=PATHS, signal=2e4, background=3e3):
    """Electrons of a rectangular pulse in each window, by the overlap of the two."""
    arrival = np.asarray(paths)[:, None] / c + DELAY_S
    begin = np.maximum(arrival, STARTS_S)
    end = np.minimum(arrival + WIDTH_S, STARTS_S + WIDTH_S)
    return background + signal * np.maximum(end - begin, 0) / WIDTH_S


def spots(electrons, **changes):
    return PulsedSpots(
        **GEOMETRY,
        **(CHARGE | changes),
        taps=counts(electrons[None]),
        saturated=np.zeros((1, 4, 3), dtype=bool),
        window_starts_s=STARTS_S,
        pulse_width_s=WIDTH_S,
        pulses=1000,
        delay_offset_s=DELAY_S,
    )


def test_ranges_come_back_with_signal_and_background():
    ranges = measure_ranges(spots(windows()))
    assert ranges.status == ("ok",) * 4
    assert np.allclose(ranges.range_m, RANGES)
    assert np.allclose(ranges.signal_electrons, 2e4)
    assert np.allclose(ranges.background_electrons, 3e3)


@pytest.mark.parametrize(
    ("background", "noise", "excess"), [(0, 0.0, 1.0), (3e3, 200.0, 1.0), (3e3, 50.0, 5.5)]
)
def test_sigma_is_the_formula_and_the_scatter_of_20000_trials(background, noise, excess):
    signal = 1e5  # of which second-order bias is a hundredth of sigma or less
    mean = windows(signal=signal, background=background)
    expected = measure_ranges(
        spots(mean, noise_electrons=noise, excess_noise_factor=excess)
    ).sigma_m
    fraction = (PATHS / c + DELAY_S - STARTS_S[1]) / WIDTH_S
    steady = excess * background + noise**2
    spread = (1 - fraction) ** 2 + fraction**2 + (1 - 2 * fraction) ** 2
    variance = excess * fraction * (1 - fraction) / signal + steady * spread / signal**2
    slope = range_from_path(PATHS, DIRECTIONS, DETECTORS)[1]
    # A window without electrons is taken to have the noise of one.
    assert np.allclose(expected, slope * c * WIDTH_S * np.sqrt(variance), rtol=1e-3)

    trials = np.broadcast_to(mean, (20_000, 4, 3))
    recorded = charge(np.random.default_rng(1), trials, excess, noise)
    fractions, _, _ = second_window_fraction(recorded, recorded)
    paths = c * (STARTS_S[1] + fractions * WIDTH_S - DELAY_S)
    ranges, _ = range_from_path(paths, DIRECTIONS, DETECTORS)
    assert_scatter(ranges, RANGES, expected)


def test_a_pulse_that_may_lie_outside_of_the_windows_is_ambiguous():
    first_only, second_only = c * (STARTS_S[1] - DELAY_S), c * (STARTS_S[2] - DELAY_S)
    beyond = second_only + 0.5 * c * WIDTH_S
    electrons = windows([first_only, 5.0, second_only, beyond])
    status = measure_ranges(spots(electrons, noise_electrons=30.0)).status
    assert status == ("ambiguous", "ok", "ambiguous", "ambiguous")


def test_statuses_have_their_reasons():
    electrons = windows()
    electrons[1] = 3e3  # background only
    electrons[2] = 3e3 + np.array([0, 100, 100])  # half of its own noise, sqrt(6) * sqrt(3e3)
    near = windows([0.3] * 4)
    electrons[3] = near[3]
    measured = spots(electrons)
    measured.saturated[0, 0, 2] = True
    far_detectors = replace(measured, detector_positions_m=np.full((4, 3), 0.2))
    expected = ("saturated", "no signal", "no signal", "too close")
    assert measure_ranges(far_detectors).status == expected


def test_nothing_at_all_is_no_signal():
    assert measure_ranges(spots(np.zeros((4, 3)))).status == ("no signal",) * 4


@pytest.mark.parametrize(("times", "status"), [(0.97, "no signal"), (1.03, "ambiguous")])
def test_a_signal_is_one_beyond_the_noise_of_the_background_taken_off_twice(times, status):
    """It is the sum of two windows less twice the background: var = v1 + v2 + 4 v0."""
    noise = 1e4  # of the amplifier, beside which shot noise is nothing
    signal = times * MIN_SIGNAL * np.sqrt(6) * noise
    electrons = np.tile([0.0, signal / 2, signal / 2], (4, 1))
    assert measure_ranges(spots(electrons, noise_electrons=noise)).status == (status,) * 4

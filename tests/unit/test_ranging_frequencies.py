"""Several modulation frequencies: one path behind all phases, or the word that there is none."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from scipy.constants import c

from fourspots import CHARGE, GEOMETRY, PATHS, RANGES, assert_scatter, charge, counts
from reconstruction.capture.readings.cw import CwSpots
from reconstruction.ranging import measure_ranges
from reconstruction.ranging.unwrap import path_from_phases, unambiguous_path_m

FREQUENCIES = np.array([30e6, 40e6])  # alone, ranges repeat after 5.0 and 3.7 m
TAP_FREQUENCIES = np.array([40e6, 30e6, 40e6, 30e6, 40e6, 30e6, 40e6])
TAP_PHASES = np.array([0.0, 0.0, 1.5, 2.0, 3.1, 4.0, 4.8])
OFFSETS = np.where(TAP_FREQUENCIES == 30e6, 0.3, -0.8)


def spots(paths=(PATHS, PATHS)):
    """Taps with another amplitude and offset at each frequency; paths at 30 and 40 MHz."""
    first = TAP_FREQUENCIES == 30e6
    path = np.where(first, *(np.array(p)[:, None] for p in paths))
    phase = 2 * np.pi * TAP_FREQUENCIES * path / c + OFFSETS
    electrons = np.where(first, 4e4, 6e4) + np.where(first, 1e4, 8e3) * np.cos(phase - TAP_PHASES)
    return CwSpots(
        **GEOMETRY,
        **CHARGE | {"noise_electrons": np.zeros(7)},
        taps=counts(electrons[None]),
        saturated=np.zeros((1, 4, 7), dtype=bool),
        tap_frequencies_hz=TAP_FREQUENCIES,
        tap_phases_rad=TAP_PHASES,
        phase_offsets_rad=OFFSETS,
        periods=1000,
    )


def test_ranges_beyond_each_frequencys_own_are_resolved():
    ranges = measure_ranges(spots())
    assert ranges.status == ("ok",) * 4
    assert np.allclose(ranges.range_m, RANGES)
    assert np.allclose(ranges.signal_electrons, 8e3)  # of the first tap's frequency
    assert np.allclose(ranges.background_electrons, 6e4)


def test_sigma_is_the_scatter_of_20000_trials_none_of_which_wraps():
    exact = spots()
    trials = np.broadcast_to(exact.electrons(exact.taps), (20_000, 4, 7))
    noisy = charge(np.random.default_rng(0), trials, 1.0, 0.0)
    # The four spots of a frame are of one kind: so are many more.
    crowd = replace(
        exact,
        taps=counts(noisy.reshape(1, -1, 7)),
        saturated=np.zeros((1, 80_000, 7), dtype=bool),
        directions=np.tile(exact.directions, (20_000, 1)),
        detector_positions_m=np.tile(exact.detector_positions_m, (20_000, 1)),
    )
    ranges = measure_ranges(crowd)
    assert ranges.valid.all()
    assert_scatter(ranges.range_m.reshape(-1, 4), RANGES, measure_ranges(exact).sigma_m)


def test_the_combined_sigma_is_that_of_the_weighted_mean():
    phases = 2 * np.pi * FREQUENCIES[:, None] * 7.0 / c
    sigmas = np.array([[0.01], [0.03]])
    path, sigma, ambiguous = path_from_phases(phases, sigmas, FREQUENCIES)
    metres = sigmas[:, 0] * c / (2 * np.pi * FREQUENCIES)
    assert path == pytest.approx(7.0)
    assert sigma == pytest.approx((metres**-2).sum() ** -0.5)
    assert not ambiguous


def test_frequencies_that_contradict_each_other_are_told():
    """By half the step from one multiple to the next, as far as they can."""
    step = c / 40e6 - c / 30e6
    wrong = PATHS + np.array([0, step / 2, 0, 0.02])
    assert measure_ranges(spots((PATHS, wrong))).status == ("ok", "ambiguous", "ok", "ok")


def test_a_noisy_phase_makes_a_path_ambiguous_where_another_fits_nearly_as_well():
    phases = 2 * np.pi * FREQUENCIES[:, None] * 7.0 / c
    for sigma, ambiguous in ((0.1, False), (0.5, True)):
        result = path_from_phases(phases, np.full((2, 1), sigma), FREQUENCIES)
        assert result[2].tolist() == [ambiguous]


def test_one_weak_frequency_is_no_signal():
    weak = spots()
    weak.taps[0, 2, TAP_FREQUENCIES == 30e6] = counts(4e4)
    assert measure_ranges(weak).status == ("ok", "ok", "no signal", "ok")


@pytest.mark.parametrize(
    ("frequencies_mhz", "path_m"),
    [
        ([15], c / 15e6),
        ([1], c / 1e6),
        ([30, 40], c / 10e6),
        ([40, 30], c / 10e6),
        ([16, 20, 24], c / 4e6),
        ([40, 50, 63], c / 1e6),
        ([10, np.pi * 10], 22 * c / (np.pi * 10e6)),  # nearly, by Archimedes
        ([3, 3 * np.sqrt(2), 3 * np.sqrt(3), 3 * np.sqrt(5), 3 * np.sqrt(7)], 20_000.0),  # later
        ([20, 20.2], c / 20.2e6),  # indistinguishable from one
    ],
)
def test_the_unambiguous_path_follows_the_beat(frequencies_mhz, path_m):
    result = unambiguous_path_m(1e6 * np.array(frequencies_mhz))
    assert result == pytest.approx(path_m)


@pytest.mark.parametrize("frequencies_mhz", [[15], [30, 40], [16, 20, 24], [40, 50, 63]])
def test_every_path_below_it_is_found(frequencies_mhz):
    frequencies = 1e6 * np.array(frequencies_mhz, dtype=float)
    paths = np.linspace(0.01, 0.99, 500) * unambiguous_path_m(frequencies)
    phases = 2 * np.pi * frequencies[:, None] * paths / c
    result, _, ambiguous = path_from_phases(phases, np.full(phases.shape, 0.01), frequencies)
    assert np.allclose(result, paths)
    assert not ambiguous.any()


def test_many_wraps_of_many_pixels_fit_into_memory():
    """1000 wraps of 4096 pixels at three frequencies at once would take 100 MB an array."""
    frequencies = np.array([239.0e6, 240.0e6, 250.3e6])
    limit_m = unambiguous_path_m(frequencies)
    assert limit_m > 80
    paths = np.random.default_rng(0).uniform(0, limit_m, (64, 64))
    phases = 2 * np.pi * frequencies[:, None, None] * paths / c
    tracemalloc.start()
    result, sigma, ambiguous = path_from_phases(phases, np.full(phases.shape, 1e-3), frequencies)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 80e6
    assert result.shape == sigma.shape == ambiguous.shape == (64, 64)
    assert np.allclose(result, paths)
    assert not ambiguous.any()

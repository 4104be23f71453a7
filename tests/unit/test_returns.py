"""All pulses of a histogram: found, as sure as stated, with any response."""

from types import SimpleNamespace

import numpy as np
import pytest

from reconstruction.base.errors import InputError
from reconstruction.capture.importers import spots_from_histograms
from reconstruction.ranging import measure_ranges
from reconstruction.ranging.returns import _Fit, find_returns
from reconstruction.ranging.shape import gaussian_shape, sampled_shape, shape_of

BINS, CYCLES, TRIALS = 600, 10**6, 150
GAUSSIAN = gaussian_shape(12.0)
#: A sharp edge, a plateau and a tail.
SKEWED = sampled_shape(np.array([-20.0, -15, 10, 25, 90]), np.array([0, 1.0, 1.0, 0.1, 0]))


def pixel(rng, shape, delays, photons, background=1.0):
    """Histogram of so many photons of each pulse, and on average so many of the background."""
    fine = np.linspace(shape.first, shape.last, 2000)
    arrived = shape.arrived(fine)
    times = [
        delay + np.interp(rng.uniform(arrived[0], arrived[-1], photons), arrived, fine)
        for delay in delays
    ]
    times.append(rng.uniform(0, BINS, rng.poisson(background)))
    return np.bincount(np.concatenate(times).astype(int), minlength=BINS).astype(float)


@pytest.mark.parametrize("shape", [GAUSSIAN, SKEWED], ids=["gaussian", "skewed"])
@pytest.mark.parametrize("photons", [6, 25])
def test_two_surfaces_are_found_as_surely_as_stated(shape, photons):
    rng = np.random.default_rng([photons, int(shape.width)])
    errors, sigmas = [], []
    for _ in range(TRIALS):
        delays = 150 + rng.uniform(0, 1), 400 + rng.uniform(0, 1)
        returns, _ = find_returns(pixel(rng, shape, delays, photons), CYCLES, shape)
        for delay in delays:
            near = [each for each in returns if abs(each.delay - delay) < 60]
            errors += [near[0].delay - delay] if near else []
            sigmas += [near[0].sigma] if near else []
    assert len(errors) > 0.9 * 2 * TRIALS
    z = np.array(errors) / sigmas
    assert np.sqrt(np.mean(z**2)) == pytest.approx(1, abs=0.2)
    assert abs(np.mean(z)) < 3.5 / np.sqrt(z.size)


def test_the_error_of_a_gaussian_pulse_reaches_its_bound():
    rng, photons = np.random.default_rng(4), 20
    errors = []
    for _ in range(2 * TRIALS):
        returns, _ = find_returns(pixel(rng, GAUSSIAN, [200.5], photons, 0.0), CYCLES, GAUSSIAN)
        errors.append(returns[0].delay - 200.5)
    bound = 12.0 / np.sqrt(photons)
    assert np.std(errors) / bound == pytest.approx(1, abs=3.5 / np.sqrt(4 * TRIALS))


def test_the_brightest_pulse_has_its_delay_and_rate_before_any_fit():
    """Of expected counts, for light that is faint beside the background."""
    steady, rate, delay = 1e-3, 1e-5, 200.0
    fit = _Fit(np.zeros(BINS), np.full(BINS, float(CYCLES)), GAUSSIAN)
    mean = np.array([steady, rate]) @ fit.parts(np.array([delay]))
    expected = _Fit(-CYCLES * np.expm1(-mean), fit.watched, GAUSSIAN)
    assert expected._brightest(np.full(BINS, steady)) == pytest.approx((delay, rate), rel=0.01)


def test_noise_alone_is_no_pulse():
    rng = np.random.default_rng(5)
    found = [
        bool(find_returns(pixel(rng, GAUSSIAN, [], 0, 30.0), CYCLES, GAUSSIAN)[0])
        for _ in range(TRIALS)
    ]
    assert np.mean(found) < 0.03
    assert find_returns(np.zeros(BINS), CYCLES, GAUSSIAN)[0] == []


def test_a_strong_pulse_with_its_own_tail_is_one_pulse():
    counts = np.round(50_000 * SKEWED.in_bins(np.array(100.3), np.arange(BINS)) + 3)
    returns, background = find_returns(counts, 10**8, SKEWED)
    assert len(returns) == 1
    assert returns[0].delay == pytest.approx(100.3, abs=0.05)
    assert returns[0].arrivals * 10**8 == pytest.approx(50_000, rel=0.01)
    assert background * 10**8 == pytest.approx(3, rel=0.05)
    assert len(find_returns(counts, 10**8, gaussian_shape(14.0))[0]) > 1


def test_narrow_pulses_are_placed_within_bins_and_pile_up_is_undone():
    shape, cycles = gaussian_shape(0.8), 10**7
    mean = 0.7 * shape.in_bins(np.array(10.37), np.arange(40.0)) + 0.002
    reached = np.exp(-np.concatenate([[0], np.cumsum(mean)[:-1]]))
    counts = np.round(cycles * reached * -np.expm1(-mean))
    returns, _ = find_returns(counts, cycles, shape)
    assert returns[0].delay == pytest.approx(10.37, abs=0.02)
    assert returns[0].arrivals == pytest.approx(0.7, rel=0.02)


def test_the_method_lists_all_surfaces_by_their_light():
    rng = np.random.default_rng(6)
    counts = np.array([pixel(rng, GAUSSIAN, [100, 300], 40), pixel(rng, GAUSSIAN, [], 0, 3.0)])
    counts[0] += pixel(rng, GAUSSIAN, [300], 40)
    geometry = {"directions": [(0.0, 0.0, 1.0)] * 2}
    from reconstruction.capture.importers import SpotGeometry

    spots = spots_from_histograms(
        counts, 1e-10, CYCLES, response_sigma_s=12e-10, geometry=SpotGeometry(**geometry)
    )
    ranges = measure_ranges(spots, 0, "returns")
    assert ranges.status == ("ok", "no signal")
    far, near = ranges.alternatives[0]
    assert far.range_m == pytest.approx(ranges.range_m[0]) == pytest.approx(4.5, abs=0.2)
    assert near.range_m == pytest.approx(1.5, abs=0.2)
    assert far.weight == pytest.approx(2 / 3, abs=0.02)
    assert ranges.alternatives[1] == ()


def test_a_pulse_of_unknown_width_is_refused():
    spots = spots_from_histograms(np.ones((1, 4, BINS)), 1e-10, CYCLES)
    with pytest.raises(InputError, match=r"'returns' needs spots/response_sigma_s or"):
        measure_ranges(spots, 0, "returns")


def test_light_after_the_last_bin_is_not_in_it():
    shape = gaussian_shape(0.5)
    (inside,) = shape.in_bins(np.array([3.8]), np.arange(4.0))
    arrived = shape.arrived(np.arange(5) - 3.8)
    np.testing.assert_allclose(inside, np.diff(arrived))


def test_a_stated_response_is_the_shape_and_without_it_a_width():
    unknown = {
        "bin_width_s": 1e-9,
        "response": None,
        "response_s": None,
        "response_sigma_s": np.nan,
    }
    assert shape_of(SimpleNamespace(**unknown)) is None
    gaussian = shape_of(SimpleNamespace(**unknown | {"response_sigma_s": 3e-9}))
    assert gaussian.width == pytest.approx(3.0)
    times, rates = np.array([0.0, 5.0, 10.0]), np.array([0.0, 1.0, 0.0])
    measured = {"response": rates, "response_s": 1e-9 * times, "response_sigma_s": 3e-9}
    shape = shape_of(SimpleNamespace(**unknown | measured))
    np.testing.assert_allclose(shape.arrived(times), [0, 0.5, 1], atol=1e-3)

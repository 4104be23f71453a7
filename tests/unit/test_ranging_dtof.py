"""Direct time of flight: the Cramer-Rao bound is reached without bias, pile-up or not."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.constants import c
from scipy.stats import binomtest, norm

from fourspots import GEOMETRY, PATHS, RANGES, assert_scatter
from reconstruction.capture.readings.dtof import HistogramSpots
from reconstruction.ranging import measure_ranges
from reconstruction.ranging.histogram import coates, find_pulses

BINS = 120
DELAY, WIDTH = 50.3, 2.0
TRIALS = 20_000


def rates(delay, arrivals, background, width=WIDTH, bins=BINS):
    """Mean arrivals per bin of one cycle."""
    edges = np.arange(bins + 1)
    return arrivals * np.diff(norm.cdf(edges, delay, width)) + background


def reach(rate):
    """Probability that a cycle has had no arrival before each bin, and after the last."""
    return np.exp(-np.append(0, np.cumsum(rate)))


def record(rng, rate, cycles, trials):
    """Histograms of first arrivals, (trials, bins)."""
    alive = reach(rate)
    return rng.multinomial(cycles, np.append(alive[:-1] - alive[1:], alive[-1]), trials)[:, :-1]


def bound(arrivals, background, cycles, width=None):
    """Cramer-Rao bound of the delay with all else unknown, by finite differences.

    From the information that the probabilities p of the outcomes of one cycle hold,
    sum (dp / d theta)^2 / p.
    """

    def outcomes(theta):
        alive = reach(rates(*theta))
        return np.append(alive[:-1] - alive[1:], alive[-1])

    theta = np.array([DELAY, arrivals, background, WIDTH])
    steps = np.diag(1e-4 * theta)[: 4 if width is None else 3]
    slopes = [(outcomes(theta + h) - outcomes(theta - h)) / (2 * h.sum()) for h in steps]
    information = cycles * (slopes / outcomes(theta)) @ np.transpose(slopes)
    return np.sqrt(np.linalg.inv(information)[0, 0])


CASES = {
    "little background": (200, 0.02, 100_000),
    "background": (200, 3.0, 100_000),
    "5 % detections": (800, 35, 100_000),
    "pile-up, 50 % detections": (4000, 40, 14_000),
    "pile-up and few cycles": (400, 1.0, 800),
}


@pytest.mark.parametrize("width", [WIDTH, None], ids=["width known", "width fitted"])
@pytest.mark.parametrize("case", CASES)
def test_the_bound_is_reached_without_bias(case, width):
    signal, background, cycles = CASES[case]
    arrivals, background = signal / cycles, background / cycles
    rng = np.random.default_rng(list(CASES).index(case))
    trials = TRIALS if width else TRIALS // 4
    histograms = record(rng, rates(DELAY, arrivals, background), cycles, trials)
    pulses = find_pulses(histograms.astype(float), cycles, width)
    sigma = bound(arrivals, background, cycles, width)
    assert_scatter(pulses.delay, DELAY, sigma, bound=0.05)
    assert np.median(pulses.delay_sigma) == pytest.approx(sigma, rel=0.03)


def test_without_background_the_bound_is_the_width_over_the_root_of_the_arrivals():
    assert bound(0.001, 1e-12, 10**6, WIDTH) == pytest.approx(
        np.hypot(WIDTH, 12**-0.5) / np.sqrt(1000), rel=0.01
    )


def test_coates_recovers_the_rate_from_what_pile_up_leaves():
    rate = rates(DELAY, 0.8, 0.005)
    alive = reach(rate)
    expected_counts = 1e6 * (alive[:-1] - alive[1:])
    assert np.allclose(coates(expected_counts, 10**6)[0], rate)
    assert np.isfinite(coates(np.array([[3.0, 5.0, 2.0, 0.0]]), 10)[0]).all()


def test_strong_pile_up_would_bias_a_centroid_but_not_this():
    rate = rates(DELAY, 1.0, 0.0)
    alive = reach(rate)
    counts = 1e6 * (alive[:-1] - alive[1:])
    centroid = (np.arange(BINS) + 0.5) @ counts / counts.sum()
    assert centroid < DELAY - 0.2 * WIDTH
    assert find_pulses(counts[None], 10**6, WIDTH).delay[0] == pytest.approx(DELAY, abs=1e-3)


def spots(histograms, cycles, **changes):
    values = {
        "counts": histograms[None],
        "saturated": np.zeros((1, 4), dtype=bool),
        "bin_width_s": 1e-9,
        "start_s": 6e-9,
        "pulses": cycles,
        "response_sigma_s": 2e-9,
        "delay_offset_s": 2e-9,
    }
    return HistogramSpots(**GEOMETRY, **(values | changes))


def expected_histograms(paths=PATHS, arrivals=0.05, background=1e-4, cycles=10**6):
    delays = (np.asarray(paths) / c + 2e-9 - 6e-9) / 1e-9
    alive = np.array([reach(rates(delay, arrivals, background)) for delay in delays])
    return cycles * (alive[:, :-1] - alive[:, 1:])


@pytest.mark.parametrize("response", [2e-9, np.nan])
def test_ranges_come_back_with_signal_and_background(response):
    ranges = measure_ranges(spots(expected_histograms(), 10**6, response_sigma_s=response))
    assert ranges.status == ("ok",) * 4
    assert np.allclose(ranges.range_m, RANGES, atol=1e-4)
    assert np.allclose(ranges.signal_electrons, 5e4, rtol=1e-3)
    assert np.allclose(ranges.background_electrons, 100, rtol=0.01)
    assert (ranges.sigma_m < 0.01).all()


def test_statuses_have_their_reasons():
    end = c * (6e-9 - 2e-9 + BINS * 1e-9)
    histograms = expected_histograms([5.0, end + 0.3, 3.0, 3.0])
    histograms[2] = 100.0
    measured = replace(
        spots(histograms, 10**6), detector_positions_m=np.array([[0, 0, 0]] * 3 + [[9.0, 0, 0]])
    )
    assert measure_ranges(measured).status == ("ok", "ambiguous", "no signal", "too close")
    measured.saturated[0, 1] = True
    assert measure_ranges(measured).status[1] == "saturated"
    empty = spots(np.zeros((4, BINS), dtype=np.int32), 1000)
    assert measure_ranges(empty).status == ("no signal",) * 4


@pytest.mark.parametrize("background", [0.05, 20.0])
def test_noise_alone_is_rarely_taken_for_a_pulse(background):
    crowd = 4000
    histograms = np.random.default_rng(5).poisson(background, (crowd, BINS))
    noise = replace(
        spots(histograms, 10**6),
        saturated=np.zeros((1, crowd), dtype=bool),
        directions=np.tile(GEOMETRY["directions"], (crowd // 4, 1)),
        detector_positions_m=np.zeros((crowd, 3)),
    )
    seen = int((np.array(measure_ranges(noise).status) != "no signal").sum())
    assert binomtest(seen, crowd, norm.sf(3), alternative="greater").pvalue > 1e-3


def test_another_echo_far_from_the_pulse_does_not_disturb():
    fog = np.where(np.arange(BINS) < 25, 15.0, 1.0)
    mean = 1e6 * rates(DELAY, 300 / 1e6, 0.0) + fog
    histograms = np.random.default_rng(2).poisson(mean, (5000, BINS)).astype(float)
    pulses = find_pulses(histograms, 10**6, WIDTH)
    assert_scatter(pulses.delay, DELAY, bound(300 / 1e6, 1e-6, 10**6, WIDTH), bound=0.05)
    assert np.median(pulses.background) == pytest.approx(1e-6, rel=0.05)


def test_a_pulse_much_shorter_than_a_bin_is_known_to_the_bin():
    delays = np.arange(50.05, 51, 0.1)
    histograms = np.array([1e4 * rates(delay, 0.05, 1e-6, 0.02) for delay in delays])
    pulses = find_pulses(histograms, 10**4, 0.02)
    assert (np.abs(pulses.delay - 50.5) <= 0.5).all()
    assert all(b >= a - 1e-9 for a, b in pairwise(pulses.delay))
    assert (pulses.delay_sigma <= 12**-0.5 + 1e-3).all()


@pytest.mark.parametrize("width", [None, 0.01, 1.0, 100.0])
def test_odd_histograms_give_finite_numbers(width):
    cycles, bins = 1000, 12
    some = np.random.default_rng(4)
    fractions = some.dirichlet(np.full(bins + 1, 0.05), 200)
    histograms = some.multinomial(cycles, fractions)[:, :-1].astype(float)
    histograms[:bins] = cycles * np.eye(bins)  # every cycle in one bin
    histograms[bins : 2 * bins] = np.eye(bins)  # one arrival at all
    histograms[2 * bins] = 0
    pulses = find_pulses(histograms, cycles, width)
    for name, values in vars(pulses).items():
        assert np.isfinite(values).all(), name

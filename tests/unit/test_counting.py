"""Counts and time stamps of photon counters, against event-by-event simulation."""

import numpy as np
import pytest
from scipy.constants import c

from spisim.instrument import Apd, DirectTof, Spad, load_instrument

EXPOSURE_S = 60e-6


def sensor(**changes: float) -> Spad:
    fields = {"type": "spad", "photoactive_area_mm2": 5e-4, "detection_efficiency": 0.15}
    return Spad(**fields | {"dark_count_rate_hz": 0, "dead_time_s": 1e-6} | changes)


def events(
    mean: float, dead_s: float, trials: int, rng: np.random.Generator, afterpulse: float = 0.0
) -> np.ndarray:
    """Counts of a diode that is blind after each detection, one event after the other."""
    time = rng.exponential(EXPOSURE_S / mean, trials)
    counts = np.zeros(trials)
    while (time < EXPOSURE_S).any():
        counts += time < EXPOSURE_S
        follows = rng.random(trials) < afterpulse
        time += dead_s + np.where(follows, 0, rng.exponential(EXPOSURE_S / mean, trials))
    return counts


@pytest.mark.parametrize("mean", [0.5, 20.0, 300.0])
def test_dead_time_shapes_the_counts(mean: float) -> None:
    trials = 20_000
    drawn = sensor().draw_counts(np.full(trials, mean), EXPOSURE_S, np.random.default_rng(1))
    true = events(mean, 1e-6, trials, np.random.default_rng(2))
    for power in (1, 2):
        a, b = drawn.astype(float) ** power, true**power
        z = (a.mean() - b.mean()) / np.sqrt((a.var() + b.var()) / trials)
        assert abs(z) < 4


@pytest.mark.parametrize(
    ("probability", "load"), [(0.04, 5.0), (0.2, 1.0), (0.2, 5.0), (0.5, 20.0)]
)
def test_after_pulses_beyond_the_end_are_not_counted(probability: float, load: float) -> None:
    """Mean and variance at `load` photons per dead time."""
    trials, mean = 20_000, load * EXPOSURE_S / 1e-6
    diode = sensor(afterpulse_probability=probability)
    drawn = diode.draw_counts(np.full(trials, mean), EXPOSURE_S, np.random.default_rng(5))
    true = events(mean, 1e-6, trials, np.random.default_rng(6), probability)
    assert drawn.max() <= 60
    for a, b in ((drawn, true), ((drawn - true.mean()) ** 2, (true - true.mean()) ** 2)):
        assert abs(a.mean() - b.mean()) < 4 * np.sqrt((a.var() + b.var()) / trials)


def test_mean_counts_saturate_at_one_per_dead_time() -> None:
    diode = sensor()
    few, many = diode.expected_counts(np.array([1.0, 1e6]), EXPOSURE_S)
    assert few == pytest.approx(1 / (1 + 1 / 60))
    assert many == pytest.approx(60, rel=1e-3)


def test_after_pulses_add_their_share() -> None:
    diode = sensor(afterpulse_probability=0.2, dead_time_s=0)
    trials, mean = 40_000, 30.0
    drawn = diode.draw_counts(np.full(trials, mean), EXPOSURE_S, np.random.default_rng(3))
    # A geometric cascade of mean 1 / (1 - p) and excess noise 1 + p.
    assert abs(drawn.mean() - mean / 0.8) < 4 * drawn.std() / np.sqrt(trials)
    variance = 1.2 * mean / 0.8**2
    assert abs(drawn.var(ddof=1) / variance - 1) < 4 * np.sqrt(2 / trials) * 1.1
    assert diode.expected_counts(np.array(mean), EXPOSURE_S) == pytest.approx(mean / 0.8)


PATHS = np.arange(1001) * 0.02


def echo(path_m: float, rate: float) -> np.ndarray:
    histogram = np.zeros(PATHS.size)
    histogram[round(path_m / 0.02)] = rate
    return histogram


def test_first_photons_against_event_by_event(request: pytest.FixtureRequest) -> None:
    tof: DirectTof = load_instrument("spad").tof
    diode = tof.detector.sensor.model_copy(update={"afterpulse_probability": 0.0})
    tof = tof.model_copy(
        update={"detector": tof.detector.model_copy(update={"sensor": diode}), "bins": 400}
    )
    signal, background = 0.8, 0.05  # photons per pulse, and per nanosecond
    area_s = tof.pulse_sigma_s * np.sqrt(2 * np.pi)
    chances = tof.stamping.chances(PATHS, echo(6.0, signal / area_s), background * 1e9)

    rng, cycles = np.random.default_rng(4), 400_000
    arrivals = np.full(cycles, np.inf)
    seen = rng.poisson(signal, cycles)
    for number in range(1, seen.max() + 1):
        stamp = rng.normal(6.0 / c, tof.stamping.response_sigma_s, cycles)
        arrivals = np.where(seen >= number, np.minimum(arrivals, stamp), arrivals)
    first_background = rng.exponential(1e-9 / background, cycles)
    arrivals = np.minimum(arrivals, first_background)
    edges = np.arange(tof.bins + 1) * tof.bin_width_s
    counts = np.histogram(arrivals, edges)[0]
    expected = cycles * chances
    z = (counts - expected) / np.sqrt(np.maximum(expected * (1 - chances), 1))
    assert np.abs(z).max() < 5
    assert (z**2).mean() == pytest.approx(1, abs=4 * np.sqrt(2 / tof.bins))


@pytest.mark.parametrize(("signal", "background"), [(0.02, 0.02), (0.3, 0.3), (1.0, 2.0)])
@pytest.mark.parametrize("probability", [0.04, 0.5])
def test_after_pulses_of_histograms_against_event_by_event(
    signal: float, background: float, probability: float
) -> None:
    """Means of bins; the total's variance is (1 + r) / (1 - r) that of independent cycles.

    Cycles follow their last one with the correlation r, p times the probability of no photon.
    """
    tof: DirectTof = load_instrument("spad").tof
    diode = tof.detector.sensor.model_copy(update={"afterpulse_probability": probability})
    detector = tof.detector.model_copy(update={"sensor": diode})
    tof = tof.model_copy(update={"detector": detector, "bins": 500})
    area_s = tof.pulse_sigma_s * np.sqrt(2 * np.pi)
    chances = tof.stamping.chances(
        PATHS, echo(4.0, signal / area_s), background / tof.gate_s
    ).reshape(10, -1).sum(axis=1)  # fmt: skip

    rng, cycles, trials = np.random.default_rng(7), 200, 5000
    counts, detected = np.zeros((trials, 10)), np.zeros(trials, bool)
    for cycle in range(-20, cycles):
        seen = rng.random(trials) < -np.expm1(-signal)
        first = np.where(seen, 4.0 / c / tof.gate_s, np.inf)
        first = np.minimum(first, rng.exponential(1 / background, trials))
        trapped = detected & (rng.random(trials) < probability)
        first = np.where(trapped, np.minimum(first, rng.random(trials)), first)
        detected = first < 1
        if cycle >= 0:
            counts[detected, (10 * first[detected]).astype(int)] += 1
    error = counts.mean(axis=0) - cycles * chances
    assert (np.abs(error) < 4 * counts.std(axis=0) / np.sqrt(trials)).all()
    total, r = counts.sum(axis=1), probability * np.exp(-signal - background)
    independent = cycles * chances.sum() * (1 - chances.sum())
    ratio = total.var() / independent * (1 - r) / (1 + r)
    assert ratio == pytest.approx(1, abs=4 * np.sqrt(2 / trials) * 1.3)


def threshold_tof(**changes: float) -> DirectTof:
    tof = load_instrument("spad").tof
    detector = load_instrument("apd").tof.detector
    assert isinstance(detector.sensor, Apd)
    fast = detector.amplifier.model_copy(update={"bandwidth_hz": 1e9})
    detector = detector.model_copy(update={"amplifier": fast})
    update = {"detector": detector, "threshold_sigma": 6.0, "bin_width_s": 20e-12, "bins": 4000}
    return tof.model_copy(update=update | changes)


def test_threshold_stamps_the_middle_of_the_pulse_whatever_its_height() -> None:
    tof = threshold_tof()
    times = (np.arange(tof.bins) + 0.5) * tof.bin_width_s
    for rate in (3e13, 3e14):
        chances = tof.stamping.chances(PATHS, echo(8.0, rate), 1e9)
        assert chances.sum() == pytest.approx(1, abs=1e-3)
        assert times @ chances == pytest.approx(8.0 / c, abs=3e-12)


def test_threshold_jitter_is_noise_over_slope() -> None:
    tof = threshold_tof(threshold_sigma=30.0)
    rate = 3e13
    chances = tof.stamping.chances(PATHS, echo(8.0, rate), 0.0)
    times = (np.arange(tof.bins) + 0.5) * tof.bin_width_s
    spread = np.sqrt(chances @ (times - times @ chances) ** 2)
    amplifier, diode = tof.detector.amplifier, tof.detector.sensor
    sigma = np.hypot(tof.pulse_sigma_s, np.sqrt(np.log(2)) / (2 * np.pi * 1e9))
    peak = rate * tof.pulse_sigma_s / sigma
    floor = amplifier.noise_pa_per_sqrt_hz * 1e-12 / 1.602176634e-19 / diode.gain * np.sqrt(1e9)
    level = 30 * floor
    noise = np.sqrt(floor**2 + 2 * diode.excess_noise_factor * level * 1e9)
    slope = level * np.sqrt(2 * np.log(peak / level)) / sigma
    expected = np.hypot(noise / slope / np.sqrt(2), tof.bin_width_s / np.sqrt(12))
    assert spread == pytest.approx(expected, rel=0.05)


def test_echo_below_the_threshold_is_rarely_seen() -> None:
    chances = threshold_tof().stamping.chances(PATHS, echo(8.0, 1e9), 0.0)
    assert chances.sum() < 1e-3

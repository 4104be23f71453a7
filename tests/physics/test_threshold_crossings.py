"""Stamps of a threshold against draws of a pulse with band-limited noise, one after the other."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.constants import c

from spisim.instrument import DirectTof, load_instrument
from spisim.instrument.stamping.crossings import DRAWS as TABLE_DRAWS
from spisim.instrument.stamping.crossings import Shape, first_middles, lone_pulses
from spisim.instrument.stamping.threshold import Threshold
from spisim.simulation import simulate
from worlds import plane, scene

DRAWS = 20_000
#: Of the preset rangefinder-905, in multiples of the pulse behind the amplifier.
PRESET = Shape(0.8482, 0.5297)
SHOT = 0.633
HEIGHTS = [4.0, 5.0, 6.2, 6.5, 7.0, 9.0, 12.0, 20.0, 60.0]
#: Threshold, shot noise, and shape of the pulse: an amplifier from slow to fast.
OTHERS = [
    (5.0, 0.05, PRESET),
    (8.0, 0.633, PRESET),
    (6.0, 0.2, Shape(0.98, 0.199)),
    (8.0, 2.0, Shape(0.6, 0.8)),
    (5.0, 1.0, Shape(0.95, 0.3122)),
]


def drawn(
    shape: Shape, peak: float, threshold: float, shot: float, seed: int
) -> tuple[float, NDArray[np.float64]]:
    """Fraction with a stamp, and stamps: white noise on a grid, filtered, crossing by crossing."""
    rng, step = np.random.default_rng(seed), shape.step_s / 1.5
    reach = int(5 * shape.amplifier_s / step)
    kernel = np.exp(-((np.arange(-reach, reach + 1) * step / shape.amplifier_s) ** 2) / 2)
    kernel /= np.sqrt((kernel**2).sum())
    times = np.arange(-4.5 - reach * step, 4.5 + reach * step, step)
    before = peak / shape.peak_fraction * np.exp(-((times / shape.pulse_s) ** 2) / 2)
    mean = peak * np.exp(-(times**2) / 2)
    size = times.size + 2 * reach
    filtered = np.fft.rfft(kernel, size)
    stamps = []
    for _ in range(DRAWS // 1000):
        white = rng.standard_normal((1000, times.size)) * np.sqrt(1 + shot * before)
        noise = np.fft.irfft(np.fft.rfft(white, size) * filtered, size)
        path = (mean + noise[:, reach : reach + times.size])[:, reach:-reach]
        for values in path[(path > threshold).any(axis=1)]:
            above = values > threshold
            start = int(np.argmax(above))
            after = np.flatnonzero(~above[start:])
            stop = start + after[0] if after.size else above.size - 1
            stamps.append(times[reach] + step * (start + stop - 1) / 2)
    return len(stamps) / DRAWS, np.array(stamps)


def check(shape: Shape, peak: float, threshold: float, shot: float, seed: int) -> None:
    """Within 2 % detected and 5 % of the scatter, more where it is that of few stamps."""
    fraction, stamps = drawn(shape, peak, threshold, shot, seed)
    each = lone_pulses(shape, np.array(peak), threshold, np.array(shot))
    stamped, sigma = (float(value) for value in each)
    assert stamped == pytest.approx(fraction, abs=0.02)
    if stamps.size < 100:
        return
    kurtosis = np.mean((stamps - stamps.mean()) ** 4) / stamps.var() ** 2
    error = np.sqrt((kurtosis - 1) * (1 / stamps.size + 1 / (stamped * TABLE_DRAWS))) / 2
    assert sigma == pytest.approx(stamps.std(), rel=0.05 + 3 * max(error - 0.01, 0))


@pytest.mark.parametrize("peak", [4.0, 6.5, 9.0])
def test_of_the_preset_are_those_of_draws(peak: float) -> None:
    check(PRESET, peak, 6.0, SHOT, round(10 * peak))


@pytest.mark.parametrize("peak", [100.0, 1000.0, 5000.0])
def test_high_pulses_scatter_as_their_edges_are_steep(peak: float) -> None:
    times_s = np.arange(-4.5, 4.5, PRESET.step_s)
    current, noise = peak * np.exp(-(times_s**2) / 2), np.ones(times_s.size)
    middles_s, _ = first_middles(PRESET, times_s, current, noise, 6.0)
    _, sigma_s = lone_pulses(PRESET, np.array(peak), 6.0, np.array(0.0))
    assert sigma_s == pytest.approx(middles_s.std(), rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("peak", HEIGHTS)
def test_of_every_height_are_those_of_draws(peak: float) -> None:
    check(PRESET, peak, 6.0, SHOT, 1000 + round(10 * peak))


@pytest.mark.slow
@pytest.mark.parametrize(("threshold", "shot", "shape"), OTHERS)
def test_of_other_thresholds_and_amplifiers_are_those_of_draws(
    threshold: float, shot: float, shape: Shape
) -> None:
    for peak in HEIGHTS:
        check(shape, peak, threshold, shot, 2000 + round(10 * peak))


def rangefinder() -> tuple[DirectTof, Threshold, float]:
    """The preset, and the noise of its current, in primary electrons per second."""
    tof = load_instrument("rangefinder-905").tof
    assert isinstance(tof, DirectTof)
    stamping = tof.stamping
    assert isinstance(stamping, Threshold)
    amplifier = tof.detector.amplifier_noise_electrons(stamping.window_s)
    return tof, stamping, float(amplifier) / stamping.window_s


@pytest.mark.parametrize("peak", [4.0, 5.0, 6.2, 9.0, 20.0])
def test_histograms_and_budget_state_the_same(peak: float) -> None:
    tof, stamping, noise = rangefinder()
    path_m, length_m = 0.02 * np.arange(4001), 40.0
    rate = peak * noise / stamping.shape.peak_fraction
    echo = np.where(path_m == length_m, rate, 0.0)
    chances = stamping.chances(path_m, echo, 0.0)
    times = (np.arange(tof.bins) + 0.5) * tof.bin_width_s
    mean = chances @ times / chances.sum()
    sigma = np.sqrt(chances @ (times - mean) ** 2 / chances.sum())
    stated = stamping.sigma_s(np.array(length_m), np.array(rate), np.array(0.0))
    assert mean == pytest.approx(length_m / c, abs=0.03 * stamping.shape.sigma_s)
    assert stated == pytest.approx(sigma / np.sqrt(tof.pulses * chances.sum()), rel=0.02)


def test_a_fainter_echo_has_no_better_range() -> None:
    _, stamping, noise = rangefinder()
    rates = noise / stamping.shape.peak_fraction * np.geomspace(3, 200, 300)
    sigma_s = stamping.sigma_s(np.full(300, 40.0), rates, np.zeros(300))
    assert (np.diff(sigma_s) < 0.01 * sigma_s[1:]).all()


def test_a_darker_wall_ranges_worse() -> None:
    """At 43 m, about the threshold: fewer stamps, which scatter no less."""
    instrument = load_instrument("rangefinder-905")
    sums, scatters = [], []
    for reflectance in (0.014, 0.017, 0.020):
        wall = replace(scene(plane(43.0, reflectance)), wavelength_nm=905.0)
        capture = simulate(wall, instrument, light="surrogate", noise=False, seed=1).capture
        counts = np.asarray(capture.spots.counts[0, 0])
        times = np.arange(counts.size)
        mean = counts @ times / counts.sum()
        sums.append(counts.sum())
        scatters.append(np.sqrt(counts @ (times - mean) ** 2 / counts.sum()))
    assert sums == sorted(sums)
    np.testing.assert_allclose(scatters, np.mean(scatters), rtol=0.05)


@pytest.mark.parametrize("threshold", [3.0, 3.5])
def test_noise_alone_crosses_at_the_rate_of_rice(threshold: float) -> None:
    """No crossing within T of a stationary current: exp(-rate T), where crossings are rare."""
    shape = Shape(2e-9, 1.3e-9)
    times = np.arange(0, 60e-9, shape.step_s)
    stamps, draws = first_middles(shape, times, 0 * times, np.ones(times.size), threshold)
    rate = shape.zero_crossings_hz * np.exp(-(threshold**2) / 2)
    starts_above = 0.00135 if threshold == 3 else 0.00023
    expected = 1 - (1 - starts_above) * np.exp(-rate * times[-1])
    z = (stamps.size / draws - expected) / np.sqrt(expected * (1 - expected) / draws)
    assert abs(z) < 3


def test_a_rate_of_false_alarms_that_hides_echoes_is_named() -> None:
    tof, _, _ = rangefinder()
    low = tof.model_copy(update={"threshold_sigma": 2.5})
    assert "noise alone crosses it" in low.warnings(0.0, 0.0)[0]
    assert not tof.warnings(0.0, 0.0)


def test_a_threshold_below_the_noise_is_refused() -> None:
    fields = rangefinder()[0].model_dump()
    with pytest.raises(ValueError, match=r"threshold_sigma 0\.5 is below the rms noise"):
        DirectTof(**fields | {"threshold_sigma": 0.5})

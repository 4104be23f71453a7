"""Ranges of 20,000 simulated recordings scatter as the closed forms say, and around the truth.

The light is given, an echo from one range and a steady background; what is tested is the way from
there over detector and noise to the range.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.constants import c
from scipy.special import ndtr

from reconstruction.capture import Spots
from reconstruction.capture.schema import present_fields
from reconstruction.capture.spots import SpotOptics
from reconstruction.ranging import measure_ranges
from spisim.instrument import CwTof, Instrument, SpotLight, load_instrument

FRAMES = 5000  # of four spots each
PATHS = np.arange(1001) * 0.02
AHEAD = np.tile([0.0, 0.0, 1.0], (4, 1))
OPTICS = SpotOptics(directions=AHEAD, detector_positions_m=np.tile([1e-6, 0.0, 0.0], (4, 1)))
LASER_W = 1e-3


def with_tof(instrument: Instrument, **changes: object):
    """The ranging of an instrument, its photodiodes beside the lasers' exit."""
    tof = instrument.tof
    detector = tof.detector.model_copy(update={"positions_m": ((1e-6, 0.0, 0.0),) * 4})
    return tof.model_copy(update={"detector": detector} | changes)


def light(range_m: float, echo_per_s: float, steady_per_s: float, frames: int = FRAMES):
    histogram = np.zeros(PATHS.size)
    position = 2 * range_m / 0.02
    low = int(position)
    histogram[low : low + 2] = np.array([low + 1 - position, position - low]) * echo_per_s
    return SpotLight(
        PATHS,
        np.broadcast_to(histogram, (frames, 4, PATHS.size)),
        np.full((frames, 4), steady_per_s),
        LASER_W,
    )


def ranges_of(tof, given: SpotLight, seed: int = 7):
    spots = tof.record(given, OPTICS, np.random.default_rng(seed))
    result = measure_ranges(in_one_frame(spots))
    assert set(result.status) == {"ok"}
    return result.range_m, result.sigma_m


def in_one_frame(spots: Spots) -> Spots:
    """As if all frames had been recorded at once by four lasers each."""
    by_frame = [name for name, stored in present_fields(spots) if stored.by_frame]
    readings = {name: getattr(spots, name) for name in by_frame}
    frames = len(spots.readings)
    return replace(
        spots,
        **{name: array.reshape(1, -1, *array.shape[2:]) for name, array in readings.items()},
        directions=np.tile(spots.directions, (frames, 1)),
        detector_positions_m=np.tile(spots.detector_positions_m, (frames, 1)),
    )


def check(result: np.ndarray, true: float, sigma: float, within: float) -> None:
    mean_error = (result.mean() - true) / (result.std() / np.sqrt(result.size))
    assert abs(mean_error) < 3
    assert result.std(ddof=1) == pytest.approx(sigma, rel=within)


@cache
def preset(name: str) -> Instrument:
    return load_instrument(name)


@pytest.mark.parametrize("name", ["paper", "fga015", "apd"])
def test_four_phase(name: str) -> None:
    """σ_d = c / (4π f) · √(F (A_m + B) + σ_r²) / (√2 · contrast · A_m) (Lange & Seitz 2001)."""
    tof = with_tof(preset(name))
    frequency = tof.modulation.frequencies_hz[0]
    echo, steady, range_m = 2e10, 8e10, 4.21
    result, stated = ranges_of(tof, light(range_m, echo, steady))
    detector, time_s = tof.detector, tof.tap_time_s(frequency)
    contrast = tof.modulation.demodulation_contrast(frequency, detector.amplifier.response)
    noise = detector.electronics_noise_electrons(time_s)
    signal, background = echo * time_s, steady * time_s
    variance = detector.sensor.excess_noise_factor * (signal + background) + noise**2
    sigma = c / (4 * np.pi * frequency) * np.sqrt(variance / 2) / (contrast * signal)
    check(result, range_m, sigma, 0.03)
    assert stated.mean() == pytest.approx(sigma, rel=0.03)


def test_equation_3_of_the_paper() -> None:
    """σ = d_max / A_R · √((A_R + 2 B) / N) / (2π F(x)), A_R of a period at the light's peak."""
    tof = with_tof(preset("paper"))
    silent = tof.detector.amplifier.model_copy(update={"noise_pa_per_sqrt_hz": 0.0})
    fine = tof.detector.adc.model_copy(update={"full_scale_electrons": 1e7})
    detector = tof.detector.model_copy(update={"amplifier": silent, "adc": fine})
    tof = tof.model_copy(update={"detector": detector, "periods": 10_000})
    period_s = 1 / tof.modulation.frequencies_hz[0]
    peak, background, range_m = 800.0, 500.0, 3.0  # electrons per period
    result, _ = ranges_of(tof, light(range_m, peak / 2 / period_s, background / period_s))
    width = tof.modulation.taps.width
    shape = np.sqrt(width) * np.sinc(width)
    sigma = 10 / peak * np.sqrt((peak + 2 * background) / 10_000) / (2 * np.pi * shape)
    check(result, range_m, sigma, 0.03)


def test_two_frequencies_range_beyond_the_ambiguity_of_either() -> None:
    tof: CwTof = with_tof(preset("paper"))
    modulation = tof.modulation.model_copy(update={"frequencies_hz": (c / 14, c / 10)})
    tof = tof.model_copy(update={"modulation": modulation})
    result, stated = ranges_of(tof, light(8.4, 2e10, 8e10, 200))
    z = (result - 8.4) / stated
    assert abs(z.mean()) < 4 / np.sqrt(z.size)
    assert abs((z**2).mean() - 1) < 4 * np.sqrt(2 / z.size)


def test_two_frequencies_weigh_by_their_precision() -> None:
    """1/σ² adds up over frequencies, each with the noise of its own window."""
    tof: CwTof = with_tof(preset("paper"))
    modulation = tof.modulation.model_copy(update={"frequencies_hz": (5e6, 20e6)})
    tof = tof.model_copy(update={"modulation": modulation})
    echo, steady, range_m = 2e10, 8e10, 4.21
    result, stated = ranges_of(tof, light(range_m, echo, steady))
    precision = 0.0
    for frequency in modulation.frequencies_hz:
        time_s = tof.tap_time_s(frequency)
        contrast = modulation.demodulation_contrast(frequency, tof.detector.amplifier.response)
        noise = tof.detector.electronics_noise_electrons(time_s)
        variance = (echo + steady) * time_s + noise**2
        sigma = c / (4 * np.pi * frequency) * np.sqrt(variance / 2) / (contrast * echo * time_s)
        precision += 1 / sigma**2
    check(result, range_m, precision**-0.5, 0.03)
    assert stated.mean() == pytest.approx(precision**-0.5, rel=0.03)


@pytest.mark.parametrize("pair", [("sine", "rectangular"), ("square", "rectangular")])
def test_wiggling_of_square_waves(pair: tuple[str, str]) -> None:
    tof: CwTof = with_tof(preset("paper"))
    taps = tof.modulation.taps.model_copy(update={"shape": pair[1], "width": 0.5})
    modulation = tof.modulation.model_copy(update={"light": pair[0], "taps": taps})
    tof = tof.model_copy(update={"modulation": modulation})
    errors = []
    for range_m in np.arange(0.625, 9.5, 0.3125):
        spots = tof.record(light(range_m, 2e10, 8e10, 1), OPTICS, None)
        errors.append(measure_ranges(spots).range_m[0] - range_m)
    largest = np.abs(errors).max()
    if pair[0] == "sine":
        assert largest < 1e-3  # the grid of path lengths
    else:
        assert largest == pytest.approx(0.113, abs=2e-3)


@pytest.mark.parametrize("name", ["hybrid", "apd"])
def test_pulses_in_two_windows(name: str) -> None:
    """var(d) = (c T/2)² [r(1-r)/s + v((1-r)² + r² + (1-2r)²)/s²], shot noise times F."""
    hybrid, detector = with_tof(preset("hybrid")), with_tof(preset(name)).detector
    amplifier = detector.amplifier.model_copy(update={"bandwidth_hz": None})
    detector = detector.model_copy(update={"amplifier": amplifier})
    tof = hybrid.model_copy(update={"detector": detector, "rise_time_s": 0.0})
    echo, steady, range_m = 8e11, 8e10, 4.21
    given = light(range_m, echo, steady)
    result, stated = ranges_of(tof, given)
    time_s = tof.pulses * tof.pulse_width_s
    fraction = 2 * range_m / c / tof.pulse_width_s
    signal, excess = echo * time_s, detector.sensor.excess_noise_factor
    window = excess * steady * time_s + detector.electronics_noise_electrons(time_s) ** 2
    weight = (1 - fraction) ** 2 + fraction**2 + (1 - 2 * fraction) ** 2
    variance = excess * fraction * (1 - fraction) / signal + window * weight / signal**2
    sigma = c * tof.pulse_width_s / 2 * np.sqrt(variance)
    check(result, range_m, sigma, 0.03)
    assert stated.mean() == pytest.approx(sigma, rel=0.03)


def test_slow_pulses_and_amplifiers_keep_the_range_between_the_ends() -> None:
    tof = with_tof(preset("hybrid"), rise_time_s=5e-9)
    amplifier = tof.detector.amplifier.model_copy(update={"bandwidth_hz": 100e6})
    detector = tof.detector.model_copy(update={"amplifier": amplifier})
    tof = tof.model_copy(update={"detector": detector})
    for range_m in (1.0, 5.0, 8.0):
        spots = tof.record(light(range_m, 8e11, 0.0, 1), OPTICS, None)
        assert measure_ranges(spots).range_m[0] == pytest.approx(range_m, abs=1e-3)


def test_windows_collect_every_electron_of_the_pulse() -> None:
    tof = with_tof(preset("hybrid"))
    windows = tof.window_electrons(light(4.0, 1e12, 0.0, 1))[0, 0]
    assert windows[0] == pytest.approx(0, abs=1e-6)
    assert windows.sum() == pytest.approx(1e12 * tof.pulses * tof.pulse_width_s, rel=1e-6)


@pytest.mark.parametrize("frames", [500, pytest.param(FRAMES, marks=pytest.mark.slow)])
@pytest.mark.parametrize(("signal", "background"), [(0.04, 1e5), (0.04, 2e6), (0.7, 1e6)])
def test_single_photons_reach_the_cramer_rao_bound(
    signal: float, background: float, frames: int
) -> None:
    """1/σ_t² = Σ n_i λ'_i² / (e^{λ_i} - 1), first photons of a cycle, in bins of the gate."""
    spad = with_tof(preset("spad"))
    clean = spad.detector.sensor.model_copy(update={"afterpulse_probability": 0.0})
    tof = spad.model_copy(
        update={"detector": spad.detector.model_copy(update={"sensor": clean}), "bins": 600}
    )
    area_s = tof.pulse_sigma_s * np.sqrt(2 * np.pi)
    range_m = 4.21
    result, stated = ranges_of(tof, light(range_m, signal / area_s, background, frames))

    def rates(delay_s: float) -> np.ndarray:
        edges = (
            np.arange(tof.bins + 1) * tof.bin_width_s - delay_s
        ) / tof.stamping.response_sigma_s
        return signal * np.diff(ndtr(edges)) + background * tof.bin_width_s

    delay_s, step = 2 * range_m / c, 1e-13
    mean = rates(delay_s)
    slope = (rates(delay_s + step) - rates(delay_s - step)) / (2 * step)
    watched = tof.pulses * np.exp(-np.concatenate([[0.0], np.cumsum(mean)[:-1]]))
    information = (watched * slope**2 / np.expm1(mean)).sum()
    sigma = c / 2 / np.sqrt(information)
    check(result, range_m, sigma, 0.10)
    assert stated.mean() == pytest.approx(sigma, rel=0.10)


@pytest.mark.parametrize("frames", [200, pytest.param(FRAMES, marks=pytest.mark.slow)])
def test_crossings_of_a_threshold_scatter_as_noise_over_slope(frames: int) -> None:
    """σ = c/2 · σ_edge / √2 / √N; the middle of the edges hardly walks.

    A stay above the threshold begins with the first rise and ends with the first fall, so that
    noise makes both early: by less than a tenth of what 400 pulses scatter.
    """
    spad, apd = with_tof(preset("spad")), with_tof(preset("apd"))
    fast = apd.detector.amplifier.model_copy(update={"bandwidth_hz": 1e9})
    changes = {"threshold_sigma": 6.0, "bin_width_s": 20e-12, "bins": 1600, "pulses": 400}
    detector = apd.detector.model_copy(update={"amplifier": fast})
    tof = spad.model_copy(update={"detector": detector} | changes)
    range_m, peak = 4.21, 2e12
    result, stated = ranges_of(tof, light(range_m, peak, 0.0, frames))
    sigma_s = np.hypot(tof.pulse_sigma_s, np.sqrt(np.log(2)) / (2 * np.pi * 1e9))
    height = peak * tof.pulse_sigma_s / sigma_s
    floor = detector.amplifier_noise_electrons(1.0) * np.sqrt(2e9)
    level = 6 * floor
    noise = np.sqrt(floor**2 + 2 * detector.sensor.excess_noise_factor * level * 1e9)
    edge = noise * sigma_s / (level * np.sqrt(2 * np.log(height / level)))
    # A stamp is rounded to a bin.
    per_stamp = np.sqrt(edge**2 / 2 + tof.bin_width_s**2 / 12)
    sigma = c / 2 * per_stamp / np.sqrt(tof.pulses)
    walk, error = result.mean() - range_m, result.std() / np.sqrt(result.size)
    assert -0.1 * sigma - 3 * error < walk < 3 * error
    assert result.std() == pytest.approx(sigma, rel=0.10)
    assert stated.mean() == pytest.approx(sigma, rel=0.10)


def test_too_much_sun_is_flagged() -> None:
    """At 600 million background counts per second no photon of the laser comes first."""
    spad = with_tof(preset("spad"))
    area_s = spad.pulse_sigma_s * np.sqrt(2 * np.pi)
    given = light(4.0, 0.1 / area_s, 6e8, 1)
    spots = spad.record(given, OPTICS, np.random.default_rng(0))
    assert spots.saturated.all()
    assert measure_ranges(spots).status == ("saturated",) * 4


def test_taps_of_several_frequencies_stand_one_after_the_other() -> None:
    tof: CwTof = with_tof(preset("paper"))
    given = light(3.0, 1e10, 0.0, 1)
    modulation = tof.modulation.model_copy(update={"frequencies_hz": (10e6, 15e6)})
    tof = tof.model_copy(update={"modulation": modulation})
    spots = tof.record(given, OPTICS, None)
    epc, offset = spots.electrons_per_count, spots.offset_counts
    for number, frequency in enumerate((10e6, 15e6)):
        part = (spots.taps[..., 4 * number : 4 * number + 4] - offset) * epc
        np.testing.assert_allclose(part, tof.tap_electrons(given, frequency), rtol=1e-9)
        assert (spots.tap_frequencies_hz[4 * number : 4 * number + 4] == frequency).all()

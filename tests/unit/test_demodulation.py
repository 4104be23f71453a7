"""Taps of modulated light: closed forms, brute-force correlation, wiggling."""

import numpy as np
import pytest
from scipy.constants import c

from spisim.instrument import Amplifier, Modulation, Taps

IDEAL = Amplifier(noise_pa_per_sqrt_hz=0).response
FREQUENCY_HZ = c / 20


def modulation(light: str, shape: str = "rectangular", width: float = 0.5) -> Modulation:
    taps = Taps(shape=shape, width=width)
    return Modulation(frequencies_hz=(FREQUENCY_HZ,), light=light, contrast=0.8, taps=taps)


def four_phase(taps: np.ndarray) -> np.ndarray:
    return np.arctan2(taps[1] - taps[3], taps[0] - taps[2]) % (2 * np.pi)


@pytest.mark.parametrize("light", ["sine", "square"])
@pytest.mark.parametrize(("shape", "width"), [("rectangular", 0.25), ("sine", 0.25)])
def test_correlation_against_brute_force(light: str, shape: str, width: float) -> None:
    tested = modulation(light, shape, width)
    time = (np.arange(20_000) + 0.5) / 20_000 * 2 * np.pi
    cosine = np.cos(time)
    power = 1 + 0.8 * (np.sign(cosine) if light == "square" else cosine)
    steps = np.arange(0, 20_000, 625)
    phases = steps / 20_000 * 2 * np.pi
    for tap, angle in enumerate(tested.taps.phases_rad):
        moved = (time - angle + np.pi) % (2 * np.pi) - np.pi
        sine = (1 + np.cos(moved)) / 2
        window = np.abs(moved) < np.pi * width if shape == "rectangular" else sine
        delayed = [np.roll(power, step) for step in steps]
        expected = [np.mean(wave * window) for wave in delayed]
        result = tested.correlation(phases, FREQUENCY_HZ, IDEAL)[tap]
        np.testing.assert_allclose(result, expected, atol=2e-3 * tested.taps.fraction)


def test_square_light_and_windows_wiggle_by_11_cm_on_10_m() -> None:
    phases = np.linspace(0, 2 * np.pi, 721)
    result = four_phase(modulation("square").correlation(phases, FREQUENCY_HZ, IDEAL))
    error = (result - phases + np.pi) % (2 * np.pi) - np.pi
    assert np.degrees(np.abs(error).max()) == pytest.approx(4.07, abs=0.02)
    assert np.abs(error).max() / (2 * np.pi) * 10 == pytest.approx(0.113, abs=5e-4)
    worst = np.degrees(phases[np.abs(error).argmax()]) % 45
    assert worst == pytest.approx(22.5, abs=1)


@pytest.mark.parametrize("pair", [("sine", "rectangular"), ("square", "sine")])
def test_one_sine_is_enough_to_end_the_wiggling(pair: tuple[str, str]) -> None:
    phases = np.linspace(0.01, 2 * np.pi - 0.01, 100)
    result = four_phase(modulation(*pair).correlation(phases, FREQUENCY_HZ, IDEAL))
    np.testing.assert_allclose(result, phases, atol=1e-9)


def test_amplifier_delays_and_weakens_as_one_pole() -> None:
    response = Amplifier(noise_pa_per_sqrt_hz=0, bandwidth_hz=FREQUENCY_HZ).response
    tested = modulation("sine")
    assert tested.phase_offset_rad(FREQUENCY_HZ, response) == pytest.approx(np.pi / 4)
    ideal = tested.demodulation_contrast(FREQUENCY_HZ, IDEAL)
    weak = tested.demodulation_contrast(FREQUENCY_HZ, response)
    assert weak == pytest.approx(ideal / np.sqrt(2))
    late = tested.correlation(np.array([1.0]), FREQUENCY_HZ, response)[:, 0]
    assert four_phase(late) == pytest.approx(1 + np.pi / 4)


def test_faint_modulation_is_modulation() -> None:
    faint = Modulation(frequencies_hz=(FREQUENCY_HZ,), contrast=1e-9)
    full = Modulation(frequencies_hz=(FREQUENCY_HZ,))
    expected = 1e-9 * full.demodulation_contrast(FREQUENCY_HZ, IDEAL)
    assert faint.demodulation_contrast(FREQUENCY_HZ, IDEAL) == pytest.approx(expected)

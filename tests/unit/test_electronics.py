"""The converter's input: photo-electrons of any mean, from none to far beyond the full scale."""

import numpy as np
import pytest
from scipy.signal import lfilter

from spisim.instrument import Amplifier, load_instrument
from spisim.instrument.photodiode import LARGE_MEAN
from spisim.simulation.measurement.electronics import carried_over, slow_part, with_carry_over

DETECTOR = load_instrument("paper").detector


def counts(mean, frames=1, detector=DETECTOR):
    rng = np.random.default_rng(0)
    means = np.repeat(np.atleast_2d(np.asarray(mean, float)), frames, axis=0)
    return detector.read(means, 0.0, rng)


@pytest.mark.parametrize("mean", [1e13, 1e19, 1e30, 1e200])
def test_more_light_than_can_be_drawn_just_saturates(mean: float) -> None:
    readings = counts(mean)
    assert readings.saturated.all()
    assert (readings.counts == DETECTOR.adc.max_count).all()


def test_both_sides_of_the_limit_scatter_as_the_square_root() -> None:
    adc = DETECTOR.adc.model_copy(update={"bits": 31, "full_scale_electrons": 2.0**41})
    detector = DETECTOR.model_copy(update={"adc": adc})
    mean = LARGE_MEAN * np.array([0.999, 1.001])
    readings = counts(mean, 4000, detector)
    electrons = (readings.counts - adc.offset_counts) * adc.electrons_per_count
    z = (electrons.mean(axis=0) - mean) / np.sqrt(mean / 4000)
    assert np.abs(z).max() < 4
    ratio = electrons.var(axis=0, ddof=1) / mean
    assert np.abs(ratio - 1).max() < 4 * np.sqrt(2 / 3999)


def test_darkness_gives_the_offset() -> None:
    assert counts(0.0).counts.tolist() == [[DETECTOR.adc.offset_counts]]


def test_large_means_do_not_change_the_draw_of_the_others() -> None:
    alone, beside = counts([1e5, 2e5, 0]), counts([1e5, 2e5, 1e15])
    assert alone.counts[0, :2].tolist() == beside.counts[0, :2].tolist()


def test_avalanche_noise() -> None:
    """Variance F N, against the PIN's N, z-tested."""
    detector = load_instrument("apd").detector
    mean, frames = 1e6, 20_000
    readings = counts(mean, frames, detector)
    electrons = (readings.counts - detector.adc.offset_counts) * detector.adc.electrons_per_count
    noise = detector.sensor.excess_noise_factor * mean
    noise += detector.adc.quantisation_noise_electrons**2
    assert abs(electrons.mean() - mean) < 4 * np.sqrt(noise / frames)
    assert abs(electrons.var(ddof=1) / noise - 1) < 4 * np.sqrt(2 / frames)


def test_ac_coupling_takes_off_what_lasts() -> None:
    amplifier = Amplifier(noise_pa_per_sqrt_hz=0, coupling="ac", low_cut_hz=100)
    period_s = 1e-4
    steady = np.full((3, 50), 7.0)
    np.testing.assert_allclose(slow_part(steady, amplifier, period_s)[0], 7.0)
    step = np.zeros((1, 200))
    step[0, 100:] = 1.0
    taken_off = slow_part(step, amplifier, period_s)[0][0]
    forgets = np.exp(-2 * np.pi * amplifier.low_cut_hz * period_s * np.arange(200))
    np.testing.assert_allclose(taken_off[:100], 0.5 * forgets[:100], atol=1e-12)
    expected = 0.5 * forgets[100:] + 1 - forgets[:100]
    np.testing.assert_allclose(taken_off[100:], expected, atol=1e-12)


def test_dc_coupling_takes_off_nothing() -> None:
    assert not slow_part(np.ones((2, 3)), Amplifier(noise_pa_per_sqrt_hz=0), 1e-4)[0].any()


@pytest.mark.parametrize("poles", [(3e-6, 1e-6), (2e-6, 0.0), (2e-6, 2e-6), (0.0, 0.0)])
def test_a_reading_keeps_a_share_of_the_pattern_before(poles: tuple[float, float]) -> None:
    """Against the numerically filtered step."""
    period_s, exposure_s = 40e-6, 30e-6
    time = np.linspace(0, period_s, 400_001)
    wave = np.ones_like(time)
    step = time[1]
    for pole in poles:
        if pole > 0:
            decay = np.exp(-step / pole)
            wave = lfilter([(1 - decay) / 2, (1 - decay) / 2], [1, -decay], wave)
    lacking = 1 - wave[time >= period_s - exposure_s].mean()
    fraction = carried_over(poles, exposure_s, period_s)
    assert fraction == pytest.approx(lacking, abs=2e-6)


def test_carried_over_light_is_not_lost() -> None:
    readings = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    mixed = with_carry_over(readings, 0.1)
    assert mixed.sum() == pytest.approx(readings.sum())
    assert mixed[0].tolist() == pytest.approx([1.5, 1.9, 2.9])


def test_frames_one_by_one_remember_as_a_recording_does():
    """The level of an AC-coupled amplifier, and the last exposure."""
    amplifier = Amplifier(noise_pa_per_sqrt_hz=0, coupling="ac", low_cut_hz=50.0)
    readings = np.random.default_rng(3).random((3, 40)) * 1e4
    level = readings[0].mean()
    whole, last = slow_part(readings, amplifier, 1e-4)
    mixed = with_carry_over(readings, 0.1, readings[0, -1])
    before = float(readings[0, -1])
    for frame, expected, expected_mix in zip(readings, whole, mixed, strict=True):
        taken_off, level = slow_part(frame[None], amplifier, 1e-4, level)
        np.testing.assert_allclose(taken_off[0], expected)
        np.testing.assert_allclose(with_carry_over(frame[None], 0.1, before)[0], expected_mix)
        before = float(frame[-1])
    assert level == pytest.approx(last)

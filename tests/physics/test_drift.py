"""1/f noise and drift of amplifiers: their spectrum, and what pairs of patterns take off."""

from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.constants import elementary_charge

from instruments import changed
from reconstruction.image import image_method
from reconstruction.image.imaging import CompiledPlan
from reconstruction.operators import expose
from spisim.budget import Target, bucket_link, bucket_noise
from spisim.instrument import Amplifier
from spisim.instrument.flicker import flicker_electrons
from spisim.simulation.measurement import BucketLight
from spisim.simulation.measurement.buckets import record_buckets
from spisim.simulation.measurement.electronics import drifting_current_a

PERIOD_S, EXPOSURE_S, EXPOSURES, TRIALS = 1 / 15e3, 60e-6, 128, 1000


def expected(
    lag: int, corner_hz: float, exposure_s: float = EXPOSURE_S, low_cut_hz: float = 0.0
) -> float:
    """Variance of the difference of two exposures: ∫ S(f) sinc²(f T) 4 sin²(π f lag P) df, A²."""
    log_f = np.linspace(np.log(0.1), np.log(20 / PERIOD_S), 100_001)
    f = np.exp(log_f)
    passed = 1 / (1 + (low_cut_hz / f) ** 2)
    power = passed * np.sinc(f * exposure_s) ** 2 * 4 * np.sin(np.pi * f * lag * PERIOD_S) ** 2
    return float(1e-24 * corner_hz * np.trapezoid(power, log_f))


@pytest.mark.parametrize("lag", [1, 8, 64, 127])
@pytest.mark.parametrize("low_cut_hz", [None, 200.0])
def test_differences_have_the_variance_of_a_1_over_f_spectrum(
    lag: int, low_cut_hz: float | None
) -> None:
    coupling: Any = {"coupling": "ac", "low_cut_hz": low_cut_hz} if low_cut_hz else {}
    amplifier = Amplifier(noise_pa_per_sqrt_hz=1, corner_hz=1e3, **coupling)
    rng = np.random.default_rng(lag)
    squares = []
    for _ in range(TRIALS):
        current = drifting_current_a(amplifier, EXPOSURES, PERIOD_S, EXPOSURE_S, rng)
        squares.append(np.mean((current[lag:] - current[:-lag]) ** 2))
    difference = np.mean(squares) - expected(lag, 1e3, low_cut_hz=low_cut_hz or 0.0)
    assert abs(difference) < 4 * np.std(squares) / TRIALS**0.5


def recorded(exposures: int, trials: int, **amplifier: float) -> Any:
    """Dark readings (trials, exposures) in electrons, each of a recording of its own."""
    electronics = {"noise_pa_per_sqrt_hz": 20.0} | amplifier
    adc = {"bits": 24, "full_scale_electrons": 1e8, "offset_counts": 2**23}
    plan = {"patterns": exposures - 1, "order": "sequency-2d", "polarity": "single-ended"}
    paper = changed("paper", plan=plan, detector__amplifier=electronics, detector__adc=adc)
    rng, dark = np.random.default_rng(9), np.zeros((1, exposures))
    light = BucketLight(np.zeros((1, 64, 64)), np.zeros((1, 64, 64)), dark, dark, None)
    return paper, np.array([record_buckets(paper, light, rng)[0].signal[0] for _ in range(trials)])


def test_pairs_beat_single_ended_patterns_by_their_closed_forms() -> None:
    """Readings less their neighbours', against readings less that of the dark exposure."""
    paper, dark = recorded(EXPOSURES, TRIALS, corner_hz=2e3)
    white = 2 * float(paper.detector.electronics_noise_electrons(paper.exposure_time_s)) ** 2
    assert paper.exposure_time_s == pytest.approx(PERIOD_S)
    scale = (20 * PERIOD_S / elementary_charge) ** 2

    def closed(lag: int) -> float:
        return white + scale * expected(lag, 2e3, PERIOD_S)

    pairs = np.mean((dark[:, 1::2] - dark[:, ::2]) ** 2, axis=1)
    single = np.mean((dark[:, 1:] - dark[:, :1]) ** 2, axis=1)
    all_lags = np.mean([closed(lag) for lag in range(1, EXPOSURES)])
    for squares, variance in ((pairs, closed(1)), (single, all_lags)):
        assert abs(squares.mean() - variance) < 4 * squares.std() / TRIALS**0.5
    assert pairs.mean() < 0.6 * single.mean()


@pytest.mark.parametrize("polarity", ["differential", "single-ended"])
def test_coefficients_scatter_by_their_stated_noise(polarity: str) -> None:
    """Through the reconstruction, without DC coefficient; the white noise is 8 and 24 % less."""
    plan = {"patterns": 255, "order": "sequency-2d", "polarity": polarity}
    adc = {"bits": 24, "full_scale_electrons": 1e9, "offset_counts": 2**22}
    amplifier = {"noise_pa_per_sqrt_hz": 20.0, "corner_hz": 1e3}
    electronics = {"detector__amplifier": amplifier, "detector__adc": adc}
    paper = changed("paper", projector__shape=[16, 16], plan=plan, **electronics)
    plan, image = paper.pattern_plan, 3e5 * (1 + np.eye(16))
    clean = expose(plan, image)[None]
    light = BucketLight(image[None], 0 * image[None], clean, 0 * clean, None)
    compiled = CompiledPlan(plan, np.ones(plan.exposures, bool), image_method)
    truth, rng, scatter = compiled.decoder.decode(clean[0]), np.random.default_rng(3), []
    for _ in range(60):
        buckets = record_buckets(paper, light, rng)[0]
        decoded = compiled.decode(buckets.signal[0], buckets.variance[0])
        scatter.append(np.mean(((decoded.values - truth)[1:] / decoded.noise[1:]) ** 2))
    assert abs(np.mean(scatter) - 1) < 4 * np.std(scatter) / 60**0.5
    assert np.std(scatter) / 60**0.5 < 0.03
    amplifier = bucket_noise(paper, bucket_link(paper, Target(5.0))).variances["amplifier"]
    stated = amplifier + paper.detector.adc.quantisation_noise_electrons**2
    assert stated == pytest.approx(buckets.noise_electrons**2)


def test_stated_noise_has_the_closed_forms() -> None:
    """Half the variance of a difference for pairs; the mean of all such for single-ended ones."""
    lags = np.arange(1, 64)
    of_lags = [expected(lag, 1e3, PERIOD_S) for lag in lags]
    about_mean = np.sum((64 - lags) * of_lags) / 64**2
    for polarity, variance in (("differential", of_lags[0] / 2), ("single-ended", about_mean)):
        plan = {"patterns": 64, "order": "sequency-2d", "polarity": polarity}
        noisy = {"noise_pa_per_sqrt_hz": 1.0, "corner_hz": 1e3}
        paper = changed("paper", plan=plan, detector__amplifier=noisy)
        result = flicker_electrons(paper) * elementary_charge / PERIOD_S
        assert result**2 == pytest.approx(variance, rel=0.03)
    assert flicker_electrons(changed("paper")) == 0


def test_currents_drift_by_their_rate() -> None:
    """1 nA a minute, in electrons of an exposure."""
    paper, dark = recorded(EXPOSURES, 200, noise_pa_per_sqrt_hz=0.2, drift_pa_per_min=1e6)
    slope = 1e6 * 1e-12 / 60 * paper.pattern_period_s * paper.exposure_time_s / elementary_charge
    rise = dark[:, -1] - dark[:, 0]
    assert abs(rise.mean() - slope * (EXPOSURES - 1)) < 4 * rise.std() / 200**0.5
    assert slope * (EXPOSURES - 1) > 8 * rise.std() / 200**0.5


def test_drift_goes_on_from_frame_to_frame() -> None:
    drifting = Amplifier(noise_pa_per_sqrt_hz=1, drift_pa_per_min=60)
    rng = np.random.default_rng(1)
    whole = drifting_current_a(drifting, 8, 1.0, 0.5, rng)
    np.testing.assert_allclose(whole, 1e-12 * (np.arange(8) + 0.75))
    np.testing.assert_allclose(drifting_current_a(drifting, 4, 1.0, 0.5, rng, first=4), whole[4:])


def test_steady_amplifiers_draw_nothing() -> None:
    rng = np.random.default_rng(1)
    current = drifting_current_a(Amplifier(noise_pa_per_sqrt_hz=1), 4, 1.0, 1.0, rng, first=9)
    np.testing.assert_array_equal(current, np.zeros(4))
    assert rng.random() == np.random.default_rng(1).random()


def test_detectors_of_spots_have_white_noise() -> None:
    noisy = {"noise_pa_per_sqrt_hz": 2.0, "corner_hz": 1e3}
    with pytest.raises(ValidationError, match="corner_hz and drift_pa_per_min should be 0"):
        changed("paper", tof__detector__amplifier=noisy)

"""Counts against the light budget: means, variances, taps and what saturation does."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from scipy.constants import c

import worlds
from images import signed_coefficients
from reconstruction.capture import Capture
from reconstruction.operators import expose, illumination, make_plan
from reconstruction.ranging import measure_ranges
from spisim.atmosphere import fog
from spisim.instrument import Instrument, load_instrument
from spisim.scene import Ambient
from spisim.simulation.light import LightSequence, Transport, solve
from spisim.simulation.measurement import bucket_light, record, spot_light
from spisim.transport import GroundTruth, ground_truth

FRAMES = 4000
POSITION = worlds.scene(
    worlds.plane(4.0, 0.5), ambient=Ambient(sun_klx=40, sun_direction=(0, 0, 1))
)


@pytest.fixture(scope="module")
def paper() -> Instrument:
    return load_instrument("paper")


@pytest.fixture(scope="module")
def light(paper: Instrument) -> Transport:
    return solve(POSITION, paper, spp=64)


def still(light: Transport) -> LightSequence:
    return LightSequence(np.zeros(1), (light,))


@pytest.fixture(scope="module")
def truth(paper: Instrument) -> GroundTruth:
    return ground_truth(POSITION, paper)


@pytest.fixture(scope="module")
def noisy(paper: Instrument, light: Transport, truth: GroundTruth) -> Capture:
    return record(POSITION, paper, still(light), [truth], seed=5, frames=FRAMES)


def frequency(instrument):
    return instrument.tof.modulation.frequencies_hz[0]


def electrons(part):
    counts = part.counts if hasattr(part, "counts") else part.taps
    return (counts - part.offset_counts) * part.electrons_per_count


def test_mean_readings_are_the_expected_ones(paper, light, truth, noisy):
    ideal = record(POSITION, paper, still(light), [truth], seed=5, noise=False)
    for part, expected in ((noisy.buckets, ideal.buckets), (noisy.spots, ideal.spots)):
        z = worlds.z_score_exact(electrons(part), electrons(expected)[0])
        assert np.abs(z).max() < 5  # of up to 128 readings


def test_expected_readings_of_spots_tell_the_noise_of_real_ones(paper, light, truth, noisy):
    """Of buckets it stays unknown: image methods take expected readings at their word."""
    ideal = record(POSITION, paper, still(light), [truth], seed=5, noise=False)
    np.testing.assert_array_equal(ideal.spots.noise_electrons, noisy.spots.noise_electrons)
    assert (ideal.spots.noise_electrons > 0).all()
    assert np.isnan(ideal.buckets.noise_electrons)


def test_the_capture_tells_the_media(paper, light, truth):
    air = fog(50, "heavy-advection")
    foggy = replace(POSITION, atmosphere=air)
    for position, media in ((POSITION, []), (foggy, [{"where": "air", **air.summary()}])):
        capture = record(position, paper, still(light), [truth], seed=5)
        assert yaml.safe_load(capture.provenance.settings)["media"] == media


def test_variance_is_shot_noise_plus_electronics(paper, light, noisy):
    buckets = bucket_light(paper, still(light), 1).buckets
    taps = paper.tof.tap_electrons(spot_light(paper, still(light), 1), frequency(paper))
    for part, expected in ((noisy.buckets, buckets), (noisy.spots, taps)):
        variance = electrons(part).var(axis=0, ddof=1)
        model = expected[0] + part.noise_electrons**2
        z = (variance / model - 1) / np.sqrt(2 / (FRAMES - 1))
        assert np.abs(z).max() < 5
        assert abs(z.mean()) * np.sqrt(z.size) < 4


def test_the_sun_adds_what_the_formula_says(paper, light):
    # A Lambertian plane fills the field: τ ρ E A_eff / (4 f#²), whatever the distance.
    detector = paper.detector
    irradiance = paper.daylight_irradiance(40)
    effective = detector.sensor.effective_area_m2
    closed = 0.5 * irradiance * effective / (4 * detector.f_number**2)
    assert light.daylight_w == pytest.approx(closed, rel=1e-4, abs=0)
    np.testing.assert_allclose(light.spot_daylight_w, closed, rtol=0.02)  # 5° off: cos to 0.8 %


def test_daylight_and_dark_current_cancel_in_the_coefficients(paper, light):
    mean = bucket_light(paper, still(light), 1)
    plan = paper.pattern_plan
    bright = replace(light, daylight_w=10 * light.daylight_w)
    shifted = bucket_light(paper, still(bright), 1).buckets
    assert np.all(shifted > mean.buckets)
    first = signed_coefficients(plan, mean.buckets)[1]
    second = signed_coefficients(plan, shifted)[1]
    np.testing.assert_allclose(first, second, rtol=0, atol=1e-9 * np.abs(first).max())


def test_bucket_readings_are_linear_in_the_pattern():
    image = np.random.default_rng(0).uniform(size=(16, 8))
    readings = expose(make_plan((16, 8), polarity="differential"), image)
    np.testing.assert_allclose(readings[0::2] + readings[1::2], image.sum(), rtol=1e-12)
    patterns = [illumination(make_plan((16, 8), polarity="single-ended"), k) for k in (3, 70)]
    both = np.sum((patterns[0] + patterns[1]) * image)
    apart = expose(make_plan((16, 8), polarity="single-ended"), image)[[3, 70]].sum()
    assert both == pytest.approx(apart, rel=1e-12)


def test_phase_of_the_taps_is_the_path_length(paper, light, truth):
    capture = record(POSITION, paper, still(light), [truth], seed=0, noise=False)
    ranges = measure_ranges(capture.spots, frame=0)
    np.testing.assert_allclose(ranges.range_m, truth.spot_range_m, atol=1e-3)
    taps = electrons(capture.spots)[0]
    amplitude = np.hypot(taps[:, 0] - taps[:, 2], taps[:, 1] - taps[:, 3]) / 2
    mean = taps.mean(axis=1)
    tap_time_s = paper.tof.tap_time_s(frequency(paper))
    steady = spot_light(paper, still(light), 1).steady_per_s[0] * tap_time_s
    modulation, amplifier = paper.tof.modulation, paper.tof.detector.amplifier
    contrast = modulation.demodulation_contrast(frequency(paper), amplifier.response)
    np.testing.assert_allclose(amplitude / (mean - steady), contrast, rtol=1e-3)
    assert frequency(paper) == pytest.approx(c / 20)


def test_ranges_scatter_as_their_sigma_says(noisy):
    measured = [measure_ranges(noisy.spots, frame=k) for k in range(0, FRAMES, 4)]
    ranges = np.array([m.range_m for m in measured])
    sigma = np.array([m.sigma_m for m in measured]).mean(axis=0)
    z = (ranges.std(axis=0, ddof=1) / sigma - 1) * np.sqrt(2 * (len(ranges) - 1))
    assert np.all(np.abs(z) < 4)


def test_clipping_is_flagged(paper, light, truth):
    bright = replace(light, daylight_w=1e6 * light.daylight_w)
    capture = record(POSITION, paper, still(bright), [truth], seed=0)
    assert capture.buckets.saturated.all()
    assert np.all(capture.buckets.counts == paper.detector.adc.max_count)
    assert not capture.spots.saturated.any()

"""Noise in closed form, where no image and no range shows it: of buckets, and of error gauges."""

from types import SimpleNamespace

import numpy as np
import pytest

from instruments import changed
from reconstruction.capture import Buckets
from reconstruction.image.factorised import Factorised
from reconstruction.operators import expose
from spisim.budget import ranging_noise
from spisim.instrument import load_instrument
from spisim.simulation.light.noise_metric import image_error_metric, spot_error_metric
from spisim.simulation.measurement.light import background_electrons

FOUR = [(x, y, 0.0) for x in (-0.05, 0.05) for y in (-0.05, 0.05)]


def test_light_that_ac_coupling_takes_off_keeps_its_shot_noise() -> None:
    """A reading of 3000 electrons, from which 10,000 were taken, has the noise of 13,000."""
    buckets = Buckets(
        counts=np.array([[3000.0, -10_000.0]]),
        saturated=np.zeros((1, 2), dtype=bool),
        exposure_time_s=1e-4,
        pattern_period_s=1e-4,
        electrons_per_count=1.0,
        offset_counts=0.0,
        noise_electrons=20.0,
        excess_noise_factor=2.0,
        dead_time_s=0.0,
        baseline_electrons=10_000.0,
    )
    np.testing.assert_allclose(buckets.variance, [[2 * 13_000 + 400, 400]])


def test_detectors_in_parallel_each_have_their_dark_current() -> None:
    one = changed("paper", detector__positions_m=FOUR[:1])
    four = changed("paper", detector__positions_m=FOUR)
    dark = one.detector.dark_electrons(one.exposure_time_s)
    assert background_electrons(one, 0.0) == pytest.approx(dark)
    assert background_electrons(four, 0.0) == pytest.approx(4 * dark)


def test_noise_energy_is_what_noise_alone_adds_to_the_energy_of_the_mean() -> None:
    """Tr(C^-1 cov(mean)), of components that do not overlap but differ in strength and noise."""
    variance, noise = np.array([4.0, 1.0, 0.25]), np.array([0.5, 1.0, 2.0])
    strength = np.array([1.0, 2.0, 3.0])
    rows = np.diag(strength)
    gram = rows @ np.diag(variance) @ rows.T
    measured = np.array([5.0, -3.0, 1.0])
    field = SimpleNamespace(variance=variance.reshape(1, 3))
    given = Factorised(measured, noise, rows, gram, rows * variance, field, None)
    prior = given.contrast * np.diag(variance)
    gain = prior @ rows.T @ np.linalg.inv(given.contrast * gram + np.diag(noise**2))
    np.testing.assert_allclose(given.mean.ravel(), gain @ measured)
    of_mean = gain @ np.diag(noise**2) @ gain.T
    assert given.noise_energy == pytest.approx(np.trace(np.diag(1 / variance) @ of_mean))


def test_the_image_gauge_sees_patterns_whose_dark_pixels_leak() -> None:
    """Like any exposure: lit pixels count in full, dark ones by the dark level."""
    leaky = changed("paper", projector__on_off_contrast=5.0)
    image = np.random.default_rng(0).random(leaky.projector.shape)
    plan = leaky.pattern_plan
    level = leaky.projector.dark_level
    assert level == pytest.approx(0.2)
    time_s = leaky.exposure_time_s
    electrons = (
        image * leaky.pixel_powers_w * leaky.electrons_per_joule(leaky.detector, "projector")
    )
    lit = expose(plan, electrons * time_s)
    dark = (electrons * time_s).sum() - lit
    displayed = image_error_metric(leaky, 0.0).readings({"image": image.ravel()})[: plan.exposures]
    np.testing.assert_allclose(displayed, lit + level * dark)


def test_the_image_gauge_counts_the_dark_current_of_every_detector() -> None:
    """Where there is no other noise, four detectors have twice the noise of one."""
    size = {}
    for positions in (FOUR[:1], FOUR):
        one = changed(
            "paper",
            detector__positions_m=positions,
            detector__sensor__dark_current_na=1e6,
        )
        error_metric = image_error_metric(one, 0.0)
        error = error_metric.readings({"image": np.full(one.projector.shape, 1e-12).ravel()})
        size[len(positions)] = error_metric.size(0 * error, np.ones_like(error))
    assert size[1] / size[4] == pytest.approx(2, rel=0.01)


def test_the_spot_gauge_compares_with_half_the_variance_of_four_taps() -> None:
    """The real part of a phasor is the difference of two of four taps, each with a quarter of the
    light: its variance is half that of all of it."""
    paper = load_instrument("paper")
    phase = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    no_light = np.zeros(4)
    error_metric = spot_error_metric(paper, no_light, no_light, phase)
    mean = error_metric.readings({"histogram": np.full((4, 8), 1e-9)})
    error = np.zeros_like(mean)
    error[1:] = 3.0  # electrons per second of either part
    dark = np.asarray(paper.tof.detector.sensor.dark_rate_hz)
    noise = ranging_noise(
        paper,
        {"signal": mean[0], "daylight": no_light, "patterns": no_light, "dark current": dark},
    )
    expected = 3.0 * paper.tof.reading.echo_s / np.sqrt(noise.total_variance / 2)
    assert error_metric.size(mean, error) == pytest.approx(float(np.sqrt(np.mean(expected**2))))

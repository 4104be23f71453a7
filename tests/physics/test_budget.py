"""Closed form meets Monte Carlo: a wall in front of every preset, mean, variance and range.

Means of the light against the budget by z-score over independent runs; variances of 20,000 recorded
readings against the noise budget, and the scatter of as many ranges, by the standard error of a
variance, √(2/n) of it.
"""

from functools import cache
from typing import Any

import numpy as np
import pytest
import yaml

import worlds
from instruments import PAPER
from reconstruction.ranging import measure_ranges
from spisim.budget import (
    Target,
    bucket_link,
    bucket_noise,
    link,
    range_sigma_m,
    spot_link,
    spot_noise,
)
from spisim.instrument import Instrument, SpotLight, load_instrument
from spisim.scene import Ambient
from spisim.simulation.light import LightSequence, Transport, solve
from spisim.simulation.measurement import bucket_light, spot_light


def others_slow(*names: str) -> list[Any]:
    return [pytest.param(name, marks=pytest.mark.slow) for name in names]


CHARGE = ["paper", *others_slow("fga015", "apd", "hybrid")]
PRESETS = [*CHARGE, *others_slow("spad")]
DISTANCE_M, REFLECTANCE, SUN_KLX, EXTINCTION = 4.0, 0.5, 5.0, 0.06
TARGET = Target(DISTANCE_M, REFLECTANCE, SUN_KLX)
WALL = worlds.plane(DISTANCE_M, REFLECTANCE)
DAYLIGHT = Ambient(sun_klx=SUN_KLX, sun_direction=(0, 0, 1))
IMAGING = ("projector", "plan", "detector", "exposure_time_s")
RUNS, SPP = 8, 16
FRAMES = 5000  # of four spots each
#: Light is traced in single precision and into bins of path length.
ROUNDING = 2e-5


@cache
def preset(name: str) -> Instrument:
    return load_instrument(name)


@cache
def runs(name: str) -> tuple[Transport, ...]:
    scene = worlds.scene(WALL, ambient=DAYLIGHT)
    return tuple(solve(scene, preset(name), spp=SPP, seed=seed) for seed in range(RUNS))


def still(light: Transport) -> LightSequence:
    return LightSequence(np.zeros(1), (light,))


def z_score(repetitions, exact):
    """Of a mean, with rounding as a standard error of its own."""
    repetitions = np.asarray(repetitions, float)
    error = repetitions.std(axis=0, ddof=1) / np.sqrt(len(repetitions))
    return (repetitions.mean(axis=0) - exact) / np.hypot(error, ROUNDING * np.abs(exact))


@pytest.mark.parametrize("name", PRESETS)
def test_mean_light_of_the_image(name: str) -> None:
    instrument = preset(name)
    budget = bucket_link(instrument, TARGET)
    powers = [np.sum(run.image * instrument.pixel_powers_w) for run in runs(name)]
    assert abs(z_score(powers, budget.signal_w)) < 4
    assert abs(z_score([run.daylight_w for run in runs(name)], budget.daylight_w)) < 4


@pytest.mark.parametrize("name", PRESETS)
def test_mean_light_of_the_spots(name: str) -> None:
    instrument = preset(name)
    budget = spot_link(instrument, TARGET)
    echoes = [run.spot_histogram.sum(axis=-1) * instrument.lasers.power_w for run in runs(name)]
    assert np.abs(z_score(echoes, budget.echo_w)).max() < 4
    assert np.abs(z_score([run.spot_daylight_w for run in runs(name)], budget.daylight_w)).max() < 4


@pytest.mark.parametrize("spots", [1, 64])
def test_mean_light_of_any_number_of_spots(spots: int) -> None:
    """On a grid; the relative errors of all are alike, so they are pooled."""
    across = 16 * ((np.arange(np.sqrt(spots)) + 0.5) / np.sqrt(spots) - 0.5)
    fields = {name: part for name, part in yaml.safe_load(PAPER).items() if name not in IMAGING}
    fields["lasers"]["directions_deg"] = [[x, y] for y in across.tolist() for x in across.tolist()]
    fields["tof"]["detector"]["positions_m"] = [[0.01, 0.0, 0.0]] * spots
    instrument = Instrument.model_validate(fields)
    light = [solve(worlds.scene(WALL), instrument, spp=1, seed=seed) for seed in range(RUNS)]
    echo_w = spot_link(instrument, Target(DISTANCE_M, REFLECTANCE)).echo_w
    power_w = instrument.ranging.lasers.power_w
    ratios = np.array([run.spot_histogram.sum(axis=-1) for run in light]) * power_w / echo_w
    error = np.sqrt(ratios.var(axis=0, ddof=1).mean() / RUNS)
    assert ratios.shape == (RUNS, spots)
    assert np.abs(ratios.mean(axis=0) - 1).max() < 4.5 * np.hypot(error, ROUNDING)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["paper", "fga015"])
def test_mean_light_of_the_patterns_on_small_detectors(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a point for an aperture, and the field probed everywhere, the closed form is exact."""
    instrument = preset(name)
    detector = instrument.tof.detector
    area_mm2 = 1e-4 * detector.sensor.photoactive_area_mm2
    sensor = detector.sensor.model_copy(update={"photoactive_area_mm2": area_mm2})
    small = detector.model_copy(update={"sensor": sensor})
    tof = instrument.tof.model_copy(update={"detector": small})
    instrument = instrument.model_copy(update={"tof": tof})
    monkeypatch.setattr(link, "FIELD_SAMPLES", 2**18)
    scene = worlds.scene(WALL)
    result = [solve(scene, instrument, spp=1, seed=seed).spot_crosstalk_w for seed in range(RUNS)]
    assert np.abs(z_score(result, spot_link(instrument, TARGET).patterns_w)).max() < 4


@pytest.mark.parametrize("name", PRESETS)
def test_mean_light_of_the_patterns_on_the_spots(name: str) -> None:
    """Lenses of 8 mm, and a field probed in 512 directions: to 0.2 %."""
    result = np.mean([run.spot_crosstalk_w for run in runs(name)], axis=0)
    assert spot_link(preset(name), TARGET).patterns_w == pytest.approx(result, rel=2e-3, abs=0)


@pytest.mark.slow
def test_fog_takes_as_much_as_its_extinction_says() -> None:
    """Absorbing fog scatters nothing back."""
    paper = preset("paper")
    scene = worlds.scene(WALL, extinction_per_m=EXTINCTION, albedo=0.0)
    target = Target(DISTANCE_M, REFLECTANCE, 0.0, EXTINCTION)
    result = [solve(scene, paper, spp=SPP, seed=seed) for seed in range(RUNS)]
    powers = [np.sum(run.image * paper.pixel_powers_w) for run in result]
    assert abs(z_score(powers, bucket_link(paper, target).signal_w)) < 4
    echoes = [run.spot_histogram.sum(axis=-1) * paper.lasers.power_w for run in result]
    assert np.abs(z_score(echoes, spot_link(paper, target).echo_w)).max() < 4


@pytest.mark.parametrize("name", PRESETS)
def test_mean_and_variance_of_an_exposure(name: str) -> None:
    """The first exposure of a frame has all pixels on; the budget takes it as settled."""
    instrument = preset(name)
    sharp = instrument.projector.model_copy(
        update={"settling_time_s": 0.0, "on_off_contrast": None}
    )
    amplifier = instrument.detector.amplifier.model_copy(update={"bandwidth_hz": None})
    detector = instrument.detector.model_copy(update={"amplifier": amplifier})
    instrument = instrument.model_copy(update={"projector": sharp, "detector": detector})
    budget = bucket_link(instrument, TARGET)
    mean = budget.signal_electrons + budget.daylight_electrons + budget.dark_electrons
    lights = [bucket_light(instrument, still(run), 1).buckets[0, 0] for run in runs(name)]
    assert abs(z_score(lights, mean)) < 4
    draws = np.full((4 * FRAMES, 1), float(mean))
    readings = detector.read(draws, instrument.exposure_time_s, np.random.default_rng(3))
    adc = detector.adc
    electrons = (readings.counts - adc.offset_counts) * adc.electrons_per_count
    expected = bucket_noise(instrument, budget).total_electrons
    assert abs(z_of_variance(electrons, expected)) < 4
    assert abs(electrons.mean() - mean) < 4 * expected / np.sqrt(electrons.size)


@pytest.mark.parametrize("name", CHARGE)
def test_variance_of_a_spot_s_reading(name: str) -> None:
    """Of the window without echo (hybrid), and of a pair of opposite taps, whose sum is even."""
    instrument = preset(name)
    spots = recorded(name, FRAMES)
    electrons = (spots.taps - spots.offset_counts) * spots.electrons_per_count
    noise = spot_noise(instrument, spot_link(instrument, TARGET))
    for spot in range(4):
        if instrument.tof.method == "pulsed":
            quiet = sum(v[spot] for k, v in noise.variances.items() if k != "signal")
            z = z_of_variance(electrons[:, spot, 0], np.sqrt(quiet))
        else:
            pair = electrons[:, spot, 0] + electrons[:, spot, 2]
            z = z_of_variance(pair, np.sqrt(2) * noise.total_electrons[spot])
        assert abs(z) < 4


@pytest.mark.parametrize("name", CHARGE)
def test_scatter_of_ranges(name: str) -> None:
    spots = recorded(name, FRAMES)
    result = np.array([measure_ranges(spots, frame).range_m for frame in range(FRAMES)])
    sigma = range_sigma_m(preset(name), TARGET)
    for spot in range(4):
        assert abs(z_of_variance(result[:, spot], sigma[spot])) < 4


@pytest.mark.slow
def test_scatter_of_ranges_from_single_photons() -> None:
    """Maximum likelihood comes close to the Cramér-Rao bound, and never below."""
    frames = 200
    spots = recorded("spad", frames)
    result = np.array([measure_ranges(spots, frame).range_m for frame in range(frames)])
    sigma = range_sigma_m(preset("spad"), TARGET)
    ratio = np.sqrt(np.mean(result.var(axis=0, ddof=1) / sigma**2))
    assert 1 - 4 / np.sqrt(2 * result.size) < ratio < 1.1 + 4 / np.sqrt(2 * result.size)


@cache
def recorded(name: str, frames: int):
    instrument = preset(name)
    one = spot_light(instrument, still(runs(name)[0]), 1)
    many = SpotLight(
        one.path_length_m,
        np.broadcast_to(one.echo_per_s, (frames, *one.echo_per_s.shape[1:])),
        np.broadcast_to(one.steady_per_s, (frames, 4)),
        one.laser_power_w,
    )
    return instrument.tof.record(many, instrument.spot_optics, np.random.default_rng(5))


def z_of_variance(values: np.ndarray, sigma: float) -> float:
    return float((values.var(ddof=1) / sigma**2 - 1) * np.sqrt(values.size / 2))

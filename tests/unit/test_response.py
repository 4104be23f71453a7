"""A measured response, diodes that share a zone, speckle and the near overlap of zones."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.constants import c

from instruments import changed
from reconstruction.base.errors import InputError
from reconstruction.capture import read_capture, write_capture
from reconstruction.capture.importers import capture_from_spots
from reconstruction.ranging import measure_ranges
from spisim.instrument import SpotLight, load_instrument
from spisim.instrument.response import Response

SENSOR = load_instrument("tmf8820")
SKEWED = Response(samples_ns=[(-0.2, 0.0), (0.0, 1.0), (0.6, 0.3), (2.0, 0.0)])


def echo_of(instrument, path_m, photons=2e5, frames=1):
    """Light of one path length in every zone: so many photons a frame, and no background."""
    tof = instrument.tof
    lengths = np.arange(0.0, 4.0, 0.002)
    echo = np.zeros((frames, instrument.ranging.spots, lengths.size))
    echo[..., round(path_m / 0.002)] = photons / (
        tof.pulses * tof.pulse_sigma_s * np.sqrt(2 * np.pi)
    )
    steady = np.zeros(echo.shape[:2])
    return SpotLight(lengths, echo, steady, 1.0)


def test_the_response_is_a_fraction_that_rises_to_one():
    times = np.linspace(-1e-9, 3e-9, 400)
    arrived = SKEWED.arrived(times)
    assert (arrived[0], arrived[-1]) == (0, 1)
    assert (np.diff(arrived) >= 0).all()
    # The area of the samples by hand: 0.1 + 0.39 + 0.21 = 0.7.
    assert SKEWED.arrived(np.array([0.0, 0.6e-9])) == pytest.approx([1 / 7, 4.9 / 7])


def test_a_gaussian_as_samples_is_that_gaussian():
    at = np.linspace(-2, 2, 161)
    sampled = Response(samples_ns=list(zip(at, np.exp(-(at**2) / 2 / 0.3**2), strict=True)))
    delay_s, sigma_s = sampled.as_gaussian(0.25e-9)
    assert delay_s == pytest.approx(0, abs=1e-12)
    assert sigma_s == pytest.approx(0.3e-9, rel=0.01)
    rate = np.zeros(400)
    rate[150] = 1.0
    spread = sampled.applied(rate, 0.05e-9)
    assert spread.sum() == pytest.approx(1)
    assert np.argmax(spread) == 150


def test_histograms_show_the_response():
    sensor = changed("tmf8820", zones__near_overlap_m=0.0)
    path_m = 1.0
    spots = sensor.tof.record(echo_of(sensor, path_m, photons=100.0), sensor.spot_optics, None)
    edges = np.arange(sensor.tof.bins + 1) * sensor.tof.bin_width_s - path_m / c
    expected = 100 * np.diff(sensor.tof.response.arrived(edges))
    np.testing.assert_allclose(spots.counts[0, 0], expected, atol=0.02 * expected.max())
    ranges = measure_ranges(spots, 0, "dtof")
    np.testing.assert_allclose(ranges.range_m, path_m / 2, atol=2e-3)


def test_the_capture_keeps_the_response(tmp_path):
    spots = SENSOR.tof.record(echo_of(SENSOR, 1.0), SENSOR.spot_optics, None)
    write_capture(capture_from_spots(spots), tmp_path / "a.h5")
    read = read_capture(tmp_path / "a.h5").spots
    np.testing.assert_array_equal(read.response, spots.response)
    np.testing.assert_array_equal(read.response_s, spots.response_s)
    assert measure_ranges(read, 0, "returns").range_m == pytest.approx(0.5, abs=3e-3)


@pytest.mark.parametrize(
    ("match", "changes"),
    [
        ("one is missing", {"response": None}),
        ("rising times", {"response_s": np.array([0.0, 1e-9, 1e-9])}),
        ("0 everywhere", {"response": np.zeros(3)}),
    ],
)
def test_half_a_response_is_refused(match, changes):
    spots = SENSOR.tof.record(echo_of(SENSOR, 1.0), SENSOR.spot_optics, None)
    given = {"response_s": np.array([0.0, 1e-9, 2e-9]), "response": np.ones(3)} | changes
    with pytest.raises(InputError, match=match):
        replace(spots, **given).check()


def test_diodes_that_share_a_zone_pile_up_less():
    one, eight = (changed("tmf8820", tof__diodes=diodes) for diodes in (1, 8))
    counts = [
        each.tof.record(echo_of(each, 1.0, photons=4e5), each.spot_optics, None).counts[0].sum(1)
        for each in (one, eight)
    ]
    for count, cycles in zip(counts, (one.tof.pulses, 8 * one.tof.pulses), strict=True):
        np.testing.assert_allclose(count, cycles * -np.expm1(-4e5 / cycles), rtol=0.01)


def test_speckle_scatters_the_light_of_a_zone():
    sensor = changed("tmf8820", tof__speckle_contrast=0.1)
    light = echo_of(sensor, 1.0, photons=1e5, frames=60)
    counts = sensor.tof.record(light, sensor.spot_optics, np.random.default_rng(2)).counts
    scatter = counts.sum(axis=-1).std() / counts.sum(axis=-1).mean()
    # Pile-up flattens it a little; Poisson's part is 0.3 %.
    assert scatter == pytest.approx(0.1, abs=3.5 * 0.1 / np.sqrt(2 * 60 * 9) + 0.003)


def test_zones_see_less_of_what_is_near():
    zones = changed("tmf8820", zones__near_overlap_m=[0.05] + 8 * [0.0]).zones
    seen = zones.overlap(np.array([0.0, 0.1, 2.0]))
    assert seen[0] == pytest.approx([0.0, np.exp(-1), np.exp(-(0.05**2))])
    assert (seen[1:] == 1).all()
    with pytest.raises(ValueError, match=r"near_overlap_m has 2 values; one, or 9"):
        changed("tmf8820", zones__near_overlap_m=[0.1, 0.1])


@pytest.mark.parametrize(
    ("match", "preset", "changes"),
    [
        ("rising times", "tmf8820", {"tof__response": {"samples_ns": [[0, 1], [0, 2], [1, 0]]}}),
        ("rate above 0", "tmf8820", {"tof__response": {"samples_ns": [[0, 0], [1, 0], [2, 0]]}}),
        ("jitter_fwhm_s should be 0", "tmf8820", {"tof__detector__sensor__jitter_fwhm_s": 1e-10}),
        ("response and diodes", "rangefinder-905", {"tof__diodes": 2}),
    ],
)
def test_odd_responses_are_refused(match, preset, changes):
    with pytest.raises(ValueError, match=match):
        changed(preset, **changes)

"""Falling drops in readings and recordings."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.constants import c

import spisim
import worlds
from rainfall import LENGTHS, WALL_M, depths, instrument, one_drop
from spisim.atmosphere.precipitation import rain
from spisim.simulation.drops import falling_drops
from spisim.simulation.drops.beams import SpotChange
from spisim.simulation.light import LightSequence, Transport
from spisim.simulation.measurement import bucket_light, record, spots
from spisim.simulation.measurement.spots import spot_light


def readings(one, *falling, frames=1, seed=0):
    """Mean electrons of a wall, all pixels alike, with drops before it."""
    position = replace(worlds.scene(worlds.plane(WALL_M)), precipitation=falling)
    noise = np.random.default_rng(seed)
    return bucket_light(
        one,
        LightSequence(np.zeros(1), (transport(one),)),
        frames,
        falling_drops(position, one, [depths(one)], frames, noise),
    ).buckets


def transport(one):
    image = np.full(one.projector.shape, 1e-9)
    return Transport(
        image=image,
        image_error=0 * image,
        spot_histogram=np.zeros((4, 400)),
        spot_histogram_error=np.zeros((4, 400)),
        path_length_m=LENGTHS,
        daylight_w=0.0,
        daylight_error_w=0.0,
        spot_daylight_w=np.zeros(4),
        spot_daylight_error_w=np.zeros(4),
        spot_crosstalk_w=np.zeros(4),
        spot_crosstalk_error_w=np.zeros(4),
        noise_share=0.0,
        spot_noise_share=0.0,
        dropped=0,
        paths=0,
        seconds=0.0,
        extra={},
    )


def test_flicker_grows_with_the_rain():
    """Equal patterns differ from frame to frame, the more the harder it rains."""
    one = instrument(pattern_rate_hz=200.0, patterns=3)
    still = readings(one)
    flicker = []
    for rate in (3.0, 100.0):
        spread = readings(one, rain(rate, near_m=0.2, far_m=4.0), frames=40) / still - 1
        flicker.append(spread[:, :-1].var(ddof=1))
    # By area, drops of 100 mm/h are 9 times those of 3 mm/h; 120 readings tell 2 from 1.
    assert flicker[1] > 2 * flicker[0] > 0


def test_taps_share_what_drops_do_to_the_bucket():
    """Four windows of a quarter period collect all of it; an echo has the phase of its path."""
    modulation = {"frequencies_hz": [15e6], "light": "sine", "contrast": 1.0}
    one = instrument(patterns=3, modulation=modulation)
    light = transport(one)
    orders = len(one.tap_frequencies_hz)
    phasors = np.zeros((orders, *light.image.shape), complex)
    dark = replace(light, image=0 * light.image, extra={"phasors": phasors})
    still = LightSequence(np.zeros(1), (dark,))
    position, diameter = np.array([0.01, 0.02, 1.5]), 3.0
    wet, dry = (
        bucket_light(one, still, 1, weather) for weather in (one_drop(one, position, diameter), ())
    )
    echo = wet.taps[0, 0] - dry.taps[0, 0]
    np.testing.assert_allclose(echo.sum(), wet.buckets[0, 0] - dry.buckets[0, 0], rtol=1e-6)
    length = np.linalg.norm(position) + np.linalg.norm(position - one.detector.positions_m[0])
    phase = np.arctan2(echo[1] - echo[3], echo[0] - echo[2])
    amplifier = one.detector.amplifier
    offset = one.projector.modulation.phase_offset_rad(15e6, amplifier.response)
    assert phase - offset == pytest.approx(2 * np.pi * 15e6 * length / c, rel=1e-3)


def test_rain_in_a_recording():
    """The same seed gives the same drops, another one others; without noise too."""
    one = instrument(patterns=8)
    position = worlds.scene(worlds.plane(WALL_M))
    rainy = replace(position, precipitation=(rain(50.0),))
    light = LightSequence(np.zeros(1), (transport(one),))
    truth = spisim.transport.ground_truth(position, one)

    def counts(scene, seed):
        return record(scene, one, light, [truth], seed=seed, noise=False, frames=2).buckets.counts

    np.testing.assert_array_equal(counts(rainy, 1), counts(rainy, 1))
    assert not np.array_equal(counts(rainy, 1), counts(rainy, 2))
    dry = counts(position, 1)
    np.testing.assert_array_equal(dry[0], dry[1])
    assert not np.array_equal(counts(rainy, 1)[0], counts(rainy, 1)[1])


def test_echoes_of_drops_add_to_what_they_let_pass(monkeypatch):
    """Of the lasers' power, in electrons: as much as of any other echo of that fraction."""
    one, share = spisim.load_instrument("paper"), 1e-9
    lit = replace(transport(one), spot_histogram=np.full((4, LENGTHS.size), share))
    light = LightSequence(np.zeros(1), (lit,))
    plain = spot_light(one, light, 1).echo_per_s
    halved = SpotChange(np.full((1, 4, LENGTHS.size), 0.5), np.full((1, 4, LENGTHS.size), share))
    monkeypatch.setattr(spots, "on_spots", lambda drops, lengths: halved)
    wet = spot_light(one, light, 1, (object(),)).echo_per_s
    np.testing.assert_allclose(wet, 1.5 * plain)

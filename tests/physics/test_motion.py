"""Things that move while the patterns are shown: what the readings must follow."""

import tracemalloc
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

import spisim
import worlds
from instruments import changed
from reconstruction.base.errors import InputError
from reconstruction.operators import decoder_for
from spisim.scene import Scene
from spisim.simulation.light import LightSequence, trace
from spisim.simulation.measurement import bucket_light, spot_light


@pytest.fixture(scope="module")
def paper():
    return spisim.load_instrument("paper")


def wall(distance_m=4.0, **motion) -> Scene:
    thing = replace(worlds.plane(distance_m, 0.5), **motion)
    return worlds.scene(thing)


def sequence(scene, paper, frames=1):
    return trace(
        scene, paper, frames=frames, spp=16, transport_noise_share=None, seed=0, progress=None
    )


def test_what_stands_still_is_solved_once(paper):
    light = sequence(wall(), paper, frames=3)
    assert len(light.transports) == 1
    readings = bucket_light(paper, light, 3).buckets
    assert readings.shape == (3, paper.pattern_plan.exposures)
    np.testing.assert_array_equal(readings[0], readings[2])


def test_an_approaching_wall_brightens_with_the_inverse_square(paper):
    """At 20 m/s the wall comes 17 cm closer in a frame: 9 % more light at its end."""
    speed = 20.0
    light = sequence(wall(velocity_m_s=(0.0, 0.0, -speed)), paper, frames=2)
    assert len(light.transports) == 2 * 4 + 1  # 17 cm per frame
    still = bucket_light(paper, sequence(wall(), paper), 1)
    moving = bucket_light(paper, light, 2)
    times = paper.exposure_times_s(2)
    dark = paper.detector.dark_electrons(paper.exposure_time_s)
    gain = (moving.buckets[:, :-1] - dark) / (still.buckets[:, :-1] - dark)
    expected = (4.0 / (4.0 - speed * times[:, :-1])) ** 2
    np.testing.assert_allclose(gain, expected, rtol=3e-3)


def test_ranges_are_those_of_the_frame_s_middle(paper):
    speed = 20.0
    simulation = spisim.simulate(
        wall(velocity_m_s=(0.0, 0.0, -speed)), paper, spp=16, noise=False, frames=2
    )
    from reconstruction.ranging import measure_ranges

    slant = 1 / (simulation.capture.spots.directions @ [0, 0, 1])
    for frame in range(2):
        middle = (frame + 0.5) * paper.frame_time_s
        measured = measure_ranges(simulation.capture.spots, frame).range_m
        np.testing.assert_allclose(measured, (4.0 - speed * middle) * slant, atol=2e-3)
        true = simulation.capture.truth.at(frame)
        np.testing.assert_allclose(true.spot_range_m, (4.0 - speed * middle) * slant, rtol=1e-5)
        np.testing.assert_allclose(true.depth_m, 4.0 - speed * middle, rtol=1e-5)


def test_flying_towards_a_wall_is_the_wall_coming_closer(paper):
    towards = replace(wall(), drone_velocity_m_s=(0.0, 0.0, 15.0))
    coming = wall(velocity_m_s=(0.0, 0.0, -15.0))
    lights = [sequence(position, paper) for position in (towards, coming)]
    first, second = (bucket_light(paper, light, 1) for light in lights)
    np.testing.assert_allclose(first.buckets, second.buckets, rtol=1e-5)
    first, second = (spot_light(paper, light, 1) for light in lights)
    np.testing.assert_allclose(first.steady_per_s, second.steady_per_s, rtol=1e-5)
    frequency = paper.tof.modulation.frequencies_hz[0]
    taps = [paper.tof.tap_electrons(light, frequency) for light in (first, second)]
    np.testing.assert_allclose(*taps, rtol=1e-5)


def test_interpolation_weights_sum_to_one_and_hit_the_keys():
    light = LightSequence(np.array([0.0, 1.0, 3.0]), ())
    between = light.between(np.array([[0.0, 0.25], [1.0, 2.0]]))
    weights = np.zeros((2, 2, 3))
    for position in np.ndindex(2, 2, 2):
        weights[position[:2]][between.keys[position]] += between.fractions[position]
    np.testing.assert_allclose(weights.sum(axis=-1), 1)
    np.testing.assert_allclose(weights[0, 1], [0.75, 0.25, 0])
    np.testing.assert_allclose(weights[1], [[0, 1, 0], [0, 0.5, 0.5]])
    values = np.array([[1.0, 0], [2.0, 10], [7.0, 0]])
    np.testing.assert_allclose(between.means(values), weights.mean(axis=1) @ values)


def test_memory_of_a_long_flight_is_that_of_its_frames():
    """Readings and key times grow with the frames, their product with the patterns must not."""
    small = changed("paper", projector__shape=[8, 8], plan__patterns=63)

    def peak_bytes(frames):
        keys = 2 * frames + 1
        one = any_light(small)
        light = LightSequence(np.linspace(0, frames * small.frame_time_s, keys), (one,) * keys)
        tracemalloc.start()
        bucket_light(small, light, frames)
        spot_light(small, light, frames)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak

    assert peak_bytes(400) < 2.5 * peak_bytes(200)


def any_light(instrument):
    """Light of a scene, without any tracing."""
    shape = instrument.projector.shape
    return SimpleNamespace(
        image=np.ones(shape),
        image_error=np.zeros(shape),
        daylight_w=1e-9,
        daylight_error_w=0.0,
        spot_histogram=np.ones((4, 10)),
        path_length_m=np.arange(10.0),
        spot_daylight_w=np.ones(4),
        spot_daylight_error_w=np.zeros(4),
        spot_crosstalk_w=np.ones(4),
        spot_crosstalk_error_w=np.zeros(4),
    )


def test_an_object_that_flies_through_the_instrument_is_refused(paper):
    ball = worlds.surface("ball", trimesh.creation.icosphere(2, 0.1), 0.5)
    ball.mesh.apply_translation([0, 0, 0.5])
    fast = replace(ball, velocity_m_s=(0.0, 0.0, -100.0))
    with pytest.raises(InputError, match="ball"):
        sequence(worlds.scene(worlds.plane(4.0), fast), paper)


def test_frames_of_an_interleaved_plan_are_read_by_their_own_patterns():
    """Noise-free coefficients of each frame are those of the still image, by its own rows."""
    dealt = changed("paper", plan__interleave=3, plan__patterns=40)
    capture = spisim.simulate(wall(), dealt, spp=16, noise=False, frames=4).capture
    assert len(capture.setup.plans) == 3
    for frame in range(4):
        decoder = decoder_for(capture.setup.plan_of(frame))
        decoded = decoder.decode(capture.buckets.signal[frame])
        expected = decoder.operator.forward(capture.truth.at(frame).image)
        np.testing.assert_allclose(decoded, expected, rtol=1e-6, atol=1e-6 * expected.max())

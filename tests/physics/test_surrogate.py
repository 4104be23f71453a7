"""Surrogate light against light traced, and where it says that it is one."""

import numpy as np
import pytest

import worlds
from instruments import changed
from reconstruction import capture_warnings, read_capture, write_capture
from reconstruction.base.errors import InputError
from spisim.base.config import load_yaml
from spisim.instrument import load_instrument
from spisim.simulation import simulate
from spisim.simulation.light import solve
from spisim.simulation.light.surrogate import BOUNCED, LONG_HZ, mean_path_m, surrogate

PAPER = load_instrument("paper")
MODULATED = changed("paper", projector__modulation={"frequencies_hz": [15e6]})


def test_a_wall_alone_has_the_light_traced_and_the_share_for_what_bounces():
    wall = worlds.scene(worlds.plane(4.0, 0.5, tilt_rad=0.3))
    guessed, traced = surrogate(wall, PAPER, seed=1), solve(wall, PAPER, spp=64, seed=2)
    ratio = guessed.image / traced.image
    # Smoothing takes the share's own slope off at the sides of the image.
    assert np.abs(ratio / (1 + BOUNCED) - 1).max() < 0.02
    once = np.abs(guessed.image - traced.image) < 5 * np.hypot(
        guessed.image_error, traced.image_error
    )
    assert once.all()


def test_spots_in_clear_air_are_those_traced():
    wall = worlds.scene(worlds.plane(4.0, 0.5))
    guessed, traced = surrogate(wall, PAPER, seed=1), solve(wall, PAPER, spp=64, seed=2)
    powers = [light.spot_histogram.sum(axis=1) for light in (guessed, traced)]
    np.testing.assert_allclose(powers[0], powers[1], rtol=0.01)
    means = [
        light.spot_histogram @ light.path_length_m / light.spot_histogram.sum(axis=1)
        for light in (guessed, traced)
    ]
    np.testing.assert_allclose(means[0], means[1], atol=2e-3)
    assert guessed.spot_crosstalk_w == pytest.approx(traced.spot_crosstalk_w, rel=0.5)


@pytest.mark.slow
def test_in_fog_it_is_near_the_light_traced():
    room = worlds.scene(*worlds.room(), extinction_per_m=0.05, albedo=0.99, g=0.8)
    guessed, traced = surrogate(room, PAPER, seed=1), solve(room, PAPER, spp=256, seed=2)
    assert np.corrcoef(guessed.image.ravel(), traced.image.ravel())[0, 1] > 0.97
    assert guessed.image.mean() == pytest.approx(traced.image.mean(), rel=0.15)
    powers = [light.spot_histogram.sum(axis=1) for light in (guessed, traced)]
    np.testing.assert_allclose(powers[0], powers[1], rtol=0.1)


def test_in_fog_alone_as_much_is_scattered_again_as_in_light_traced():
    """At 30 m of visibility that is an eighth of all light; nothing else is guessed there."""
    fog = worlds.scene(worlds.plane(200.0, 0.01), extinction_per_m=0.1, albedo=0.99, g=0.8)
    guessed, traced = surrogate(fog, PAPER, seed=1), solve(fog, PAPER, spp=16, seed=2)
    assert guessed.image.sum() == pytest.approx(traced.image.sum(), rel=0.03)


def test_phasors_of_modulated_patterns_tell_the_same_ranges_as_the_light_traced():
    wall = worlds.scene(worlds.plane(4.0, 0.5))
    images = [
        simulate(wall, MODULATED, noise=False, seed=1, **light).transport.extra["phasors"]
        for light in ({"light": "surrogate"}, {"spp": 16})
    ]
    np.testing.assert_allclose(np.angle(images[0] / images[1]), 0, atol=0.01)


def test_paths_of_kilometres_are_told_by_the_long_wave():
    lengths = np.array([[0.0, 8.0], [800.0, 25_000.0]])
    waves = np.exp(2j * np.pi * LONG_HZ / 299792458 * lengths)
    np.testing.assert_allclose(mean_path_m(waves), lengths, atol=1e-6)


def test_equal_seeds_give_equal_light_and_others_do_not():
    wall = worlds.scene(worlds.plane(4.0, 0.5))
    first, again, other = (surrogate(wall, PAPER, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.image, again.image)
    np.testing.assert_array_equal(first.spot_histogram, again.spot_histogram)
    assert (first.image != other.image).any()


def test_captures_say_whose_light_is_in_them(tmp_path):
    wall = worlds.scene(worlds.plane(4.0, 0.5))
    for light, marked in (("surrogate", True), ("traced", False)):
        capture = simulate(wall, PAPER, light=light, spp=1, seed=1).capture
        write_capture(capture, tmp_path / f"{light}.h5")
        result = read_capture(tmp_path / f"{light}.h5")
        assert result.provenance.is_surrogate is marked
        assert load_yaml(result.provenance.settings, "settings")["light"]["source"] == light
        assert any("a fast surrogate" in each for each in capture_warnings(result)) is marked


def test_scenes_of_another_wavelength_are_refused():
    wall = worlds.scene(worlds.plane(4.0, 0.5))
    with pytest.raises(InputError, match="wavelength_nm 905"):
        surrogate(wall, PAPER.at_wavelength(905))

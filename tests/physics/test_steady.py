"""Steady light on detectors: right, and as well known as is told."""

from dataclasses import replace

import numpy as np
import pytest
from mitsuba_reference import Renderer, pattern_emitter

import spisim
import worlds
from spisim.scene import Ambient
from spisim.transport.daylight import STEADY_ERROR, daylight_power, projector_power
from spisim.transport.engine.ends import Projector
from spisim.transport.world import build_world

# isort: split
import drjit as dr
import mitsuba as mi

VIEW = worlds.projector(shape=(8, 8))
#: One looks along the projector's axis, one past it.
ENDS = worlds.detector(
    [[0.05, 0, 0], [0, 0.1, 0]], [[0, 0, 1], [0.1, 0, 1]], area_m2=2e-6, half_angle_deg=6
)
EVEN = np.full(VIEW.shape, 2.0 / VIEW.pixels)
SUNNY = Ambient(sun_klx=20.0, sky_klx=10.0, sun_direction=(0.0, 0.6, 0.8))
PAPER = spisim.load_instrument("paper")


def foggy(extinction):
    return worlds.scene(*worlds.room(), extinction_per_m=extinction, g=0.8, albedo=0.98)


@pytest.mark.parametrize("fog", [0.0, 0.3], ids=["clear", "fog bank"])
def test_the_projector_on_detectors_is_that_of_mitsuba(fog, reference):
    position = worlds.scene(*worlds.room(), volumes=worlds.bank(fog, g=0.6))
    world = build_world(position)
    ours = [projector_power(world, VIEW, EVEN, ENDS, target=0.01, seed=s) for s in worlds.seeds(8)]
    renderer = Renderer(position, {"projector": pattern_emitter(VIEW, 2.0 / VIEW.pixels)})
    theirs = reference(
        f"projector on detectors by Mitsuba, extinction {fog}",
        lambda seeds: [renderer.power(ENDS, samples=2**15, seed=s) for s in seeds],
        8,
    )
    assert np.all(np.abs(theirs.z_score([each.power_w for each in ours])) < 4)


def test_an_uneven_picture_is_the_sum_of_its_pixels():
    """Light of the left half, and of the right half."""
    world = build_world(foggy(0.1))
    left = np.where(np.arange(8) < 4, EVEN, 0)

    def result(power, start):
        seeds = worlds.seeds(start + 8)[start:]
        return [projector_power(world, VIEW, power, ENDS, seed=s).power_w for s in seeds]

    halves = np.add(result(left, 0), result(EVEN - left, 8))
    assert np.all(np.abs(worlds.z_score(halves, result(EVEN, 16))) < 4)


@pytest.mark.parametrize(
    ("source", "fog"),
    [
        ("projector", 0.1),
        pytest.param("projector", 0.6, marks=pytest.mark.slow),
        pytest.param("daylight", 0.1, marks=pytest.mark.slow),
    ],
)
def test_the_error_is_true_and_below_what_is_promised(source, fog):
    """χ² of 32 runs, of two detectors: its scatter is 18 %, and more where tails are long."""
    if source == "daylight":
        wall = worlds.plane(8.0, half_size_m=6)
        position = worlds.scene(wall, extinction_per_m=fog, g=0.8, albedo=0.98, ambient=SUNNY)
    else:
        position = foggy(fog)
    position = replace(position, wavelength_nm=PAPER.wavelength_nm)
    world = build_world(position)

    def received(seed):
        if source == "daylight":
            return daylight_power(position, PAPER, world, ENDS, seed=seed)
        return projector_power(world, VIEW, EVEN, ENDS, seed=seed)

    runs = [received(seed) for seed in worlds.seeds(32)]
    power, error = (np.array([getattr(each, n) for each in runs]) for n in ("power_w", "error_w"))
    assert np.all(error <= STEADY_ERROR * power)
    reduced = np.mean(power.var(axis=0, ddof=1) / np.mean(error**2, axis=0))
    assert 0.5 < reduced < 1.7


def test_light_that_is_there_anyway_saves_paths():
    world = build_world(foggy(0.3))
    seed = worlds.seeds(1)[0]
    fine = projector_power(world, VIEW, EVEN, ENDS, target=0.01, seed=seed)
    floor_w = 9 * fine.power_w.max()
    rough = projector_power(world, VIEW, EVEN, ENDS, floor_w=floor_w, target=0.01, seed=seed)
    assert np.all(rough.error_w > fine.error_w)
    assert np.all(rough.error_w <= 0.01 * (rough.power_w + floor_w))


def test_no_light_has_no_error():
    world = build_world(foggy(0.1))
    seed = worlds.seeds(1)[0]
    for none in (
        projector_power(world, VIEW, 0 * EVEN, ENDS, seed=seed),
        daylight_power(foggy(0.1), PAPER, world, ENDS, seed=seed),
    ):
        np.testing.assert_array_equal([none.power_w, none.error_w], np.zeros((2, 2)))


@pytest.mark.parametrize("lens_radius_m", [0.0, 0.05])
def test_the_lit_part_of_a_ray_is_where_the_projector_looks(lens_radius_m):
    pose = worlds.pose_at((0.3, -0.2, 0.1))
    pose[:3, :3] = np.array([[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]])
    view = replace(worlds.projector(30, pose=pose), lens_radius_m=lens_radius_m, focus_m=4.0)
    end = Projector.of(view, 1)
    rng = np.random.default_rng(0)
    rays = 4096
    direction = rng.normal(size=(3, rays))
    direction /= np.linalg.norm(direction, axis=0)
    ray = mi.Ray3f(mi.Point3f(rng.uniform(-2, 2, (3, rays))), mi.Vector3f(direction))
    near, far = end.overlap(ray, mi.Float(10.0))
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(1, rays)
    distance = mi.Float(rng.uniform(0, 10, rays))
    seen = (end.connect(dr.arange(mi.UInt32, rays), ray(distance), sampler).importance > 0).numpy()
    inside = ((near <= distance) & (distance <= far)).numpy()
    assert 50 < seen.sum() < 1000
    assert not np.any(seen & ~inside)
    if lens_radius_m == 0:
        assert not np.any(inside & ~seen)

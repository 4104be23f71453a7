"""One answer from four methods: two-ended, either end alone, and Mitsuba pattern by pattern.

An end alone has heavy tails in fog, for the rare path that scatters right before the other end;
it gets more paths so that the normal law holds for its means.
"""

from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest

import worlds
from reconstruction.operators import expose, illumination, make_plan
from spisim.transport.engine.estimator import Strategy
from spisim.transport.world import build_world

RUNS = range(10)
SEEDS = worlds.seeds_of(RUNS)
POSITIONS = np.array([[0.05, 0.0, 0.0], [-0.2, 0.1, 0.0]])
AXES = np.array([[0.0, 0.0, 1.0], [0.08, 0.0, 1.0]])
PLAN = make_plan((16, 16), 4, polarity="single-ended")
PATHS = {Strategy.BOTH: 160, Strategy.PROJECTOR: 2048, Strategy.DETECTOR: 4096}
#: In clear air the slow tier compares the ends; against Mitsuba, `test_surfaces` does.
EXTINCTIONS = [pytest.param(0.0, marks=pytest.mark.slow), 0.1]


def fog(extinction):
    return {"extinction_per_m": extinction, "g": 0.85, "albedo": 0.98}


def looking(*numbers):
    """One detector or both of them."""
    return worlds.detector(POSITIONS[[*numbers]], AXES[[*numbers]], area_m2=2e-6, half_angle_deg=10)


def test_in_clear_air_what_detectors_see_is_joined_to_walks_as_well():
    """In a corner, where joined places may be arbitrarily close to each other."""
    corner = worlds.plane(4.0, 0.8, 0.7, 4.0), worlds.plane(4.0, 0.6, -0.8, 4.0)
    world, view = build_world(worlds.scene(*corner)), worlds.projector(shape=(8, 8))
    assert world.plain
    runs = {
        strategy: np.array(
            [
                worlds.image(world, view, looking(0, 1), paths, s, strategy=strategy)
                for s in worlds.seeds(24)
            ]
        )
        for strategy, paths in ((Strategy.BOTH, 64), (Strategy.PROJECTOR, 256))
    }
    both, alone = (images.reshape(24, -1) for images in runs.values())
    once = np.array(
        [worlds.image(world, view, looking(0, 1), 256, s, max_vertices=1) for s in worlds.seeds(24)]
    ).reshape(24, -1)
    assert both.mean() > 1.1 * once.mean()  # there is light from one wall to the other
    for pattern in (np.ones(64), np.tile([1, -1], 32), np.repeat([1, -1], 32)):
        assert abs(worlds.z_score(both @ pattern, alone @ pattern)) < 4
    # Of as many paths, those from the projector alone have twice the variance.
    assert 4 * alone.var(axis=0).sum() > 1.6 * both.var(axis=0).sum()


@cache
def place(extinction):
    return worlds.scene(*worlds.room(), **fog(extinction))


@cache
def readings(extinction, strategy, seeds=RUNS, ends=(0, 1)):
    """Of detectors together, which look at different places, (seeds, exposures)."""
    world, view, paths = build_world(place(extinction)), worlds.projector(), PATHS[strategy]
    images = [
        worlds.image(world, view, looking(*ends), paths, s, strategy=strategy)
        for s in worlds.seeds_of(seeds)
    ]
    return expose(PLAN, np.array(images))


LIT = slice(0, -1)  # the last pattern is dark


@pytest.mark.parametrize("extinction", EXTINCTIONS)
def test_bucket_readings(extinction, reference):
    both = readings(extinction, Strategy.BOTH)
    assert np.all(both[:, -1] == 0)
    for alone in (Strategy.PROJECTOR, Strategy.DETECTOR):
        other = reference(
            f"bucket readings by the {alone.value} alone, extinction {extinction}",
            lambda seeds, alone=alone: readings(extinction, alone, seeds)[:, LIT],
            len(RUNS),
        )
        assert np.all(np.abs(other.z_score(both[:, LIT])) < 4)
    # The comparison is sharp enough to matter.
    assert np.all(both[:, LIT].std(axis=0) < 0.06 * both[:, LIT].mean(axis=0))


@pytest.mark.parametrize("extinction", EXTINCTIONS)
def test_bucket_readings_against_mitsuba(extinction, reference):
    """Of a bank of fog, for the sake of Mitsuba's variance; an error of 3 % would be found."""
    place = worlds.scene(*worlds.room(), volumes=worlds.bank(extinction, albedo=0.98, g=0.85))
    world, view, ends = build_world(place), worlds.projector(), looking(0, 1)
    patterns = [illumination(PLAN, k) for k in range(PLAN.exposures - 1)]
    mitsuba = reference(
        f"bucket readings by Mitsuba, extinction {extinction}",
        lambda runs: with_total(
            worlds.mitsuba_readings(place, view, ends, patterns, runs, samples=2**14)
        ),
        20,
    )
    images = np.array([worlds.image(world, view, ends, 32, s) for s in SEEDS])
    both = with_total(expose(PLAN, images)[:, LIT])
    assert np.all(np.abs(mitsuba.z_score(both)) < 4)
    for error in (0.97, 1.03):
        assert abs(mitsuba.z_score(both, error)[-1]) > 4


def with_total(readings):
    """Readings (runs, exposures) and, last, their sum."""
    return np.column_stack([readings, readings.sum(axis=1)])


@pytest.mark.parametrize("extinction", EXTINCTIONS)
def test_detectors_together_receive_what_each_of_them_does(extinction, reference):
    def trace(seeds):
        """One, the other, and their sum."""
        one, other = (
            readings(extinction, Strategy.BOTH, range(first, first + len(seeds)), ends)[:, LIT]
            for ends, first in (((0,), 1000 + seeds.start), ((1,), 2000 + seeds.start))
        )
        return np.stack([one, other, one + other], axis=1)

    apart = reference(f"readings of each detector, extinction {extinction}", trace, len(RUNS))
    pair = readings(extinction, Strategy.BOTH)[:, LIT]
    assert np.all(np.abs(apart.z_score(pair)[2]) < 4)
    assert np.max(np.abs(apart.mean[0] / apart.mean[1] - 1)) > 0.2  # unlike each other


@pytest.mark.parametrize(
    ("extinction", "width"),
    [
        pytest.param(0.0, {}, marks=pytest.mark.slow, id="pencils in clear air"),
        pytest.param(0.1, {"divergence_rad": 0.02, "waist_m": 0.005}, id="wide beams in fog"),
    ],
)
def test_spot_histograms(extinction, width, reference):
    world = build_world(place(extinction))
    headings = np.array([[0.08, 0.08, 1.0], [-0.08, -0.08, 1.0], [0.1, 0.1, 1.0]])
    beams = replace(worlds.beams(*headings), **width)
    tof = worlds.detector(np.repeat([[0.05, 0, 0]], 3, axis=0), headings, half_angle_deg=6)
    phasor = np.exp(2j * np.pi * np.arange(2000) * 0.02 / 20)

    def moments(strategy, samples, seeds):
        """Power and phase of every spot."""
        runs = []
        for seed in worlds.seeds_of(seeds):
            histogram = worlds.histogram(
                world, beams, tof, (2000, 0.02), samples, seed, strategy=strategy
            )
            runs.append([histogram.sum(axis=1), (histogram @ phasor).real])
        return np.array(runs)

    both = moments(Strategy.BOTH, 2**14, RUNS)
    for alone, samples in ((Strategy.PROJECTOR, 2**17), (Strategy.DETECTOR, 2**15)):
        other = reference(
            f"spots by the {alone.value} alone, extinction {extinction}",
            partial(moments, alone, samples),
            len(RUNS),
        )
        assert np.all(np.abs(other.z_score(both)) < 4)


def test_swapping_the_ends_changes_nothing():
    """Reciprocity: two ends look into a foggy room from different places, then trade places.

    The projector's square field is filled so that it emits into the detector's cone, with the
    detector's cosine law.
    """
    world = build_world(place(0.1))
    here, there = np.array([-0.6, 0.2, 0.0]), np.array([0.7, -0.1, 0.5])
    look_here, look_there = np.array([0.2, 0.0, 1.0]), np.array([-0.15, 0.05, 1.0])
    half_angle_deg = 5.0
    cone = np.tan(np.radians(half_angle_deg))

    field = worlds.projector(2 * half_angle_deg, (32, 32))
    power = worlds.pixel_weights(
        field, lambda x, y: np.where(np.hypot(x, y) < cone, (1 + x**2 + y**2) ** -2, 0)
    )

    def transport(source, source_axis, sensor, sensor_axis, seed):
        view = replace(field, pose=_pose(source, source_axis))
        end = worlds.detector(sensor, sensor_axis, 1e-6, half_angle_deg)
        return np.sum(power * worlds.image(world, view, end, 48, seed))

    out = [transport(here, look_here, there, look_there, s) for s in SEEDS]
    back = [transport(there, look_there, here, look_here, s) for s in worlds.seeds(20)[10:]]
    assert abs(worlds.z_score(out, back)) < 4
    assert np.std(out) < 0.01 * np.mean(out)


def test_a_world_may_be_far_from_its_origin():
    """Single precision has 0.1 mm left there: dense fog scatters light where the lens is."""

    def transport(offset):
        wall = worlds.plane(5.0, half_size_m=5)
        wall.mesh.apply_translation(offset)
        pose = worlds.pose_at(offset)
        foggy = replace(worlds.scene(wall, extinction_per_m=1.0, g=0.8), drone_pose=pose)
        end = worlds.detector(np.add(offset, [0.05, 0, 0]), half_angle_deg=20)
        view = worlds.projector(20, (8, 8), pose)
        return worlds.image(build_world(foggy), view, end, 1024, SEEDS[0]).sum()

    assert transport(np.full(3, 1e3)) == pytest.approx(transport(np.zeros(3)), rel=3e-3)


def _pose(position, axis):
    forward = axis / np.linalg.norm(axis)
    right = np.cross([0.0, 1.0, 0.0], forward)
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    pose[:3, 3] = position
    return pose

"""Paths that end early, by chance, in a medium that absorbs next to nothing."""

import numpy as np
import pytest

import worlds
from spisim.transport import media
from spisim.transport.daylight import DAYLIGHT_ENDING
from spisim.transport.engine import walk_state
from spisim.transport.engine.apertures import Detectors
from spisim.transport.engine.lights import Sun
from spisim.transport.engine.tally import ImageTally, Tallies
from spisim.transport.engine.walk import MAX_VERTICES, Walk
from spisim.transport.engine.weights import alone
from spisim.transport.world import build_world

# isort: split
import drjit as dr
import mitsuba as mi

#: The instrument in the middle of a ball of fog of optical depth 15.
FOG = worlds.scene(worlds.plane(0.5, half_size_m=0.01), extinction_per_m=1.0, albedo=0.99)
PATHS = 2**13


@pytest.fixture(scope="module")
def fog():
    return build_world(FOG)


def under_a_sky(world, seed, deposit=None):
    """Power on a detector inside the fog under a sky of radiance 1 all round."""
    ends = Detectors.of(worlds.detector(half_angle_deg=60), PATHS)
    tallies = Tallies(1, [ImageTally])
    night = Sun(mi.Float(0), mi.Vector3f(0, 0, 1), mi.Float(100))
    Walk(
        world,
        ends,
        night,
        False,
        alone,
        deposit or tallies.add,
        sky=lambda direction: mi.Float(1),
        ending=DAYLIGHT_ENDING,
    ).run(seed)
    (sums,) = tallies.read(1.0).values
    return sums["image"][0]


def test_no_path_carries_more_than_at_its_start(monkeypatch):
    """But for what a first flight without a collision weighs more, where it is biased."""
    monkeypatch.setattr(media, "BIAS", 1.0)
    fog = build_world(FOG)
    maximum = dr.zeros(mi.Float, 1)

    def remember(light):
        dr.scatter_reduce(dr.ReduceOp.Max, maximum, light.value, mi.UInt32(0), light.active)

    under_a_sky(fog, 0, remember)
    start = np.pi * np.sin(np.radians(60)) ** 2 / PATHS
    assert 0.9 * start < maximum.numpy()[0] <= start * (1 + 1e-4)


def without_roulette(monkeypatch):
    """Paths then end where they leave the fog."""
    monkeypatch.setattr(walk_state, "ROULETTE_VERTEX", MAX_VERTICES)


def test_roulette_leaves_the_error_of_daylight_as_it_is(fog, monkeypatch):
    """Survival all the way down to nothing would make it 2.5 times as large."""

    def runs():
        return np.array([under_a_sky(fog, seed) for seed in range(1, 49)])

    ended = runs()
    without_roulette(monkeypatch)
    retained = runs()
    assert abs(worlds.z_score(ended, retained)) < 4
    assert ended.std(ddof=1) / retained.std(ddof=1) < 1.4  # known to 15 %


def test_roulette_leaves_the_error_of_an_image_as_it_is(fog, monkeypatch):
    view, end = worlds.projector(shape=(8, 8)), worlds.detector([0.05, 0, 0], half_angle_deg=20)

    def error():
        images = np.array([worlds.image(fog, view, end, 16, seed) for seed in worlds.seeds(16)])
        return np.sqrt(images.var(axis=0, ddof=1).sum())

    ended = error()
    without_roulette(monkeypatch)
    assert ended / error() < 1.3

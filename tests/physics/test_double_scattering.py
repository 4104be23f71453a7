"""Light that fog and a surface scatter once each: that of the walks, without their chance."""

from dataclasses import replace

import numpy as np
import pytest

import worlds
from spisim.atmosphere import Isotropic, explicit
from spisim.scene import Material, Scene, Volume
from spisim.scene.bsdf import Mirror
from spisim.transport.engine.apertures import JointDetectors
from spisim.transport.engine.double_scattering import double_scattering_light
from spisim.transport.engine.ends import Projector
from spisim.transport.engine.estimator import Strategy
from spisim.transport.world import build_world

SEEDS = worlds.seeds(20)
VIEW = worlds.projector(shape=(8, 8))
BLOCKS = np.kron(np.eye(16), np.ones(4))  # four pixels each, next to each other
ASIDE = worlds.detector([[0.3, 0.05, 0.0], [-0.1, 0.0, 0.2]], [[0.0, 0.0, 1.0]] * 2)


#: From 1 m on, so that paths of one end have a finite variance.
FOG = worlds.bank(0.1, 0.95, 0.85)


def grazing() -> Scene:
    """A floor that is seen at a few degrees: fog behind a place on it shines back upon it."""
    return worlds.scene(worlds.plane(6.0, tilt_rad=np.deg2rad(80)), volumes=FOG)


def mixed() -> Scene:
    """Two media in one place, one of them with a grid, that scatter unlike each other."""
    lattice = np.random.default_rng(1).uniform(0.2, 1, (3, 4, 5))
    cloud = Volume(
        "cloud", explicit(0.4, 0.8, Isotropic()), worlds.box_pose((3, 3, 2), (0, 0, 2)), lattice
    )
    return worlds.scene(*worlds.room(), volumes=(*FOG, cloud))


def mirrored() -> Scene:
    """A mirror does not scatter; what it shows has met more than two vertices."""
    fold = worlds.plane(3.0, tilt_rad=0.3, half_size_m=0.4)
    mirror = replace(fold, material=Material("mirror", 0.9, "test", Mirror()))
    return worlds.scene(*worlds.room(), mirror, volumes=FOG)


@pytest.mark.parametrize("position", [grazing, pytest.param(mixed, marks=pytest.mark.slow)])
def test_light_scattered_twice_is_that_of_walks_from_the_projector(position) -> None:
    both, alone = (
        images(build_world(position()), paths, strategy=strategy, max_vertices=2)
        for strategy, paths in ((Strategy.BOTH, 64), (Strategy.PROJECTOR, 2**12))
    )
    agree(alone, both)
    assert abs(worlds.z_score(0.95 * alone.sum(axis=1), both.sum(axis=1))) > 4  # 5 % is found


@pytest.mark.slow
@pytest.mark.parametrize("position", [grazing, mixed, mirrored])
def test_all_light_is_that_of_walks_alone(position) -> None:
    """Where surfaces let light through, walks find all of it; here none does."""
    world = build_world(position())
    walked = replace(world, geometry=replace(world.geometry, see_through=True))
    agree(images(walked, 1024), images(world, 256))


def test_a_wide_aperture_in_fog_is_one_place_at_a_time() -> None:
    """Fog right before it: where X may lie depends on the place on the aperture."""
    wide = worlds.detector([0.0, 0.0, 0.0], area_m2=5e-2, half_angle_deg=20)
    hazy = worlds.scene(worlds.plane(1.0), extinction_per_m=0.3, g=0.5)
    world = build_world(hazy)
    walked = replace(world, geometry=replace(world.geometry, see_through=True))
    there, expected = (
        [worlds.image(each, VIEW, wide, paths, seed, max_vertices=2).sum() for seed in SEEDS]
        for each, paths in ((world, 64), (walked, 256))
    )
    assert abs(worlds.z_score(there, expected)) < 4
    assert abs(worlds.z_score(np.multiply(0.99, there), expected)) > 4  # 1 % is found


def images(world, paths, **options):
    """(seeds, pixels)."""
    each = [worlds.image(world, VIEW, ASIDE, paths, seed, **options) for seed in SEEDS]
    return np.array(each).reshape(len(each), -1)


def agree(first, second) -> None:
    assert np.all(np.abs(worlds.z_score(first @ BLOCKS.T, second @ BLOCKS.T)) < 4.5)
    assert abs(worlds.z_score(first.sum(axis=1), second.sum(axis=1))) < 4


def test_no_lane_is_ever_bright() -> None:
    """Behind a wall ρ/π, at most π ρ/π σ / L of the longest way L; a walk has no such bound."""
    wall = worlds.plane(4.0, reflectance=0.5)
    hazy = replace(worlds.scene(wall), atmosphere=explicit(0.05, 1.0, Isotropic()))
    end = worlds.detector([0.05, 0.0, 0.0])
    result = []
    near, far = Projector.of(VIEW, 256), JointDetectors.of(end, 1)
    double_scattering_light(build_world(hazy), near, far, 1, result.append)
    behind = result[0]
    value = behind.value.numpy()[behind.active.numpy()] * 256
    assert len(value) > 0.9 * near.lanes
    assert 0.2 < value.max() / (0.5 * 0.05 / 4.0) < 1

"""Lamps and media in meshes against Mitsuba's `volpath`, pixel by pixel."""

from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
import trimesh
from mitsuba_reference import Renderer
from scipy import stats

import worlds
from spisim.atmosphere import HenyeyGreenstein, explicit
from spisim.scene import Material, SceneObject, Volume
from spisim.scene.bsdf import RoughDielectric, ThinPane
from spisim.scene.lamps import AreaLamp, EnvironmentLamp, PointLamp, Strength
from spisim.transport.backend import activate
from spisim.transport.engine.ends import Projector
from spisim.transport.engine.gather import Gather
from spisim.transport.engine.sampling import PathBudget, repeat
from spisim.transport.engine.tally import ImageTally, Tallies
from spisim.transport.lamps import lamps_in_band
from spisim.transport.world import build_world

VIEW = worlds.projector(40.0, (8, 8))
PICTURES, OURS, THEIRS = 16, 256, 512
LEVEL = 0.001


def torus():
    mesh = trimesh.creation.torus(0.6, 0.3, major_sections=24, minor_sections=12)
    return mesh.apply_transform(
        trimesh.transformations.translation_matrix([0, 0, 3])
        @ trimesh.transformations.rotation_matrix(1.0, [1, 0.3, 0])
    )


def filled(shape, carrier=None, density=None):
    low, high = shape.bounds
    pose = worlds.box_pose(high - low, (low + high) / 2)
    medium = explicit(2.0, 0.9, HenyeyGreenstein(0.5))
    return Volume("fog", medium, pose, density, shape=shape, carrier=carrier)


def hall():
    """An environment with a window."""
    picture = np.full((8, 16), 0.3, np.float32)
    picture[2, 3:5] = 8.0
    turn = trimesh.transformations.rotation_matrix(0.8, [1, 2, 3])[:3, :3]
    return EnvironmentLamp("hall", watts(1.0), picture, turn)


def watts(amount):
    return Strength(amount, luminous=False)


def coated(name, mesh, bsdf):
    return SceneObject(name, mesh, Material(name, 0.0, "test", bsdf))


def grid_in_a_torus():
    density = np.random.default_rng(0).uniform(0, 1, (3, 4, 5)).astype(np.float32)
    wall = worlds.plane(4.0, 0.6, half_size_m=2.0)
    return worlds.scene(wall, volumes=[filled(torus(), density=density)]), (hall(),)


def lamp_in_thin_glass():
    vessel = coated("vessel", torus(), ThinPane(1.33))
    panel = trimesh.creation.box((0.4, 0.4, 0.1)).apply_translation((0.9, 0.5, 2.4))
    lamp = AreaLamp("panel", "panel", watts(5.0), float(panel.area))
    things = worlds.plane(4.0, 0.6), vessel, worlds.surface("panel", panel, 0.2)
    return worlds.scene(*things, volumes=[filled(vessel.mesh, vessel)]), (lamp,)


def spot_on_rough_glass():
    vessel = coated("vessel", torus(), RoughDielectric(0.3, 1.3))
    spot = PointLamp("spot", (0, -1.5, 1.5), watts(9.0), (0, 0.70710678, 0.70710678), 0.6, 0.4)
    things = worlds.plane(4.0, 0.6), vessel
    return worlds.scene(*things, volumes=[filled(vessel.mesh, vessel)]), (spot,)


def ours(position):
    world = build_world(position)
    lamps = lamps_in_band(position, 1.0, world)

    def launch(samples, seeds, replicas):
        tallies = Tallies(VIEW.pixels, [ImageTally])
        Gather(world, Projector.of(VIEW, samples), lamps, tallies.add).run(seeds[0])
        return tallies.read(1.0)

    runs = worlds.seeds(PICTURES)
    paths = PathBudget(OURS, min_launches=1)
    result = [repeat(launch, paths, VIEW.pixels, seed, None) for seed in runs]
    return np.array([each.mean["image"] for each in result])


def theirs(position):
    activate()
    renderer, lanes = Renderer(position), THEIRS * VIEW.pixels
    pictures = []
    for seed in range(PICTURES):
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(dr.opaque(mi.UInt32, 1000 + seed), lanes)
        ray, _ = Projector.of(VIEW, THEIRS).pencil(dr.arange(mi.UInt32, lanes), sampler)
        radiance = renderer.radiance(ray.o, ray.d, sampler).numpy()
        pictures.append(radiance.reshape(THEIRS, -1).mean(axis=0))
    return np.array(pictures)


@pytest.mark.slow
@pytest.mark.parametrize("make", [grid_in_a_torus, lamp_in_thin_glass, spot_on_rough_glass])
def test_pictures_are_mitsubas(make):
    """Welch's test of every pixel, with Šidák's correction, and of the whole picture."""
    position, lamps = make()
    position = replace(position, lamps=lamps)
    first, second = ours(position), theirs(position)
    p = stats.ttest_ind(first, second, axis=0, equal_var=False).pvalue
    assert np.nanmin(p) > 1 - (1 - LEVEL) ** (1 / p.size)
    whole = stats.ttest_ind(first.mean(axis=1), second.mean(axis=1), equal_var=False).pvalue
    assert whole > LEVEL
    assert first.mean() == pytest.approx(second.mean(), rel=0.05)

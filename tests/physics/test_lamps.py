"""Lamps against closed forms: form factors, single scattering, furnaces."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.integrate import quad

import worlds
from spisim.atmosphere import HenyeyGreenstein, Isotropic, explicit
from spisim.scene import Material, SceneObject, Volume
from spisim.scene.bsdf import Dielectric, ThinPane
from spisim.scene.lamps import (
    AreaLamp,
    DirectionalLamp,
    EnvironmentLamp,
    PointLamp,
    Strength,
    solid_angle,
)
from spisim.transport.daylight import _received
from spisim.transport.engine.ends import Projector
from spisim.transport.engine.gather import Gather
from spisim.transport.engine.sampling import PathBudget, repeat
from spisim.transport.engine.tally import ImageTally, Tallies
from spisim.transport.lamps import lamps_in_band
from spisim.transport.world import build_world

SEEDS = worlds.seeds(8)
NARROW = worlds.projector(0.01, (1, 1))


def watts(amount):
    return Strength(amount, luminous=False)


def with_lamps(position, *lamps):
    return replace(position, lamps=lamps)


def seen(position, view=NARROW, spp=2**13, **options):
    """Radiance of each pixel, by seed."""
    world = build_world(position)
    lamps = lamps_in_band(position, 1.0, world)

    def launch(samples, seeds, replicas):
        tallies = Tallies(view.pixels, [ImageTally])
        Gather(world, Projector.of(view, samples), lamps, tallies.add).run(seeds[0], **options)
        return tallies.read(1.0)

    result = [
        repeat(launch, PathBudget(spp, min_launches=1), view.pixels, seed, None) for seed in SEEDS
    ]
    return np.array([each.mean["image"].reshape(view.shape) for each in result])


def received(position, detectors):
    """Power on detectors, W, and its error."""
    world = build_world(position)
    lamps = lamps_in_band(position, 1.0, world)

    def trace(ends, samples, seeds, replicas, deposit):
        Gather(world, ends, lamps, deposit, replicas).run(seeds[0])

    return _received(trace, detectors, 0.0, 0.005, SEEDS[0], ())


def rectangle(name, size, centre, normal_z=1.0, reflectance=0.0):
    """Across the z axis, facing along it or back."""
    x, y = np.array(size) / 2
    mesh = trimesh.Trimesh([[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0]], [[0, 1, 2], [0, 2, 3]])
    if normal_z < 0:
        mesh.invert()
    mesh.apply_translation(centre)
    return worlds.surface(name, mesh, reflectance)


def assert_is(runs, expected, rel=0.02):
    assert abs(worlds.z_score_exact(np.ravel(runs), expected)) < 4
    assert np.mean(runs) == pytest.approx(expected, rel=rel)


def test_area_lamp_over_a_plane():
    """The form factor from a point to a parallel rectangle above one of its corners, four times."""
    board = worlds.plane(4.0, 0.6)
    lamp = rectangle("panel", (1.2, 0.8), (0, 0, 3.0), 1.0)
    # seen past the lamp: a camera beside it that looks at the point below its middle
    pose = worlds.pose_at((0, 0, 3.5))
    position = with_lamps(worlds.scene(board, lamp), AreaLamp("a", "panel", watts(5.0), 0.96))
    a, b = 0.6, 0.4
    x, y = a / np.hypot(1, a), b / np.hypot(1, b)
    factor = (x * np.arctan(b / np.hypot(1, a)) + y * np.arctan(a / np.hypot(1, b))) / (2 * np.pi)
    view = replace(NARROW, pose=pose)
    assert_is(seen(position, view), 0.6 / np.pi * 5.0 * np.pi * 4 * factor)


def test_area_lamp_is_bright_in_front_alone():
    """And as bright as told, from any distance; from behind it is dark."""
    for distance in (1.0, 3.0):
        panel = rectangle("panel", (1, 1), (0, 0, distance), -1.0)
        position = with_lamps(worlds.scene(panel), AreaLamp("a", "panel", watts(7.0), 1.0))
        np.testing.assert_allclose(seen(position, spp=64), 7.0, rtol=1e-5)
    panel = rectangle("panel", (1, 1), (0, 0, 1), 1.0)
    position = with_lamps(worlds.scene(panel), AreaLamp("a", "panel", watts(7.0), 1.0))
    assert (seen(position, spp=64) == 0).all()


def test_joins_and_hits_find_the_same_light():
    """A wall beside a large lamp: half of the light each way; and through a pane."""
    board = worlds.plane(4.0, 0.6)
    for extra in ((), (pane(2.0),)):
        panel = rectangle("panel", (30, 30), (0, 0, -0.5), 1.0)
        position = with_lamps(
            worlds.scene(board, panel, *extra), AreaLamp("a", "panel", watts(1.0), 900.0)
        )
        result = seen(position, max_vertices=1)
        a = b = 15 / 4.5
        x, y = a / np.hypot(1, a), b / np.hypot(1, b)
        factor = (x * np.arctan(b / np.hypot(1, a)) + y * np.arctan(a / np.hypot(1, b))) * 2 / np.pi
        if not extra:
            assert_is(result, 0.6 * factor)
        else:  # twice through the pane, and its own reflection of the lamp
            assert 0.9 * 0.6 * factor < result.mean() < 0.6 * factor


def pane(distance):
    thing = worlds.plane(distance)
    return SceneObject("pane", thing.mesh, Material("pane", 0.0, "test", ThinPane(1.5)))


def test_point_lamp_on_a_plane():
    """ρ/π · I cosθ / d²."""
    lamp = PointLamp("p", (0.7, 0.0, 2.0), watts(3.0))
    position = with_lamps(worlds.scene(worlds.plane(4.0, 0.6)), lamp)
    squared = 0.7**2 + 2.0**2
    np.testing.assert_allclose(
        seen(position, spp=256, max_vertices=1).mean(),
        0.6 / np.pi * 3 * 2 / squared**1.5,
        rtol=1e-3,
    )


def test_spot_lamp_falls_off_in_its_cone():
    for x, fraction in ((0.0, 1.0), (np.tan(0.3), 1.0), (np.tan(0.4), 0.5), (np.tan(0.51), 0.0)):
        lamp = PointLamp("s", (x, 0.0, 3.0), watts(3.0), (0, 0, 1), 0.5, 0.3)
        position = with_lamps(worlds.scene(worlds.plane(4.0, 0.6)), lamp)
        expected = 0.6 / np.pi * 3 * fraction / (1 + x * x) ** 1.5
        assert seen(position, spp=256).mean() == pytest.approx(expected, rel=3e-3, abs=1e-9)


def test_power_of_a_spot_is_its_integral():
    def falloff(angle):
        return np.clip((0.9 - angle) / 0.4, 0, 1) * 2 * np.pi * np.sin(angle)

    assert solid_angle(0.9, 0.5) == pytest.approx(quad(falloff, 0, 0.9, points=[0.5])[0], rel=1e-9)
    assert solid_angle(np.pi, np.pi) == pytest.approx(4 * np.pi)
    assert solid_angle(0.5, 0.5) == pytest.approx(2 * np.pi * (1 - np.cos(0.5)))


def test_directional_lamp():
    direction = np.array([0.6, 0.0, 0.8])
    lamp = DirectionalLamp("d", tuple(direction), watts(10.0))
    position = with_lamps(worlds.scene(worlds.plane(4.0, 0.6)), lamp)
    np.testing.assert_allclose(seen(position, spp=64), 0.6 / np.pi * 10 * 0.8, rtol=1e-4)


@pytest.mark.parametrize("shape", ["box", "mesh"])
def test_point_lamp_in_fog_single_scattering(shape):
    """σs p ∫ I e^{-σ(t + d(t))} / d(t)² dt along a ray that passes the lamp closely."""
    extinction, albedo, reach = 0.4, 0.7, 6.0
    phase = HenyeyGreenstein(0.5)
    lamp = PointLamp("p", (0.05, 0.0, 3.0), watts(2.0))
    box = trimesh.creation.box((8, 8, reach))
    box.apply_translation((0, 0, reach / 2))
    pose = worlds.box_pose((8, 8, reach), (0, 0, reach / 2))
    fog = Volume(
        "fog", explicit(extinction, albedo, phase), pose, shape=box if shape == "mesh" else "box"
    )
    position = with_lamps(worlds.scene(worlds.plane(20.0, 0.0), volumes=[fog]), lamp)

    def integrand(t):
        gap = np.hypot(0.05, 3.0 - t)
        cosine = (t - 3.0) / gap  # light travels from the lamp to the ray, then back along it
        value = phase.density(np.array([-cosine]))[0]
        return albedo * extinction * value * 2 * np.exp(-extinction * (t + gap)) / gap**2

    expected = quad(integrand, 0, reach, points=[2.9, 2.97, 3.0, 3.03, 3.1], limit=500)[0]
    runs = seen(position, spp=2**13, max_vertices=1)
    assert_is(runs, expected, rel=0.02)
    assert np.std(runs) < 0.05 * expected


FURNACE = {
    "ball": {"shape": "ball"},
    "mesh": {"shape": "mesh"},
    "mesh of a grid": {"shape": "mesh", "density": True},
    "behind glass": {"shape": "mesh", "bsdf": Dielectric(1.4)},
    "within glass": {"shape": "mesh", "bsdf": Dielectric(1.4), "carried": True},
}


@pytest.mark.parametrize("name", FURNACE)
def test_furnace(name):
    """Constant light all around, and nothing absorbs: everything is as bright as the light."""
    case = FURNACE[name]
    ball = trimesh.creation.icosphere(3, 0.8)
    ball.apply_translation((0, 0, 3))
    pose = worlds.box_pose((1.6, 1.6, 1.6), (0, 0, 3))
    density = None
    if case.get("density"):
        density = np.random.default_rng(0).uniform(0.2, 1, (3, 4, 5)).astype(np.float32)
    shape = ball if case["shape"] == "mesh" else "ball"
    things = [worlds.surface("far", trimesh.creation.icosphere(1, 0.05), 1.0)]
    things[0].mesh.apply_translation((0, 5, 0))
    if "bsdf" in case:
        things.append(SceneObject("glass", ball, Material("glass", 0.0, "test", case["bsdf"])))
    carrier = things[-1] if case.get("carried") else None
    medium = explicit(2.0, 1.0, Isotropic())
    milk = Volume("milk", medium, pose, density, shape=shape, carrier=carrier)
    position = worlds.scene(*things, volumes=[milk])
    position = with_lamps(position, EnvironmentLamp("e", watts(2.0), None, np.eye(3)))
    runs = seen(position, worlds.projector(40.0, (4, 4)), 512)
    assert runs.mean() == pytest.approx(2.0, rel=1e-4)
    if "bsdf" not in case:
        np.testing.assert_allclose(runs, 2.0, rtol=1e-5)


def test_environment_picture():
    """Irradiance on a plane is the integral of the picture; what is seen is what it says."""
    rng = np.random.default_rng(3)
    picture = rng.uniform(0, 1, (8, 16)).astype(np.float32)
    picture[2, 5] = 50.0  # a window
    turn = trimesh.transformations.rotation_matrix(0.8, [1, 2, 3])[:3, :3]
    lamp = EnvironmentLamp("e", watts(2.0), picture, turn)
    board = worlds.plane(4.0, 0.6, half_size_m=2.0)
    runs = seen(with_lamps(worlds.scene(board), lamp), spp=2**14)
    # linear between pixel centres, as the picture is read
    theta = (np.arange(800) + 0.5) * np.pi / 800
    phi = (np.arange(1600) + 0.5) * 2 * np.pi / 1600
    u, v = phi / (2 * np.pi) * 16 - 0.5, np.clip(theta / np.pi * 8 - 0.5, 0, 7)
    column, row = np.floor(u).astype(int), np.minimum(np.floor(v).astype(int), 6)
    fu, fv = (u - column)[None], (v - row)[:, None]
    left, right = column % 16, (column + 1) % 16
    fine = (picture[row][:, left] * (1 - fu) + picture[row][:, right] * fu) * (1 - fv)
    fine += (picture[row + 1][:, left] * (1 - fu) + picture[row + 1][:, right] * fu) * fv
    local = np.stack(
        [
            np.sin(theta)[:, None] * np.cos(phi),
            np.sin(theta)[:, None] * np.sin(phi),
            np.broadcast_to(np.cos(theta)[:, None], fine.shape),
        ],
        axis=-1,
    )
    cosine = np.maximum(-(local @ turn.T)[..., 2], 0)
    solid = np.sin(theta)[:, None] * (np.pi / 800) * (2 * np.pi / 1600)
    assert_is(runs, 0.6 / np.pi * 2 * np.sum(fine * cosine * solid))


def test_detectors_receive_lamps_by_the_inverse_square():
    """Straight from a point lamp and a small panel; a directional lamp in the field of view."""
    detector = worlds.detector(area_m2=1e-6, half_angle_deg=30)
    black = worlds.plane(50.0, 0.0)
    point = with_lamps(worlds.scene(black), PointLamp("p", (0.5, 0, 2.0), watts(3.0)))
    squared = 0.25 + 4
    expected = 3 * 1e-6 * 2 / squared**1.5
    assert received(point, detector).power_w[0] == pytest.approx(expected, rel=2e-3)
    panel = rectangle("panel", (0.5, 0.5), (0, 0, 2.0), -1.0)
    position = with_lamps(worlds.scene(black, panel), AreaLamp("a", "panel", watts(4.0), 0.25))
    x = 0.25 / 2
    factor = 4 * (x / np.hypot(1, x)) * np.arctan(x / np.hypot(1, x)) / np.pi
    result = received(position, detector)
    assert abs(result.power_w[0] - 4 * np.pi * factor * 1e-6) < 4 * result.error_w[0]
    assert result.error_w[0] < 0.006 * result.power_w[0]
    black = rectangle("black", (1, 1), (3, 0, -3))
    sun = with_lamps(worlds.scene(black), DirectionalLamp("d", (0, 0, -1), watts(2.0)))
    assert received(sun, detector).power_w[0] == pytest.approx(2e-6, rel=1e-4)
    behind = with_lamps(worlds.scene(black), DirectionalLamp("d", (0, 0, 1), watts(2.0)))
    assert received(behind, detector).power_w[0] == 0


def test_lumens_count_as_daylight():
    lamp = PointLamp("p", (0.0, 0.0, 2.0), Strength(1.5, luminous=True))
    position = with_lamps(worlds.scene(worlds.plane(4.0, 0.6)), lamp)
    lamps = lamps_in_band(position, 0.03, build_world(position))
    assert lamps.points.intensities.numpy()[0] == pytest.approx(0.045)

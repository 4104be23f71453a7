"""Fog that is not the same everywhere: against homogeneous fog, closed forms and Mitsuba."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.constants import c

import worlds
from reconstruction.operators import expose, illumination, make_plan
from spisim.atmosphere import Blend, HenyeyGreenstein, Isotropic, Tabulated, explicit
from spisim.scene import Volume
from spisim.transport.engine.estimator import transport_image
from spisim.transport.engine.outputs import Outputs
from spisim.transport.engine.sampling import PathBudget
from spisim.transport.engine.tally import PathLengthBins
from spisim.transport.engine.walk import lanes_and_sampler
from spisim.transport.media import BIAS_DEPTH
from spisim.transport.world import build_world

# isort: split
import drjit as dr
import mitsuba as mi

RUNS = range(8)
SEEDS = worlds.seeds_of(RUNS)
BASELINE = worlds.detector([0.05, 0.0, 0.0], area_m2=2e-6, half_angle_deg=14)
PLAN = make_plan((16, 16), 4, polarity="signed")
ROOM = (worlds.box_pose((6.2, 6.2, 12.2), (0, 0, 2)), (6, 6, 12))
HG = HenyeyGreenstein(0.7)


def volume(pose, extinction=0.1, albedo=0.98, phase=HG, density=None, name="bank"):
    return Volume(name, explicit(extinction, albedo, phase), pose, density)


def bumps(seed=0, shape=(5, 4, 6)):
    return np.random.default_rng(seed).uniform(0, 1, shape).astype(np.float32)


def readings(position, spp, runs=RUNS):
    world, view, seeds = build_world(position), worlds.projector(), worlds.seeds_of(runs)
    return np.array([expose(PLAN, worlds.image(world, view, BASELINE, spp, s)) for s in seeds])


def test_constant_grid_is_homogeneous_fog(reference):
    """Images, phasors and path lengths."""
    pose = ROOM[0]
    # The peak, and with it the rate of null collisions, lies in a corner outside the walls.
    density = np.full((40, 40, 40), 0.25, dtype=np.float32)
    density[0, 0, 0] = 1.0
    grid = volume(worlds.box_pose((12, 12, 24), (0, 0, 2)), 0.4, density=density)
    outputs = Outputs(frequencies_hz=(15e6,), bins=PathLengthBins(500, 0.1))
    view = worlds.projector(shape=(4, 4))

    def moments(position, paths, seeds):
        world, runs, paths = build_world(position), [], PathBudget(paths, min_launches=1)
        for seed in worlds.seeds_of(seeds):
            mean = transport_image(world, view, BASELINE, paths, seed=seed, outputs=outputs).mean
            cube = mean["histogram"].sum(axis=0)
            length = cube @ np.arange(500) * 0.1 / cube.sum()
            runs.append([mean["image"].sum(), *mean["phasors"].sum(axis=(0, 1)), length])
        return np.array(runs)

    homogeneous = worlds.scene(*worlds.room(), volumes=[volume(pose, 0.1)])
    heterogeneous = worlds.scene(*worlds.room(), volumes=[grid])
    everywhere = replace(worlds.scene(*worlds.room()), atmosphere=explicit(0.1, 0.98, HG))
    even = reference(
        "image, phasor and length in a box of fog", partial(moments, homogeneous, 4096), len(RUNS)
    )
    assert np.all(np.abs(even.z_score(moments(heterogeneous, 1024, range(20)))) < 4)
    # Without bounds the same paths carry the same light.
    few = (moments(position, 64, range(4)) for position in (homogeneous, everywhere))
    np.testing.assert_allclose(*few, rtol=1e-4)


def test_absorbing_grid_attenuates_by_its_optical_depth():
    """Ratio tracking against the integral along each ray, with all light straight."""
    density = bumps(3)
    pose = worlds.box_pose((4, 4, 2), (0, 0, 2.5))
    position = worlds.scene(
        worlds.plane(5.0, 0.5), volumes=[volume(pose, 0.5, albedo=0.0, density=density)]
    )
    narrow = worlds.projector(0.01, (1, 1))
    runs = [
        worlds.image(build_world(position), narrow, worlds.detector(), 2**14, s).item()
        for s in SEEDS
    ]
    z = np.linspace(0, 1, 20001)
    cells = density.shape[0]
    centres = (np.arange(cells) + 0.5) / cells
    # On the axis x = y = 1/2 of the box: linear between the four middle columns
    middle = (density[:, 1, 2] + density[:, 2, 2] + density[:, 1, 3] + density[:, 2, 3]) / 4
    depth = 0.5 * 2 * np.trapezoid(np.interp(z, centres, middle), z)
    closed = 0.5 * 1e-6 / (np.pi * 25) * np.exp(-2 * depth)
    assert abs(worlds.z_score_exact(runs, closed)) < 4
    assert np.mean(runs) == pytest.approx(closed, rel=0.02, abs=0)


BANK = worlds.box_pose((1.5, 2.0, 1.0), (0.1, 0.2, 3.0))


@pytest.mark.parametrize(
    ("pose", "density"),
    [
        pytest.param(BANK, None, id="bank", marks=pytest.mark.slow),
        pytest.param(BANK, bumps(), id="plume"),
    ],
)
def test_bounded_fog_against_mitsuba(pose, density, reference):
    position = worlds.scene(
        *worlds.room(), volumes=[volume(pose, 0.8, albedo=0.9, density=density)]
    )
    patterns = [illumination(make_plan((16, 16), 4, polarity="single-ended"), k) for k in range(4)]
    mitsuba = reference(
        f"fog bounded by a box, {'even' if density is None else 'uneven'}, by Mitsuba",
        lambda runs: worlds.mitsuba_readings(
            position, worlds.projector(), BASELINE, patterns, runs, samples=2**16
        ),
        len(RUNS),
    )
    ours = readings(position, 32)
    total = ours[:, :1]
    assert np.all(np.abs(mitsuba.z_score((total + ours) / 2)) < 4)
    # The engine knows the fog: a few of its paths find what many have found.
    few = worlds.mitsuba_readings(
        position, worlds.projector(), BASELINE, patterns[:1], RUNS, samples=2**12
    )
    assert abs(mitsuba.z_score(few)[0]) < 5


ECHO_AREA_M2, ECHO_EXTINCTION, ECHO_ALBEDO = 1e-9, 0.15, 0.9
ECHO_EDGES_M = np.array([0.5, 1.0, 2.0, 4.0, 8.0])


def echo(phase, paths, seeds):
    """Backscatter of a pencil between ranges, (seeds, ranges), over the phase function p(π)."""
    air, width = explicit(ECHO_EXTINCTION, ECHO_ALBEDO, phase), 0.01
    world = build_world(replace(worlds.scene(worlds.plane(40, 0.0)), atmosphere=air))
    detector = worlds.detector(area_m2=ECHO_AREA_M2)
    runs = []
    for seed in seeds:
        histogram = worlds.histogram(
            world, worlds.beams([0, 0, 1]), detector, (2000, width), paths, seed, max_vertices=1
        )[0]
        cumulative = np.cumsum(histogram) - histogram / 2  # up to the centre of each bin
        runs.append(np.diff(cumulative[np.rint(2 * ECHO_EDGES_M / width).astype(int)]))
    return np.array(runs) / float(phase.density(-1.0))


def test_single_scattering_echo():
    """A σs p(π) ∫ e^{-2σr} / r² dr = A σs p(π) [E₂(2σr₁)/r₁ - E₂(2σr₂)/r₂]"""
    from scipy.special import expn

    runs = echo(HG, 2**19, SEEDS)
    integral = -np.diff(expn(2, 2 * ECHO_EXTINCTION * ECHO_EDGES_M) / ECHO_EDGES_M)
    closed = ECHO_AREA_M2 * ECHO_ALBEDO * ECHO_EXTINCTION * integral
    assert np.all(np.abs(worlds.z_score_exact(runs, closed)) < 4)
    assert np.mean(runs, axis=0) == pytest.approx(closed, rel=0.02, abs=0)


@pytest.mark.parametrize(
    "phase",
    [
        Isotropic(),
        Tabulated(HG.density(np.linspace(-1, 1, 4001))),
        Blend(((0.6, HenyeyGreenstein(0.8)), (0.3, Isotropic()), (0.1, HenyeyGreenstein(-0.4)))),
    ],
    ids=["isotropic", "table", "blend"],
)
def test_the_single_scattering_echo_is_proportional_to_any_phase_function(phase):
    """The same rays find it, and the light of each is in proportion."""
    few = 2**12, SEEDS[:2]
    np.testing.assert_allclose(echo(phase, *few), echo(HG, *few), rtol=2e-5)


@pytest.mark.parametrize("towards", [1, -1])
def test_tables_reach_straight_on_and_straight_back(towards):
    """Rounding makes every fourth unit vector a little too long for a cosine of itself."""
    air = explicit(0.1, 1.0, Tabulated(HG.density(np.linspace(-1, 1, 4001))))
    media = build_world(replace(worlds.scene(worlds.plane(9.0)), atmosphere=air)).media
    drawn = np.random.default_rng(0).normal(size=(3, 10_000)).astype(np.float32)
    ray = dr.normalize(mi.Vector3f(drawn))
    assert (dr.dot(ray, ray).numpy() > 1).sum() > 1000
    density = media.phase(mi.UInt32(0), mi.Point3f(0), ray, towards * ray, mi.Bool(True))
    assert density.numpy() == pytest.approx(HG.density(np.array([float(towards)]))[0], rel=1e-4)


def test_two_media_in_one_place_add_up(reference):
    """The same phase function once by its formula and once by a table."""
    pose, table = ROOM[0], Tabulated(HG.density(np.linspace(-1, 1, 4001)))
    halves = [volume(pose, 0.05), volume(pose, 0.05, phase=table, name="other")]
    apart = worlds.scene(*worlds.room(), volumes=halves)
    together = worlds.scene(*worlds.room(), volumes=[volume(pose, 0.1)])
    whole = reference("readings in a box of fog", partial(readings, together, 256), len(RUNS))
    assert np.all(np.abs(whole.z_score(readings(apart, 128))) < 4)


def test_orders_of_scattering_add_up_and_unscattered_light_is_in_closed_form():
    position = replace(worlds.scene(worlds.plane(5.0, 0.5)), atmosphere=explicit(0.1, 0.98, HG))
    view, outputs = worlds.projector(shape=(8, 8)), Outputs(orders=True)
    world, runs = build_world(position), []
    for seed in SEEDS:
        mean = transport_image(
            world, view, BASELINE, PathBudget(256, min_launches=1), seed=seed, outputs=outputs
        ).mean
        np.testing.assert_allclose(mean["image_orders"].sum(axis=0), mean["image"], rtol=1e-9)
        runs.append(mean["image_orders"].sum(axis=1))
    unscattered = np.array(runs)[:, 0]

    def round_trip(x, y):
        point = np.stack([5 * x, 5 * y, np.full_like(x, 5.0)], axis=-1)
        back = point - [0.05, 0, 0]
        out, home = np.linalg.norm(point, axis=-1), np.linalg.norm(back, axis=-1)
        seen = back[..., 2] / home > np.cos(np.radians(14))
        return seen * (5.0 / home) ** 2 / home**2 * np.exp(-0.1 * (out + home))

    closed = worlds.pixel_weights(view, round_trip, 32).sum() / view.pixel_area * 0.5 * 2e-6 / np.pi
    assert abs(worlds.z_score_exact(unscattered, closed)) < 4
    assert unscattered.mean() == pytest.approx(closed, rel=0.02, abs=0)


def test_sum_and_spectrum_of_the_cube_are_image_and_phasors():
    position = replace(worlds.scene(*worlds.room()), atmosphere=explicit(0.1, 0.98, HG))
    frequency, bins = 15e6, PathLengthBins(8001, 0.02)
    outputs = Outputs(frequencies_hz=(frequency,), bins=bins)
    view = worlds.projector(shape=(4, 4))
    mean = transport_image(
        build_world(position), view, BASELINE, PathBudget(256, 1), seed=SEEDS[0], outputs=outputs
    ).mean
    np.testing.assert_allclose(mean["histogram"].sum(axis=1), mean["image"], rtol=1e-6)
    spectrum = mean["histogram"] @ np.exp(2j * np.pi * frequency / c * bins.centres_m)
    phasor = mean["phasors"][:, 0] @ [1, 1j]
    # Sharing light between bins damps a modulation of 1000 bins by 3e-6.
    np.testing.assert_allclose(spectrum, phasor, rtol=0, atol=1e-4 * np.abs(phasor).max())


@pytest.mark.parametrize("left_m", [0.0, 1.5, np.inf])
def test_flights_that_leave_an_end_collide_more_often_and_weigh_less(left_m):
    """Collisions before any distance, with each of two media, at the rate of light."""
    bank = volume(worlds.box_pose((4, 4, 2), (0, 0, 3)), extinction=0.2)
    position = replace(
        worlds.scene(worlds.plane(20.0), volumes=[bank]), atmosphere=explicit(0.1, 1, HG)
    )
    media, count, far = build_world(position).media, 2**17, 6.0
    ray = mi.Ray3f(mi.Point3f(0, 0, 0), mi.Vector3f(0, 0, 1))
    collision = media.flight(
        ray,
        mi.Float(far),
        lanes_and_sampler(count, 7)[1],
        mi.Bool(True),
        mi.Float(left_m),
    )
    met = collision.distance < far
    density = media.flight_density(
        ray, dr.minimum(collision.distance, far), collision.medium, met, left_m
    )
    distance, medium = np.minimum(collision.distance.numpy(), far), collision.medium.numpy()
    weight = np.broadcast_to(1 / density.numpy(), count)
    for edge in (1.0, 3.0, 5.0, 6.0):
        fog, inside = 0.1 * edge, 0.2 * np.clip(edge - 2, 0, 2)
        before = weight * ((distance < edge) & met.numpy())
        assert abs(worlds.z_score_exact(before, 1 - np.exp(-fog - inside))) < 4
    through = weight * ~met.numpy()
    assert abs(worlds.z_score_exact(through, np.exp(-1.0))) < 4
    # With the bank: 0.2 / m of 0.3 / m, from 2 m to 4 m
    with_bank = np.exp(-0.2) * (1 - np.exp(-0.6)) * 2 / 3
    assert abs(worlds.z_score_exact(weight * (medium == 1) * met.numpy(), with_bank)) < 4
    collided = met.numpy().mean() / (1 - np.exp(-1.0))
    assert (collided > 1.2) if np.isfinite(left_m) else (weight == 1).all()
    assert weight.max() < np.exp(2 * BIAS_DEPTH)

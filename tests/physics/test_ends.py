"""Lenses, vignetting, divergence, pattern shapes: extended ends against closed forms."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import trimesh

import worlds
from spisim.transport.engine.apertures import JointDetectors
from spisim.transport.engine.ends import Projector
from spisim.transport.engine.estimator import Strategy
from spisim.transport.engine.footprint import Footprint
from spisim.transport.engine.rays import FogRays
from spisim.transport.world import build_world

# isort: split
import drjit as dr
import mitsuba as mi

SEEDS = worlds.seeds(8)
DISTANCE = 5.0


@pytest.fixture(scope="module")
def plane_world():
    return build_world(worlds.scene(worlds.plane(DISTANCE, 0.5)))


@pytest.fixture(scope="module")
def edge_world():
    """Black left of the axis, white right of it."""
    right = worlds.plane(DISTANCE, 1.0, half_size_m=30)
    right.mesh.apply_translation([30, 0, 0])
    return build_world(worlds.scene(right))


@pytest.mark.parametrize("exponent", [1.0, 4.0])
@pytest.mark.parametrize("strategy", [Strategy.BOTH, Strategy.DETECTOR])
def test_vignetting_is_a_power_of_the_cosine(plane_world, exponent, strategy):
    view = worlds.projector(30, (8, 8))
    plain = worlds.detector(half_angle_deg=30)
    vignetted = replace(plain, vignetting=exponent)

    def closed(power):
        return worlds.pixel_weights(view, lambda x, y: (1 + x**2 + y**2) ** (-2 - power / 2)).sum()

    runs = [
        worlds.image(plane_world, view, vignetted, 1024, s, strategy=strategy).sum() for s in SEEDS
    ]
    expected = closed(exponent) / view.pixel_area * 0.5 * 1e-6 / (np.pi * DISTANCE**2)
    assert np.mean(runs) == pytest.approx(expected, rel=1e-4 if strategy is Strategy.BOTH else 0.02)
    if strategy is Strategy.DETECTOR:
        assert abs(worlds.z_score_exact(runs, expected)) < 4


def test_a_lens_is_sharp_at_its_focus_and_blurs_by_geometry_elsewhere(edge_world):
    view = worlds.projector(4, (1, 64))
    end = worlds.detector(half_angle_deg=10)

    def edge_width(lens_radius, focus):
        lens = replace(view, lens_radius_m=lens_radius, focus_m=focus)
        image = np.mean([worlds.image(edge_world, lens, end, 512, s)[0] for s in SEEDS], axis=0)
        centres = (2 * (np.arange(64) + 0.5) / 64 - 1) * view.tan_half_width
        profile = image / (1 + centres**2) ** -2
        # Second moment of the edge's derivative, in metres on the plane
        x = (np.arange(1, 64) / 32 - 1) * view.tan_half_width * DISTANCE
        slope = np.where(np.abs(x) < 0.08, np.diff(profile), 0)
        slope /= slope.sum()
        return np.sqrt(max(np.sum(slope * (x - np.sum(slope * x)) ** 2), 0))

    sharp = edge_width(0.02, DISTANCE)
    pixel = 2 * view.tan_half_width * DISTANCE / 64
    assert sharp < pixel
    # A disc of radius r |1 - z/f| has a standard deviation of half its radius along x.
    blurred = edge_width(0.02, 2.5)
    assert blurred == pytest.approx(np.hypot(0.02 * abs(1 - DISTANCE / 2.5) / 2, sharp), rel=0.1)


def test_a_lens_gives_the_same_light_from_either_end(reference):
    world = build_world(worlds.scene(*worlds.room(), extinction_per_m=0.1, g=0.6))
    view = replace(worlds.projector(), lens_radius_m=0.03, focus_m=3.0)
    end = worlds.detector([0.2, 0, 0], half_angle_deg=14)

    def totals(strategy, spp, seeds):
        """Of the image and of its left half."""
        images = (
            worlds.image(world, view, end, spp, s, strategy=strategy)
            for s in worlds.seeds_of(seeds)
        )
        return np.array([[image.sum(), image[:, :8].sum()] for image in images])

    both = totals(Strategy.BOTH, 64, range(len(SEEDS)))
    for alone in (Strategy.PROJECTOR, Strategy.DETECTOR):
        name = f"light of a lens by the {alone.value} alone"
        other = reference(name, partial(totals, alone, 1024), len(SEEDS))
        assert np.all(np.abs(other.z_score(both)) < 4)


def test_divergence_spreads_a_beam_without_losing_light():
    """On a target narrower than the footprint only its share of the beam returns."""
    from scipy.special import erf

    half = 0.02
    target = worlds.surface("target", trimesh.creation.box((2 * half, 20, 0.001)), 0.8)
    target.mesh.apply_translation([0, 0, DISTANCE + 0.0005])
    world = build_world(worlds.scene(target))
    divergence, waist = 3e-3, 0.01
    beam = replace(worlds.beams([0, 0, 1]), divergence_rad=divergence, waist_m=waist)
    end = worlds.detector(area_m2=1e-8, half_angle_deg=5)
    runs = [
        worlds.histogram(world, beam, end, (600, 0.02), 2**15, s, max_vertices=1).sum()
        for s in SEEDS
    ]
    spread = np.hypot(divergence * DISTANCE, waist)
    fraction = erf(half / spread / np.sqrt(2))
    closed = fraction * 0.8 * 1e-8 / (np.pi * DISTANCE**2)
    assert np.mean(runs) == pytest.approx(closed, rel=5e-3, abs=0)
    assert abs(worlds.z_score_exact(runs, closed)) < 5


def test_a_flight_that_ends_at_the_lens_has_a_density():
    """As one in 2^24 does: the place has no direction of its own, but the ray has."""
    world = build_world(worlds.scene(worlds.plane(DISTANCE), extinction_per_m=0.1))
    rays = FogRays(world, Projector.of(worlds.projector(), 1))
    ray = mi.Ray3f(mi.Point3f(0), mi.Vector3f(0, 0, 1))

    def density(distance):
        return rays.density(ray, mi.Float(distance), mi.Point3f(1, 0, 2)).numpy().item()

    assert density(0) == pytest.approx(density(1e-4), rel=1e-3)
    # W per pixel, times equi-angular density over extinction
    importance = 1 / (worlds.projector().pixel_area * 16 * 16)
    angle = np.pi / 2 + np.arctan(2)
    assert density(0) == pytest.approx(importance / (angle * 5) / 0.1, rel=1e-4)


@pytest.mark.parametrize("samples", [1, 16])
def test_places_of_a_footprint_are_as_likely_as_the_directions_to_them(plane_world, samples):
    """A field of half angle a has directions in proportion to their cosine, cos / (pi sin² a), of
    however many that are launched one is drawn."""
    half_angle_deg, lanes = 12.0, 64
    view = worlds.detector(half_angle_deg=half_angle_deg)
    detectors = JointDetectors.of(view, samples)
    footprint = Footprint(plane_world, detectors)
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(0, lanes)
    vertex = mi.Point3f(dr.full(mi.Float, 0.4, lanes), 0.1, 2.0)
    end, density = footprint.connect(vertex, sampler, mi.Bool(True))
    position = np.array(end.point).T
    out_m = np.linalg.norm(position, axis=1)
    gap = np.array([0.4, 0.1, 2.0]) - position
    gap_m = np.linalg.norm(gap, axis=1)
    normalised = 1 / (np.pi * np.sin(np.radians(half_angle_deg)) ** 2)
    cosine, on_the_way = position[:, 2] / out_m, -gap[:, 2] / gap_m  # the plane is across the axis
    per_area = normalised * cosine * cosine / out_m**2
    np.testing.assert_allclose(np.array(density), per_area * gap_m**2 / on_the_way, rtol=1e-3)
    seen = detectors.connect(mi.UInt32(0), vertex, sampler)
    distance_m = np.sqrt(0.4**2 + 0.1**2 + 2**2)
    expected = normalised * 2.0 / distance_m / distance_m**2
    np.testing.assert_allclose(np.array(footprint.density(seen)), expected, rtol=1e-3)


def test_rays_through_the_edge_of_the_field_have_a_density(plane_world):
    """Rounding may put them outside, which is no reason to find their light elsewhere alone."""

    class Corners:
        def next_1d(self):
            return mi.Float(0)

        def next_2d(self):
            return mi.Point2f(0)

    view = worlds.projector()
    end = Projector.of(view, 1)
    lane = dr.arange(mi.UInt32, end.lanes)
    launch = end.launch(lane, Corners())
    cosine = launch.direction.z.numpy()
    np.testing.assert_allclose(
        end.density(launch, launch.origin).numpy(), 1 / (view.pixel_area * cosine**3), rtol=1e-5
    )


@pytest.mark.parametrize("shape", [(64, 64), (64, 16), (128, 16), (256, 16), (3, 7)])
def test_any_pattern_shape(plane_world, shape):
    view = worlds.projector(20, shape)
    image = worlds.image(plane_world, view, worlds.detector(half_angle_deg=80), 16, SEEDS[0])
    x = (2 * (np.arange(shape[1]) + 0.5) / shape[1] - 1) * view.tan_half_width
    y = (2 * (np.arange(shape[0]) + 0.5) / shape[0] - 1) * view.tan_half_height
    closed = (1 + x**2 + y[:, None] ** 2) ** -2 * 0.5 * 1e-6 / (np.pi * DISTANCE**2)
    assert image.shape == shape
    np.testing.assert_allclose(image, closed, rtol=0.06)

"""Light transport against formulas: planes, lenses, fog echoes, spheres.

Where the estimate is noise-free but for float32, the comparison is to a relative 1e-3 or better;
where it is Monte Carlo, |z| < 4 over repetitions with fixed seeds.
"""

import numpy as np
import pytest

import worlds
from spisim.transport.world import build_world

SEED = np.random.SeedSequence(1)
AREA = 1e-6
DISTANCE = 5.0
REFLECTANCE = 0.5


@pytest.fixture(scope="module")
def plane_world():
    return build_world(worlds.scene(worlds.plane(DISTANCE, REFLECTANCE)))


@pytest.mark.parametrize(
    ("half_angle_deg", "factor"), [(10, 0.97007), (20, 0.88644), (45, 0.56213)]
)
def test_uniform_intensity_cone_onto_a_plane(plane_world, half_angle_deg, factor):
    # P_d = ρ P A / (π z²) · (1 - cos⁵α) / (5 (1 - cos α))
    alpha = np.radians(half_angle_deg)
    view = worlds.projector(2 * half_angle_deg, (64, 64))
    image = worlds.image(plane_world, view, worlds.detector(), 64, SEED)

    def intensity(x, y):
        cosine = 1 / np.sqrt(1 + x**2 + y**2)
        return np.where(cosine >= np.cos(alpha), cosine**3, 0) / (2 * np.pi * (1 - np.cos(alpha)))

    power = np.sum(worlds.pixel_weights(view, intensity) * image)
    closed = (1 - np.cos(alpha) ** 5) / (5 * (1 - np.cos(alpha)))
    assert closed == pytest.approx(factor, abs=1e-5)
    assert power == pytest.approx(
        closed * REFLECTANCE * AREA / (np.pi * DISTANCE**2), rel=1e-3, abs=0
    )


@pytest.mark.parametrize("half_angle_deg", [10, 20, 45])
def test_uniformly_lit_disc(plane_world, half_angle_deg):
    # P_d = ρ P A cos²α / (π z²)
    alpha = np.radians(half_angle_deg)
    view = worlds.projector(2 * half_angle_deg, (64, 64))
    image = worlds.image(plane_world, view, worlds.detector(), 64, SEED)
    disc = worlds.pixel_weights(view, lambda x, y: np.hypot(x, y) <= np.tan(alpha))
    power = np.sum(disc * image) / (np.pi * np.tan(alpha) ** 2)
    closed = REFLECTANCE * AREA * np.cos(alpha) ** 2 / (np.pi * DISTANCE**2)
    assert power == pytest.approx(closed, rel=1e-3, abs=0)


@pytest.mark.parametrize("tilt_deg", [0, 30, 60])
def test_pencil_onto_a_plane_does_not_depend_on_incidence(tilt_deg):
    # P_d = ρ P A cosθ_s cosθ_d / (π r²): θ_s at the target, θ_d at the detector
    tilt = np.radians(tilt_deg)
    world = build_world(worlds.scene(worlds.plane(DISTANCE, REFLECTANCE, tilt)))
    position, axis = np.array([0.4, 0.1, 0.3]), np.array([0.1, -0.2, 1.0])
    estimate = worlds.histogram(
        world,
        worlds.beams([0, 0, 1]),
        worlds.detector(position, axis),
        (1000, 0.02),
        512,
        SEED,
        max_vertices=1,
    )
    to_detector = position - np.array([0, 0, DISTANCE])
    r = np.linalg.norm(to_detector)
    normal = np.array([-np.sin(tilt), 0, -np.cos(tilt)])
    cos_s = normal @ to_detector / r
    cos_d = -axis @ to_detector / r / np.linalg.norm(axis)
    closed = REFLECTANCE * AREA * cos_s * cos_d / (np.pi * r**2)
    assert estimate.sum() == pytest.approx(closed, rel=2e-5, abs=0)


@pytest.mark.parametrize("tilt_deg", [0, 40])
def test_path_length_to_a_plane_and_back(tilt_deg):
    world = build_world(worlds.scene(worlds.plane(DISTANCE, REFLECTANCE, np.radians(tilt_deg))))
    direction = np.array([0.2, 0.1, 1.0])
    estimate = worlds.histogram(
        world,
        worlds.beams(direction),
        worlds.detector(area_m2=1e-10),
        (1500, 0.02),
        64,
        SEED,
        max_vertices=1,
    )
    unit = direction / np.linalg.norm(direction)
    normal = np.array([np.sin(np.radians(tilt_deg)), 0, np.cos(np.radians(tilt_deg))])
    distance = DISTANCE * normal[2] / (normal @ unit)
    histogram = estimate[0]
    mean = histogram @ np.arange(1500) * 0.02 / histogram.sum()
    assert np.count_nonzero(histogram) <= 2
    assert mean == pytest.approx(2 * distance, abs=1e-4)


def test_lens_whose_field_is_filled(plane_world):
    # P_d = τ ρ E A_det / (4 f#²), with the aperture that the étendue allows; τ apart
    photodiode_m2, f_number, half_angle = 2.5e-8, 0.95, np.radians(8)
    aperture = photodiode_m2 / (4 * f_number**2 * np.sin(half_angle) ** 2)
    view = worlds.projector(30, (32, 32))
    lens = worlds.detector(area_m2=aperture, half_angle_deg=8)
    runs = [worlds.image(plane_world, view, lens, 256, s).sum() for s in worlds.seeds(8)]
    irradiance = 1 / (view.pixel_area * DISTANCE**2)  # of every pixel at 1 W on its own patch
    closed = REFLECTANCE * irradiance * photodiode_m2 / (4 * f_number**2)
    assert np.mean(runs) == pytest.approx(closed, rel=1e-3, abs=0)
    assert abs(worlds.z_score_exact(runs, closed)) < 4


def test_absorbing_fog_attenuates_both_ways():
    # T_u = ρ A / (π z²) · mean over the pixel of cos⁴θ exp(-2 σ z / cosθ)
    extinction = 0.3
    world = build_world(
        worlds.scene(worlds.plane(DISTANCE, REFLECTANCE), extinction_per_m=extinction, albedo=0.0)
    )
    view = worlds.projector(40, (8, 8))

    def round_trip(x, y):
        cosine = 1 / np.sqrt(1 + x**2 + y**2)
        return cosine**4 * np.exp(-2 * extinction * DISTANCE / cosine)

    closed = worlds.pixel_weights(view, round_trip, 128) / view.pixel_area
    closed *= REFLECTANCE * AREA / (np.pi * DISTANCE**2)
    # More paths would tell the rounding of single precision, some 2e-7.
    runs = [worlds.image(world, view, worlds.detector(), 64, s) for s in worlds.seeds(8)]
    z = worlds.z_score_exact(runs, closed)
    # 64 pixels with 7 degrees of freedom each: judge the ensemble, not its largest member.
    assert abs(z.mean()) * np.sqrt(z.size) < 4 * z.std()
    assert abs(worlds.z_score_exact(np.mean(runs, axis=(1, 2)), closed.mean())) < 4


def test_integrating_sphere():
    # Every bounce spreads its light evenly: E = P ρ / (4 π R² (1 - ρ)) anywhere on the wall.
    radius, reflectance = 2.0, 0.9
    world = build_world(worlds.scene(worlds.sphere(radius, reflectance, subdivisions=6)))
    wall = worlds.detector([0.0, 0.0, -1.995], [0.0, 0.0, 1.0])
    closed = AREA * reflectance / (4 * np.pi * radius**2 * (1 - reflectance))
    view = worlds.projector(60, (4, 4))
    image = [worlds.image(world, view, wall, 1024, s).mean() for s in worlds.seeds(8)]
    spots = [
        worlds.histogram(
            world,
            worlds.beams([0.1, 0.2, 1]),
            wall,
            (20000, 0.05),
            2**12,
            s,
        ).sum()
        for s in worlds.seeds(8)
    ]
    # The sphere has 82,000 flat faces: its area is 0.03 % smaller than a true one's.
    assert np.mean(image) == pytest.approx(closed, rel=5e-3, abs=0)
    assert np.mean(spots) == pytest.approx(closed, rel=5e-3, abs=0)


def test_fog_in_a_closed_sphere_neither_makes_nor_loses_light():
    """All light of a beam ends in the walls: (1 - ρ) x (direct + scattered irradiance) = 1."""
    radius, extinction, reflectance, g = 2.0, 0.4, 0.5, 0.4
    world = build_world(
        worlds.scene(worlds.sphere(radius, reflectance), extinction_per_m=extinction, g=g)
    )
    points = 64
    polar = np.arccos(1 - 2 * (np.arange(points) + 0.5) / points)
    azimuth = np.pi * (1 + 5**0.5) * np.arange(points)
    lattice = np.stack(
        [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=1
    )
    runs = []
    for number, seed in enumerate(worlds.seeds(24)):  # turned otherwise, which varies the most
        turned = lattice @ np.linalg.qr(np.random.default_rng(number).normal(size=(3, 3)))[0]
        histogram = worlds.histogram(
            world,
            worlds.beams(*[[0.3, 0.1, 1.0]] * points),
            worlds.detector(turned * (radius * 0.995), -turned),
            (1000, 0.2),
            2**6,
            seed,
        )
        irradiance = histogram.sum(axis=1).mean() / AREA
        absorbed = irradiance * 4 * np.pi * radius**2
        runs.append((1 - reflectance) * (absorbed + np.exp(-extinction * radius)))
    assert abs(worlds.z_score_exact(runs, 1.0)) < 4
    assert np.mean(runs) == pytest.approx(1.0, abs=0.03)

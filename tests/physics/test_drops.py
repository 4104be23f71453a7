"""Falling drops against the medium that they are on average, and against one drop at a time."""

from dataclasses import replace

import numpy as np
import pytest

import worlds
from rainfall import (
    FOG_PER_M,
    LENGTHS,
    NEAR_M,
    WALL_M,
    drops,
    instrument,
    one_drop,
    one_exposure,
    pixel_rays,
)
from reconstruction.operators import illumination
from spisim.atmosphere.precipitation import rain
from spisim.instrument.views import DetectorView
from spisim.simulation.drops import on_buckets, on_spots
from spisim.simulation.drops.discs import disc_points, on_the_way_out, passing
from spisim.simulation.drops.echo import echo
from spisim.simulation.light import LightSequence

SEEDS = 100


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"lens_radius_m": 0.01, "focus_m": 2.0},
        {"detectors": ((0.2, 0.0, 0.0), (-0.2, 0.0, 0.0), (0.0, 0.3, 0.0))},
    ],
)
def test_on_average_drops_hide_as_the_medium_does(options):
    """Out and back, exp(-σ r) each with the extinction of the discs."""
    one = instrument(**options)
    falling = rain(100.0, near_m=NEAR_M, far_m=WALL_M + 0.5)
    image = np.ones(one.projector.shape)
    passed = [
        1 + one_exposure(one, drops(one, falling, seed), [image], 0 * image)[0] / image.size
        for seed in range(SEEDS)
    ]
    there = np.linalg.norm(pixel_rays(one), axis=1)
    wall = WALL_M * pixel_rays(one)
    closed = []
    for position in one.detector.positions_m:
        here = np.linalg.norm(wall - position, axis=1) / WALL_M
        through = np.exp(-falling.extinction_per_m * (there + here) * (WALL_M - NEAR_M))
        closed.append(through.mean())
    assert abs(worlds.z_score_exact(passed, np.mean(closed))) < 4
    assert 1 - np.mean(passed) > 5 * np.std(passed) / np.sqrt(SEEDS)  # it can tell from none


def closed_echo(falling, rays, detector, position, axis, paths_m=(0.0, np.inf)):
    """Fraction of the power along each ray (n, 3) of depth 1 that comes back, single scattering.

    Over path lengths between two limits.
    """
    depth = np.linspace(NEAR_M, WALL_M, 2001)
    angles = np.linspace(0, np.pi / 2, 400)
    scattering = falling.scattering_per_m_sr(-np.cos(angles))
    total = np.zeros(len(rays))
    for number, ray in enumerate(rays):
        points = depth[:, None] * ray
        back = position - points
        out_m, back_m = np.linalg.norm(points, axis=1), np.linalg.norm(back, axis=1)
        from_back = np.arccos(np.clip(np.einsum("nk,nk->n", points, -back) / out_m / back_m, -1, 1))
        cosine = -back @ axis / back_m
        inside = cosine > np.cos(np.radians(detector.field_of_view_deg) / 2)
        sent = np.interp(from_back, angles, scattering) * np.exp(-FOG_PER_M * (out_m + back_m))
        sent *= inside * cosine ** (1 + detector.vignetting) / back_m**2
        sent *= (out_m + back_m >= paths_m[0]) & (out_m + back_m < paths_m[1])
        total[number] = np.trapezoid(sent, out_m)
    return total * detector.aperture_area_m2


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"lens_radius_m": 0.01, "focus_m": 2.0},
        {"detectors": ((0.05, 0.0, 0.0), (0.0, -0.05, 0.0))},
    ],
)
def test_on_average_drops_send_back_what_the_medium_does(options):
    """Single scattering with fog between: ∫ σ_s p(θ) exp(-σ L) A cosα / d² dr."""
    one = instrument(**options)
    falling = rain(100.0, near_m=NEAR_M, far_m=WALL_M + 0.5)
    dark, power = np.zeros(one.projector.shape), np.ones(one.projector.shape)
    echoes = [
        one_exposure(one, drops(one, falling, seed, FOG_PER_M), [dark], power)[0]
        for seed in range(SEEDS)
    ]
    closed = sum(
        closed_echo(falling, pixel_rays(one), one.detector, position, np.array([0, 0, 1.0])).sum()
        for position in one.detector.positions_m
    )
    assert abs(worlds.z_score_exact(echoes, closed)) < 4
    assert np.std(echoes) / np.sqrt(SEEDS) < 0.1 * closed


def test_on_average_spots_see_the_medium():
    """Echo, near and far, and loss of the lasers, in fields with no edge in the beam."""
    one = instrument(lasers={"waist_mm": 4.0, "divergence_mrad": 1.0}, tof_fov_deg=12)
    falling = rain(200.0, near_m=NEAR_M, far_m=WALL_M + 0.5)
    changes = [on_spots(drops(one, falling, seed, FOG_PER_M), LENGTHS) for seed in range(SEEDS)]
    rays = one.lasers.directions / one.lasers.directions[:, 2:]
    detector, ends = one.tof.detector, one.ranging.detector_positions_m
    for start_m, stop_m in ((0.0, 7.0), (0.0, 1.5), (1.5, 3.0), (3.0, 7.0)):
        within = np.searchsorted(LENGTHS, [start_m, stop_m])
        echoes = [change.echo[0][:, slice(*within)].sum(axis=-1).mean() for change in changes]
        closed = [
            closed_echo(falling, ray[None], detector, end, axis, (start_m, stop_m))[0]
            for ray, end, axis in zip(rays, ends, one.lasers.directions, strict=True)
        ]
        assert abs(worlds.z_score_exact(echoes, np.mean(closed))) < 4
    passed = np.array([change.passed[0, :, -1].mean() for change in changes])
    way = (
        np.linalg.norm(rays, axis=1) + np.linalg.norm(rays * WALL_M - ends, axis=1) / WALL_M
    ).mean()
    through = np.exp(-falling.extinction_per_m * way * (WALL_M - NEAR_M))
    assert abs(worlds.z_score_exact(passed, through)) < 4
    assert 1 - passed.mean() > 5 * passed.std() / np.sqrt(SEEDS)


def test_a_drop_hides_its_disc_and_sends_its_echo():
    """One drop in the middle of a pixel, computed by hand."""
    one = instrument()
    ray = pixel_rays(one).reshape(16, 16, 3)[5, 9]
    position, diameter = 1.5 * ray, 1.0
    falling = one_drop(one, position, diameter)
    disc = np.pi / 4 * (diameter * 1e-3) ** 2
    pixel = 4 * one.projector.tan_half_width * one.projector.tan_half_height / 256
    met = disc * np.linalg.norm(ray) / (1.5**2 * pixel)

    detector = np.array(one.detector.positions_m[0])
    back = detector - position
    distance = np.linalg.norm(back)
    cosine = np.dot(position, back) / np.linalg.norm(position) / distance
    scattered = falling[0].precipitation.optics.scattered_per_sr(cosine, diameter)
    area = one.detector.aperture_area_m2
    echo = met * scattered * area * -back[2] / distance**3
    dark, power = np.zeros((16, 16)), np.zeros((16, 16))
    power[5, 9] = 1.0
    assert one_exposure(one, falling, [dark], power)[0] == pytest.approx(echo, rel=1e-6, abs=0)
    assert one_exposure(one, falling, [dark], 1 - power)[0] == 0

    # From the detector the drop stands before another place of the wall, the same part of a pixel
    # as long as drop and detector are at right angles to it.
    behind = detector + (position - detector) * WALL_M / position[2]
    column = int((behind[0] / WALL_M / one.projector.tan_half_width + 1) * 8)
    row = int((behind[1] / WALL_M / one.projector.tan_half_height + 1) * 8)
    assert (row, column) != (5, 9)
    from_detector = disc * distance / (-back[2]) ** 3 / pixel
    for where, fraction in (((5, 9), met), ((row, column), from_detector)):
        image = np.zeros((16, 16))
        image[where] = 1.0
        assert one_exposure(one, falling, [image], dark)[0] == pytest.approx(-fraction, rel=1e-6)


def test_pixels_that_are_off_light_drops_by_the_dark_level():
    one = instrument(on_off_contrast=10)
    falling = one_drop(one, 1.5 * pixel_rays(one)[5 * 16 + 9], 1.0)
    still = LightSequence(np.zeros(1), ()).between(np.zeros((1, one.pattern_plan.exposures)))
    power = np.zeros((16, 16))
    power[5, 9] = 1.0
    (changes,) = on_buckets(
        falling, np.zeros((1, 1, 16, 16)), still, power, lambda length: np.ones((1, len(length)))
    )[:, 0]
    exposures = range(one.pattern_plan.exposures)
    lit = np.array([illumination(one.pattern_plan, k)[5, 9] for k in exposures], float)
    assert {0.0, 1.0} <= set(lit)
    dark = one.imaging.projector.dark_level
    assert dark == pytest.approx(0.1)
    np.testing.assert_allclose(changes / changes[0], dark + (1 - dark) * lit, rtol=1e-9)


def test_fog_takes_light_of_a_drops_echo_out_and_back():
    """To a detector half a metre beside the pinhole the way back is another one."""
    position_m = np.array([[0.3, 0.1, 2.0]])
    seen_from = np.array([[0.5, 0.0, 0.0]])
    detector = DetectorView(seen_from, np.array([[0.0, 0.0, 1.0]]), 1e-4, 1.0)
    optics = rain(10.0).optics
    clear, foggy = (
        echo(position_m, np.array([2.0]), optics, detector, 0, fog_per_m)
        for fog_per_m in (0.0, FOG_PER_M)
    )
    path_m = np.linalg.norm(position_m) + np.linalg.norm(position_m - seen_from)
    assert foggy.length_m == pytest.approx(path_m)
    assert foggy.fraction / clear.fraction == pytest.approx(np.exp(-FOG_PER_M * path_m))


def test_a_drop_behind_the_wall_does_nothing():
    one = instrument()
    falling = one_drop(one, (0.01, 0.01, WALL_M + 0.01), 5.0)
    image = np.ones((16, 16))
    assert one_exposure(one, falling, [image], image)[0] == 0
    change = on_spots(falling, LENGTHS)
    assert (change.passed == 1).all()
    assert not change.echo.any()


def test_a_close_drop_hides_the_pixels_that_its_ball_covers():
    """Against rays through 32 × 32 parts of each pixel."""
    one = instrument()
    centre, diameter = np.array([0.004, -0.006, 0.15]), 6.0
    (falling,) = one_drop(one, centre, diameter)
    rays = pixel_rays(one, 32)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    aside = np.linalg.norm(centre - (rays @ centre)[:, None] * rays, axis=1)
    covered = (aside < diameter * 0.5e-3).reshape(16, 32, 16, 32).mean(axis=(1, 3))
    projector = falling.view.projector
    points = disc_points(
        centre[None], np.array([diameter]), np.zeros(1), float(np.sqrt(projector.pixel_area))
    )
    fractions = on_the_way_out(projector, falling.depth_m(0), points)
    hidden = 1 - passing(fractions, points, 256).reshape(16, 16)
    assert hidden.sum() == pytest.approx(covered.sum(), rel=0.01)
    assert np.sqrt(np.mean((hidden - covered)[covered > 0] ** 2)) < 0.1


def test_a_wall_that_comes_closer_than_a_drop_hides_it():
    """Surfaces and spots are those of each frame."""
    one = instrument()
    direction, range_m = one.lasers.directions[0], 1.805
    (falling,) = one_drop(one, range_m * direction, 20.0, frames=2)
    walls = np.array([WALL_M, 1.0])
    falling = replace(
        falling,
        depths_by_frame_m=np.multiply.outer(walls, np.ones(one.projector.shape)),
        spot_ranges_by_frame_m=np.multiply.outer(walls, 1 / one.lasers.directions[:, 2]),
    )
    image = np.ones(one.projector.shape)
    still = LightSequence(np.zeros(1), ()).between(np.zeros((2, one.pattern_plan.exposures)))
    change = on_buckets(
        (falling,), image[None, None], still, 0 * image, lambda length: np.ones((1, len(length)))
    )
    assert change[0, 0, 0] < -0.01
    np.testing.assert_allclose(change[0, 1], 0, atol=1e-12)
    passed = on_spots((falling,), LENGTHS).passed[:, 0, -1]
    assert passed[0] < 0.99
    assert passed[1] == pytest.approx(1, abs=1e-9)


def gaussian_on_disc(width, aside, radius):
    """Share of a round Gaussian of a standard deviation on a disc aside of its centre."""
    r = (np.arange(400) + 0.5) / 400 * radius
    turn = np.linspace(0, 2 * np.pi, 64, endpoint=False)[:, None]
    squared = (aside + r * np.cos(turn)) ** 2 + (r * np.sin(turn)) ** 2
    density = np.exp(-squared / (2 * width**2)) / (2 * np.pi * width**2)
    return (density.mean(axis=0) * 2 * np.pi * r).sum() * radius / 400


def test_a_drop_in_a_laser_beam_casts_a_shadow_and_a_glint():
    """On the beam's axis going out, beside that of the light coming back."""
    one = instrument()
    direction, range_m, diameter = one.lasers.directions[0], 1.805, 2.0
    falling = one_drop(one, direction * range_m, diameter)
    change, radius = on_spots(falling, LENGTHS), diameter * 0.5e-3
    met = gaussian_on_disc(np.hypot(2e-3, 0.5e-3 * range_m), 0.0, radius)
    end, detector = one.ranging.detector_positions_m[0], one.tof.detector
    home = direction * WALL_M / direction[2] - end
    along = np.dot(direction * range_m - end, home) / np.linalg.norm(home)
    part = along / np.linalg.norm(home)
    aside = np.sqrt(np.sum((direction * range_m - end) ** 2) - along**2)
    spot = np.hypot(2e-3, 0.5e-3 * WALL_M / direction[2])
    aperture = np.sqrt(detector.aperture_area_m2 / np.pi)
    width = np.hypot(spot * part, aperture / 2 * (1 - part))
    returning = gaussian_on_disc(width, aside, radius)
    assert 0.01 < returning < met
    after = np.searchsorted(LENGTHS, 2 * range_m + 0.01)
    np.testing.assert_allclose(change.passed[0, 0, : after - 1], 1)
    assert change.passed[0, 0, after] == pytest.approx((1 - met) * (1 - returning), rel=1e-4)
    assert (change.passed[0, 1:] == 1).all()

    to_detector = end - direction * range_m
    distance = np.linalg.norm(to_detector)
    cosine = direction @ to_detector / distance
    back = falling[0].precipitation.optics.scattered_per_sr(cosine, diameter)
    seen = -cosine / distance**2 * detector.aperture_area_m2
    echo = change.echo[0, 0]
    assert echo.sum() == pytest.approx(met * back * seen, rel=1e-4, abs=0)
    assert echo @ LENGTHS / echo.sum() == pytest.approx(range_m + distance, rel=1e-9)


def test_drops_and_flakes_hide_one_after_the_other():
    """What passes both is the product; their echoes add up."""
    one = instrument()
    image, power = np.ones((1, 16, 16)), np.zeros((16, 16))
    power[5, 9] = image[0, 5, 9] = 1.0
    ray = pixel_rays(one)[5 * 16 + 9]
    image[0] *= power
    near, far = (one_drop(one, distance * ray, 3.0) for distance in (0.8, 1.7))
    hidden = {
        name: one_exposure(one, weather, image, 0 * power)[0]
        for name, weather in (("near", near), ("far", far), ("both", near + far))
    }
    assert -0.9 < hidden["near"] < hidden["far"] < -0.01
    passed = (1 + hidden["near"]) * (1 + hidden["far"])
    assert 1 + hidden["both"] == pytest.approx(passed, rel=1e-12)
    echo = {
        name: one_exposure(one, weather, 0 * image, power)[0]
        for name, weather in (("near", near), ("far", far), ("both", near + far))
    }
    assert echo["both"] == pytest.approx(echo["near"] + echo["far"], rel=1e-12, abs=0)

    beam = one.lasers.directions[0]
    first, second = (one_drop(one, distance * beam, 1.0) for distance in (0.8, 1.7))
    alone = [on_spots(weather, LENGTHS) for weather in (first, second)]
    both = on_spots(first + second, LENGTHS)
    np.testing.assert_allclose(both.passed, alone[0].passed * alone[1].passed, rtol=1e-12)
    np.testing.assert_allclose(both.echo, alone[0].echo + alone[1].echo, rtol=1e-12)
    assert both.passed.min() < 0.99

"""Light in Mie fogs against formulas: attenuation, single scattering, bias of ranges.

Detectors are small apertures beside or in the place of the laser.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.constants import c

import worlds
from spisim.atmosphere import Tabulated, fog
from spisim.transport.engine.estimator import spot_histogram
from spisim.transport.engine.sampling import PathBudget
from spisim.transport.engine.tally import PathLengthBins
from spisim.transport.world import build_world

AREA = 1e-12
REFLECTANCE = 0.5
NATURAL = ("heavy-advection", "moderate-advection", "heavy-radiation", "moderate-radiation")
SEEDS = worlds.seeds(8)


def wall(medium, distance_m, reflectance=REFLECTANCE):
    return build_world(
        replace(worlds.scene(worlds.plane(distance_m, reflectance)), atmosphere=medium)
    )


def traced(world, detectors, bins, paths, seed, **options):
    """Of one laser along z for every detector."""
    count = len(detectors.positions_m)
    lasers = worlds.beams(*[[0, 0, 1]] * count)
    return spot_histogram(
        world, lasers, detectors, bins, PathBudget(paths), seed=seed, **options
    ).mean


@pytest.mark.parametrize("kind", NATURAL)
def test_ballistic_return_through_mie_fog(kind):
    """Unscattered light: ρ A / (π z²) exp(-2 σ z), whatever the albedo."""
    medium, bins = fog(50, kind), PathLengthBins(400, 0.1)
    for distance in (2.0, 8.0):
        world = wall(medium, distance)
        mean = traced(world, worlds.detector(area_m2=AREA), bins, 2**10, SEEDS[0], max_vertices=1)
        closed = REFLECTANCE * AREA / (np.pi * distance**2)
        closed *= np.exp(-2 * medium.extinction_per_m * distance)
        assert mean["histogram_orders"][0, 0].sum() / closed == pytest.approx(1, rel=1e-4)


def expected_echo(medium, baseline_m, bins, tan_half_field, max_range_m=30.0):
    """Light scattered once (bins,), of a detector at (baseline, 0, 0) that looks along z.

    A ∫ σs p(θ) cosα / d² exp(-σ (r + d)) dr, with d back from r on the beam, θ between beam and
    way back, α between that and the axis; shared between the bins left and right of r + d.
    """
    r = np.geomspace(1e-3, max_range_m, 400_001)
    d = np.hypot(r, baseline_m)
    seen = baseline_m < tan_half_field * r
    density = medium.scattering_per_m * medium.phase.density(-r / d) * seen * r / d**3
    density *= AREA * np.exp(-medium.extinction_per_m * (r + d))
    fraction = (density[1:] + density[:-1]) / 2 * np.diff(r)
    position = ((r + d)[1:] + (r + d)[:-1]) / 2 / bins.width_m
    low = position.astype(int)
    inside = low < bins.count - 1
    low, fraction, upper = low[inside], fraction[inside], (position - low)[inside]
    echo = np.bincount(low, fraction * (1 - upper), bins.count)
    return echo + np.bincount(low + 1, fraction * upper, bins.count)


@pytest.mark.parametrize("kind", ["heavy-advection", "moderate-radiation"])
@pytest.mark.parametrize(("baseline_m", "half_angle_deg"), [(0.0, 89.0), (0.05, 89.0), (0.05, 3.0)])
def test_profile_of_single_scattering(kind, baseline_m, half_angle_deg):
    """Over path length, with the tabulated phase function along the bistatic angle."""
    medium, bins = fog(30, kind), PathLengthBins(64, 0.2)
    world = wall(medium, 30, reflectance=0.0)
    tan_half_field = np.tan(np.radians(half_angle_deg))
    detector = worlds.detector([baseline_m, 0, 0], area_m2=AREA, half_angle_deg=half_angle_deg)
    runs = [
        traced(world, detector, bins, 2**16, seed, max_vertices=1)["histogram"][0] for seed in SEEDS
    ]
    displayed = slice(4, -1)  # the nearest light has no end at zero baseline, the last bin the rest
    closed, smooth = (
        expected_echo(air, baseline_m, bins, tan_half_field)[displayed]
        for air in (medium, fog(30, kind, phase="hg"))
    )
    runs = np.array(runs)[:, displayed]
    dark = closed == 0
    assert np.all(runs[:, dark] == 0)
    t = worlds.z_score_exact(runs[:, ~dark], closed[~dark])
    assert np.abs(t).max() < stats.t.isf(5e-4 / t.size, len(SEEDS) - 1)
    ratios = (runs[:, ~dark] / closed[~dark]).mean(axis=1)
    assert abs(worlds.z_score_exact(ratios, 1)) < 4
    assert ratios.std(ddof=1) / np.sqrt(len(SEEDS)) < 0.005  # the fog absorbs 0.3 and 1.9 %
    # Sharp enough to tell the table from the smooth lobe of the same asymmetry.
    assert np.abs(smooth[~dark] / closed[~dark] - 1).max() > 0.5
    assert np.median(runs[:, ~dark].std(axis=0) / closed[~dark]) / np.sqrt(len(SEEDS)) < 0.02


# What light scattered once does to the phase: a laser at 15 MHz, a wall of reflectance 0.5, a field
# that meets the beam from 100 baselines on, and the mean of the phase function near 180°.
WAVE_NUMBER = 2 * np.pi * 15e6 / c
TAN_HALF_FIELD = 0.01
BACKSCATTER = 0.0245
PUBLISHED = [  # visibility, wall, overlap from; light of the fog over that of the wall, bias (m)
    (50, 2, 0.3, 0.17, -0.18),
    (50, 5, 1.0, 0.40, -0.55),
    (100, 8, 1.0, 0.54, 0.56),
]


def without_glory(medium):
    """The mean of the phase function beyond 175° in place of its structure there."""
    values = medium.phase.values.copy()
    cos = np.linspace(-1, 1, values.size)
    near = cos < np.cos(np.radians(175))
    values[near] *= BACKSCATTER / medium.phase.density(cos[near])
    return replace(medium, phase=Tabulated(values))


def bias_m(phasors, distance_m):
    return np.angle(phasors * np.exp(-2j * WAVE_NUMBER * distance_m)) / (2 * WAVE_NUMBER)


def phasor_parts(medium, distance_m, overlap_m):
    """Of the wall and of light scattered once, seen along z from beside the laser; its size."""
    r = np.linspace(overlap_m, distance_m, 100_001)
    d = np.hypot(r, TAN_HALF_FIELD * overlap_m)
    wave = np.exp((1j * WAVE_NUMBER - medium.extinction_per_m) * (r + d)) * r / d**3
    scattered = medium.scattering_per_m * medium.phase.density(-r / d) * wave
    target = REFLECTANCE / np.pi * wave[-1] * r[-1] / d[-1]
    return target, np.trapezoid(scattered, r), np.trapezoid(np.abs(scattered), r)


def spot_phasors(medium, distance_m, overlap_m, paths, **options):
    """Phasor and orders of scattering (3,) of one spot, for every seed."""
    bins = PathLengthBins(2001, 0.04)
    detector = worlds.detector(
        [TAN_HALF_FIELD * overlap_m, 0, 0],
        area_m2=AREA,
        half_angle_deg=np.degrees(np.arctan(TAN_HALF_FIELD)),
    )
    world = wall(medium, distance_m)
    runs = [traced(world, detector, bins, paths, seed, **options) for seed in SEEDS]
    wave = np.exp(1j * WAVE_NUMBER * bins.centres_m)
    return (
        np.array([run["histogram"][0] @ wave for run in runs]),
        np.array([run["histogram_orders"][:, 0].sum(axis=-1) for run in runs]),
    )


@pytest.mark.parametrize(("visibility_m", "distance_m", "overlap_m", "ratio", "bias"), PUBLISHED)
def test_fog_bias_of_single_scattering(visibility_m, distance_m, overlap_m, ratio, bias):
    medium = without_glory(fog(visibility_m, "heavy-advection"))
    target, echo, light = phasor_parts(medium, distance_m, overlap_m)
    closed = bias_m(target + echo, distance_m)
    assert closed == pytest.approx(bias, abs=0.006)  # as rounded
    assert light / np.abs(target) == pytest.approx(ratio, abs=0.006)
    phasors, orders = spot_phasors(medium, distance_m, overlap_m, 2**14, max_vertices=1)
    traced_bias = bias_m(phasors, distance_m)
    assert abs(worlds.z_score_exact(traced_bias, closed)) < 4
    assert abs(worlds.z_score_exact(orders[:, 1] / orders[:, 0], light / np.abs(target))) < 4
    assert traced_bias.std(ddof=1) / np.sqrt(len(SEEDS)) < 0.02 * abs(bias)


def test_multiple_scattering_changes_the_bias():
    """Light scattered forward joins that of the wall, more than that of the nearer fog."""
    medium, distance = without_glory(fog(50, "heavy-advection")), 5
    target, echo, _ = phasor_parts(medium, distance, 1.0)
    phasors, orders = spot_phasors(medium, distance, 1.0, 2**11)
    assert np.all(orders[:, 2] > 0)
    z = worlds.z_score_exact(bias_m(phasors, distance), bias_m(target + echo, distance))
    assert z > 4

"""Derivatives by the fog, and light at another extinction, from the paths of one pass.

A wall in fog, light scattered by nothing but the wall, has exp(−σ L) in closed form; everything
else is held against passes through the other fog: the same random numbers for derivatives, |z| < 4
over independent passes.
"""

import numpy as np
import pytest

import worlds
from spisim.transport.engine.accumulator import MAX_WEIGHT
from spisim.transport.engine.estimator import Strategy, spot_histogram, transport_image
from spisim.transport.engine.outputs import Outputs
from spisim.transport.engine.path_weights import ExtinctionRatio, Score, tracked_by
from spisim.transport.engine.sampling import PathBudget
from spisim.transport.engine.tally import PathLengthBins
from spisim.transport.scores import Albedo, Extinction
from spisim.transport.world import build_world

SIGMA, ALBEDO, G = 0.08, 0.9, 0.8
VIEW = worlds.projector(shape=(8, 8))
END = worlds.detector((0.1, 0, 0), half_angle_deg=12)
BY_EXTINCTION = Score("by_extinction", Extinction(0))
BY_ALBEDO = Score("by_albedo", Albedo(0))
TRACKED = tracked_by([BY_EXTINCTION, BY_ALBEDO])
FREQUENCY_HZ = 15e6
SEEDS = range(8)
BINS = PathLengthBins(40, 0.5)


def room(sigma=SIGMA, albedo=ALBEDO):
    scene = worlds.scene(*worlds.room(), extinction_per_m=sigma, albedo=albedo, g=G)
    return build_world(scene, TRACKED)


def traced(world, seed, weights=(), **options):
    outputs = Outputs(
        orders=True, frequencies_hz=(FREQUENCY_HZ,), bins=BINS, weights=tuple(weights)
    )
    return transport_image(
        world,
        VIEW,
        END,
        PathBudget(256, min_launches=1),
        seed=np.random.SeedSequence(seed),
        outputs=outputs,
        **options,
    ).mean


def summary(mean, suffix=""):
    """Total light, its parts by scattering, its phasor, and its light beyond 10 m."""
    phasor = mean[f"phasors{suffix}"].sum(axis=(0, 1))
    orders = mean[f"image_orders{suffix}"].sum(axis=1)
    far = mean[f"histogram{suffix}"][:, 20:].sum()
    return np.array([mean[f"image{suffix}"].sum(), *orders, *phasor, far])


def z_of(differences):
    """Of the mean of repetitions (seeds, n), or 0 where there is no light at all."""
    error = differences.std(axis=0, ddof=1) / np.sqrt(len(differences))
    return np.divide(differences.mean(axis=0), error, out=np.zeros(error.shape), where=error > 0)


def test_light_of_a_wall_alone_has_the_derivative_of_its_attenuation():
    distance_m = 5.0
    scene = worlds.scene(worlds.plane(distance_m), extinction_per_m=SIGMA, albedo=0.0)
    world = build_world(scene, TRACKED)
    estimate = spot_histogram(
        world,
        worlds.beams([0, 0, 1]),
        worlds.detector(half_angle_deg=10),
        PathLengthBins(100, 0.2),
        PathBudget(64),
        seed=np.random.SeedSequence(1),
        path_weights=(BY_EXTINCTION, ExtinctionRatio("thicker", 2.5, SIGMA)),
    ).mean
    light = estimate["histogram"].sum()
    assert light > 0
    derivative = estimate["histogram_by_extinction"].sum() / light
    assert derivative == pytest.approx(-SIGMA * 2 * distance_m, rel=1e-3)
    thicker = estimate["histogram_thicker"].sum() / light
    assert thicker == pytest.approx(np.exp(-1.5 * SIGMA * 2 * distance_m), rel=1e-3)


@pytest.mark.parametrize(
    ("weight", "changed"),
    [
        (BY_EXTINCTION, lambda h: {"sigma": SIGMA * np.exp(h)}),
        (BY_ALBEDO, lambda h: {"albedo": ALBEDO * np.exp(h)}),
    ],
    ids=["extinction", "albedo"],
)
def test_derivatives_are_those_of_finite_differences(weight, changed):
    step = 0.02
    low, high = room(**changed(-step)), room(**changed(step))
    here, off = room(), []
    for seed in SEEDS:
        by = summary(traced(here, seed, [weight]), f"_{weight.name}")
        difference = summary(traced(high, seed)) - summary(traced(low, seed))
        off.append(by - difference / (2 * step))
    assert np.abs(z_of(np.array(off))).max() < 4


@pytest.mark.parametrize("ratio", [50 / 80, 50 / 35])
def test_light_at_another_extinction_is_that_of_a_pass_through_it(ratio):
    weight = ExtinctionRatio("other", ratio, SIGMA)
    here, there, off = room(), room(SIGMA * ratio), []
    for seed in SEEDS:
        other = summary(traced(there, seed + 100))
        off.append(summary(traced(here, seed, [weight]), "_other") - other)
    assert np.abs(z_of(np.array(off))).max() < 4


@pytest.mark.parametrize("strategy", ["PROJECTOR", "DETECTOR"])
def test_every_strategy_has_the_same_derivative(strategy):
    scene = worlds.scene(worlds.plane(4.0), extinction_per_m=SIGMA, albedo=ALBEDO, g=G)
    world = build_world(scene, TRACKED)
    scattered = (slice(None), slice(1, 4))
    both, one = (
        np.array(
            [
                summary(traced(world, seed + first, [BY_EXTINCTION], **options), "_by_extinction")
                for seed in SEEDS
            ]
        )[scattered]
        for first, options in ((0, {}), (50, {"strategy": Strategy[strategy]}))
    )
    # Orders of one strategy alone have heavy tails in fog that surrounds both ends.
    error = np.hypot(*(each.std(axis=0, ddof=1) / np.sqrt(len(SEEDS)) for each in (both, one)))
    assert (np.abs(both.mean(axis=0) - one.mean(axis=0)) < 4 * error).all()


def test_the_light_itself_is_untouched_by_weights():
    plain, weighted = traced(room(), 3), traced(room(), 3, [BY_EXTINCTION, BY_ALBEDO])
    for name, values in plain.items():
        np.testing.assert_array_equal(values, weighted[name])


def test_weighted_light_that_cannot_be_summed_is_no_number():
    mean = traced(room(), 1, [ExtinctionRatio("huge", 1e20, 0.0), BY_ALBEDO])
    assert np.isnan(mean["image_huge"]).all()
    assert np.isfinite(mean["image_by_albedo"]).all()


def test_large_weights_of_little_light_are_summed():
    thin = ExtinctionRatio("thin", 1e-3, SIGMA)
    wall = build_world(worlds.scene(worlds.plane(60.0), extinction_per_m=SIGMA, albedo=0.0))
    mean = traced(wall, 1, [thin])
    light = mean["image_thin"].sum() / mean["image"].sum()
    assert light == pytest.approx(np.exp(0.999 * SIGMA * 120), rel=0.1)
    assert light > 10 * MAX_WEIGHT

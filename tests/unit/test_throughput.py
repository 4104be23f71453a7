"""Patterns that lose more or less of their light: no noise, and no readings that are spoilt."""

import numpy as np
import pytest

from images import correlation, natural_image
from reconstruction.image import Imaging
from reconstruction.operators import PatternPlan, Throughput, expose, make_plan
from reconstruction.operators.basis import frequencies

SHAPE = (32, 32)


def losing(plan, image, seed):
    """Readings of fine patterns that lose up to half of their light, more or less of it."""
    rng = np.random.default_rng(seed)
    fine = np.sum(frequencies(plan.patterns, "natural"), axis=0)[plan.distinct] / 2
    fraction = dict(
        zip(plan.distinct, (1 - fine) * rng.uniform(0.8, 1.2, plan.sampled), strict=True)
    )
    light = expose(plan, image) * np.array([fraction[k] for k in plan.index])
    noise = 0.002 * light.max()
    return light + noise * rng.standard_normal(light.shape), noise


@pytest.mark.parametrize("patterns", [31, 64, 128])
def test_what_patterns_lose_is_no_noise(patterns):
    plan = make_plan(SHAPE, patterns, polarity="differential")
    usable = Imaging(plan).of(np.ones(plan.exposures, dtype=bool))
    solve = usable.solver("edge-preserving")
    lost = []
    for seed in range(6):
        image = natural_image(32, seed) + 0.2
        readings, noise = losing(plan, image, seed)
        assert not usable.outliers(readings).any()
        unknown, reported = (
            correlation(solve(usable.decode(readings, np.full(readings.size, each))).image, image)
            for each in (np.nan, noise**2)
        )
        lost.append(reported - unknown)
    assert np.mean(lost) < 0.02


def test_sums_of_noise_alone_are_seldom_taken_for_losses():
    """The score is the larger of two normal ones, of which one in 4300 is over 3.5."""
    plan = make_plan(SHAPE, 100, polarity="differential")
    throughput = Throughput(plan, np.ones(plan.exposures, dtype=bool))
    scores, doubted = [], []
    for seed in range(200):
        light = expose(plan, seed % 2 * 100 * natural_image(32, seed % 20))
        readings = light + 20 * np.random.default_rng(seed).standard_normal(light.shape)
        scores.append(throughput.score(readings))
        doubted.append(throughput.probability_of_noise(readings) < 0.5)
    assert max(scores) < 3.5
    assert np.mean(doubted) < 0.05


def test_repeated_exposures_and_few_pairs_tell_no_losses():
    few = make_plan(SHAPE, 8, polarity="differential")
    once = make_plan(SHAPE, 20, polarity="signed")
    repeated = PatternPlan(SHAPE, np.tile(once.index, 3), np.tile(once.polarity, 3))
    for plan in (few, repeated):
        throughput = Throughput(plan, np.ones(plan.exposures, dtype=bool))
        assert throughput.score(np.arange(plan.exposures, dtype=float)) == 0
        assert throughput.probability_of_noise(np.arange(plan.exposures, dtype=float)) == 1

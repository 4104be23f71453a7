"""Intervals of a study cover what they say."""

import math
from dataclasses import replace

import numpy as np
import pytest

from spisim.dataset.study.statistics import estimate


@pytest.mark.parametrize("units", [3, 10, 30])
def test_intervals_cover_the_true_mean_as_often_as_they_say(units: int) -> None:
    rng = np.random.default_rng(units)
    trials = 300
    hits = 0
    for _ in range(trials):
        result = estimate(rng.normal(3.0, 2.0, units).tolist(), range(units))
        assert result.low is not None
        assert result.high is not None
        hits += result.low <= 3.0 <= result.high
    assert abs(hits / trials - 0.95) < 3 * math.sqrt(0.95 * 0.05 / trials)


@pytest.mark.parametrize(("units", "fraction"), [(5, 0.90), (10, 0.91)])
def test_intervals_of_skewed_values_cover_as_often_as_the_documentation_says(
    units: int, fraction: float
) -> None:
    """Of log-normal values, whose mean few units hardly ever show, 95 % are out of reach."""
    rng = np.random.default_rng(units)
    trials = 200
    true = math.exp(0.5)
    result = [estimate(rng.lognormal(0, 1, units).tolist(), range(units)) for _ in range(trials)]
    hits = [(each.low or 0) <= true <= (each.high or 0) for each in result]
    assert abs(np.mean(hits) - fraction) < 3 * math.sqrt(fraction * (1 - fraction) / trials)


@pytest.mark.parametrize("values", [[0, 0, 0, 0, 1], [4.0] * 9 + [3], [0, 1e-9, 0, 1e-9, 1.0]])
def test_an_interval_of_almost_equal_values_has_ends(values: list[float]) -> None:
    result = estimate(values, range(len(values)))
    assert result.low is not None
    assert result.high is not None
    assert -5 < result.low < np.mean(values) < result.high < 5


def test_an_interval_of_equal_values_is_their_value() -> None:
    result = estimate([0.1] * 7, range(7))
    assert (result.low, result.high) == pytest.approx((0.1, 0.1), abs=1e-12)


def test_an_interval_of_dependent_values_is_that_of_their_units() -> None:
    """Five views of each scene tell no more of other scenes than their means do."""
    rng = np.random.default_rng(3)
    scenes = rng.normal(size=8)
    repeated = estimate(np.repeat(scenes, 5).tolist(), np.repeat(np.arange(8), 5).tolist())
    single = estimate(scenes.tolist(), range(8))
    assert (repeated.n, repeated.units) == (40, 8)
    assert (repeated.low, repeated.high) == pytest.approx((single.low, single.high), rel=1e-12)


def test_intervals_of_clustered_values_cover_and_those_that_ignore_clusters_do_not() -> None:
    rng = np.random.default_rng(5)
    trials, scenes, views = 300, 10, 5
    labels = np.repeat(np.arange(scenes), views).tolist()
    hits = {"scenes": 0, "samples": 0}
    for _ in range(trials):
        values = np.repeat(rng.normal(size=scenes), views) + 0.5 * rng.normal(size=scenes * views)
        for name, units in (("scenes", labels), ("samples", list(range(scenes * views)))):
            result = estimate(values.tolist(), units)
            assert result.low is not None
            assert result.high is not None
            hits[name] += result.low <= 0 <= result.high
    spread = math.sqrt(0.95 * 0.05 / trials)
    assert abs(hits["scenes"] / trials - 0.95) < 3 * spread
    assert hits["samples"] / trials < 0.75


def test_estimates_of_few_values() -> None:
    assert estimate([], []) == replace(estimate([], []), n=0, units=0, mean=None, low=None)
    one = estimate([2.0], ["a"])
    assert (one.n, one.mean, one.median, one.low, one.high) == (1, 2.0, 2.0, None, None)
    two = estimate([1.0, 3.0], ["a", "b"])
    assert (two.mean, two.low, two.high) == pytest.approx((2.0, 2 - 12.706, 2 + 12.706), rel=1e-4)
    assert not two.settled  # too few to say so
    assert estimate([1.0, 1.2, 0.9, 1.1, 1.0], range(5)).settled
    assert not estimate([1.0, -1.2, 0.9, -1.1, 0.1], range(5)).settled


def test_the_mean_weighs_samples_and_the_same_values_give_the_same_interval() -> None:
    values, units = [1.0, 1.0, 4.0, 6.0, 3.0], ["a", "a", "b", "c", "d"]
    result = estimate(values, units)
    assert result.mean == 3.0
    assert result.median == 3.0
    assert result.low is not None
    assert result.high is not None
    assert result.low < 3.0 < result.high
    assert result == estimate(values, units)

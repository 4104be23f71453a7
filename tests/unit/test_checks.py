"""Promises that are judged by the interval of a figure, not by the few samples of the day."""

from argparse import Namespace
from collections.abc import Callable
from pathlib import Path

import intervals
import numpy as np
import pytest
from intervals import of_figure, of_fraction, of_minimum, of_quantile, of_size
from numpy.typing import NDArray
from options import finish
from scipy.stats import binomtest, t
from yardstick import REFERENCE_S, Yardstick

from spisim_paper.checks import Check, checks_table, surroundings

Draw = Callable[[np.random.Generator], tuple[NDArray, NDArray]]


def between(low: float, high: float) -> Callable[[float], tuple[float, float]]:
    """At 95 %; a surer one is twice as wide on either side."""
    return lambda confidence: (low, high) if confidence < 0.96 else (2 * low - high, 2 * high - low)


@pytest.mark.parametrize(
    ("interval", "holds"),
    [
        (None, True),
        (between(0.8, 0.9), True),
        (between(0.8, 1.1), None),
        (between(1.05, 1.2), None),  # beyond the limit, but not surely
        (between(1.3, 1.4), False),
    ],
)
@pytest.mark.parametrize("at_least", [False, True])
def test_an_interval_decides(interval, holds, at_least: bool) -> None:
    def mirrored(confidence: float) -> tuple[float, float]:
        low, high = interval(confidence)
        return 2 - high, 2 - low

    given = mirrored if interval and at_least else interval
    assert Check("figure", 1.0, 1.0, at_least, given).holds is holds


def test_figures_without_samples_are_exact() -> None:
    assert Check("figure", 1.01, 1.0).holds is False
    assert Check("figure", np.nan, 1.0).holds is False


@pytest.mark.parametrize(
    ("interval", "quick", "full"),
    [(between(0.8, 0.9), 0, 0), (between(0.8, 1.1), 0, 1), (between(1.3, 1.4), 1, 1)],
)
def test_a_quick_run_fails_by_what_surely_fails(interval, quick: int, full: int, capsys) -> None:
    check = Check("figure", 0.9, 1.0, interval=interval)
    for is_quick, status in ((True, quick), (False, full)):
        options = Namespace(quick=is_quick, json=True, markdown=False)
        around = surroundings(())
        assert finish(options, Path("page.md"), "mark", around, [], [check]) == status
    assert '"interval": [' in capsys.readouterr().out


def test_the_table_says_what_cannot_be_told() -> None:
    row = checks_table([Check("figure", 0.9, 1.0, interval=between(0.8, 1.1))]).rows[0]
    assert row == ("figure", "0.9 (0.8 to 1.1)", "≤ 1", "cannot tell")


def _correlated_hits(rng: np.random.Generator) -> tuple[NDArray, NDArray]:
    """Four spots in each of 20 scenes, hit in 70 % of cases; half of them all alike."""
    alike, each = rng.random(20) < 0.7, rng.random((20, 4)) < 0.7
    together = rng.random(20) < 0.5
    return np.where(together[:, None], alike[:, None], each).ravel(), np.repeat(np.arange(20), 4)


def _correlated_errors(rng: np.random.Generator) -> tuple[NDArray, NDArray]:
    """Scatter of a scene and of its spots, 1 rms together."""
    values = rng.normal(0, 0.6, (12, 1)) + rng.normal(0, 0.8, (12, 4))
    return values.ravel(), np.repeat(np.arange(12), 4)


def _fraction(values: NDArray, groups: NDArray) -> tuple[float, float]:
    return of_fraction(values, groups)(0.95)


def _rms(values: NDArray, groups: NDArray) -> tuple[float, float]:
    def rms(some: NDArray) -> float:
        return float(np.sqrt(np.mean(values[some] ** 2)))

    return of_figure(rms, groups, positive=True)(0.95)


@pytest.mark.parametrize(
    ("draw", "interval", "truth", "trials"),
    [(_correlated_hits, _fraction, 0.7, 400), (_correlated_errors, _rms, 1.0, 60)],
)
def test_an_interval_holds_the_truth_as_often_as_it_says(
    draw: Draw,
    interval: Callable[..., tuple[float, float]],
    truth: float,
    trials: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of correlated samples, too; within four standard errors."""
    monkeypatch.setattr(intervals, "RESAMPLED", 150)
    held = []
    for seed in range(trials):
        low, high = interval(*draw(np.random.default_rng(seed)))
        held.append(low <= truth <= high)
    assert np.mean(held) >= 0.95 - 4 * np.sqrt(0.95 * 0.05 / trials)
    assert np.mean(held) < 1  # or it would say nothing


def test_independent_hits_have_the_interval_of_clopper_and_pearson() -> None:
    hits = np.arange(50) < 37
    expected = binomtest(37, 50).proportion_ci(0.9)
    assert of_fraction(hits, np.arange(50))(0.9) == pytest.approx(tuple(expected), rel=5e-3)


def test_the_interval_of_a_mean_is_students() -> None:
    values = np.random.default_rng(1).normal(3, 1, 30)
    low, high = of_figure(lambda some: float(values[some].mean()), np.arange(30))(0.99)
    expected = t(29, values.mean(), values.std(ddof=1) / np.sqrt(30)).interval(0.99)
    assert (low, high) == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("values", [np.ones(12), np.append(1.0, np.zeros(11))])
def test_figures_that_never_vary_or_are_seldom_there_tell_nothing(values: NDArray) -> None:
    with np.errstate(divide="ignore"):
        interval = of_figure(
            lambda some: float(values[some].mean()), np.arange(12) // 6, positive=True
        )
    assert interval(0.95) == (-np.inf, np.inf)


def test_one_scene_tells_nothing() -> None:
    assert of_fraction([True] * 9, [1] * 9)(0.95) == (0, 1)
    assert of_figure(lambda some: 1.0 * len(some), [1] * 9)(0.95) == (-np.inf, np.inf)


def test_the_interval_of_a_quantile_is_of_ordered_samples() -> None:
    low, high = of_quantile(np.arange(1000.0), 0.9)(0.95)
    assert low == pytest.approx(900 - 19, abs=2)
    assert high == pytest.approx(900 + 19, abs=2)
    assert of_quantile(np.arange(20.0), 0.99)(0.95)[1] == np.inf  # none is beyond it


def test_intervals_of_sizes_and_of_the_least() -> None:
    assert of_size(between(-1, 2))(0.95) == (0, 2)
    assert of_size(between(-3, -1))(0.95) == (1, 3)
    assert of_minimum([between(0.4, 0.8), between(0.5, 0.6)])(0.8) == (0.4, 0.6)


def test_times_are_those_of_the_reference() -> None:
    """On a machine that takes twice as long as the reference, then four times."""
    clock = iter(np.cumsum([0.0, 6.0, 0.0, 12.0]) * REFERENCE_S)
    yardstick = Yardstick(lambda: next(clock), laps=3)
    yardstick.look()
    yardstick.look()
    value, interval = yardstick.on_reference(12.0, between(9.0, 16.0))
    assert value == pytest.approx(4.0)
    assert interval(0.95) == pytest.approx((9 / 4, 16 / 2))


def test_what_a_lagging_machine_loses_tells_nothing() -> None:
    """Nothing is lost for sure on a machine as fast as the reference alone."""
    for slowness, holds in ((1.0, False), (2.0, None)):
        clock = iter([0.0, slowness * REFERENCE_S])
        yardstick = Yardstick(lambda clock=clock: next(clock), laps=1)
        yardstick.look()
        assert Check("lost", 3, 0, interval=yardstick.of_lateness(3)).holds is holds

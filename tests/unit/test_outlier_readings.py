"""Readings that are lost or disturbed, told by what is shown twice."""

import numpy as np
import pytest

from images import natural_image
from reconstruction import Reconstructor
from reconstruction.capture.importers import capture_from_readings
from reconstruction.operators import OutlierDetector, PatternPlan, Throughput, expose, make_plan

PLAN = make_plan((32, 32), 120, polarity="differential")
TRUE = natural_image(32, 1)
LIGHT = expose(PLAN, TRUE) + 50 + np.linspace(0, 20, PLAN.exposures)


def outlier_readings(plan: PatternPlan) -> OutlierDetector:
    usable = np.ones(plan.exposures, dtype=bool)
    return OutlierDetector(plan, usable, Throughput(plan, usable))


def with_complements(readings: list[int]) -> list[int]:
    return sorted({each ^ 1 for each in readings} | set(readings))


@pytest.mark.parametrize("noise", [0.0, 0.5])
def test_lost_and_disturbed_readings_are_found_with_their_complements(noise: float) -> None:
    readings = LIGHT + noise * np.random.default_rng(0).standard_normal(LIGHT.shape)
    readings[[7, 60, 61, 200]] = 0
    readings[122] += 10 * np.ptp(LIGHT)
    result = outlier_readings(PLAN)(readings)
    assert np.flatnonzero(result).tolist() == with_complements([7, 60, 122, 200])


def test_noise_hardly_ever_looks_spoilt() -> None:
    outliers = outlier_readings(PLAN)
    rng = np.random.default_rng(1)
    noise = 5 * np.std(LIGHT) * rng.standard_normal((500, LIGHT.size))
    assert not any(outliers(LIGHT + each).any() for each in noise)
    assert not outliers(LIGHT).any()
    assert not outliers(np.round(LIGHT)).any()


def test_few_photons_are_no_disturbance() -> None:
    counts = np.random.default_rng(2).poisson(0.08, LIGHT.size).astype(float)
    assert counts.any()
    assert not outlier_readings(PLAN)(counts).any()


def test_where_much_is_far_off_or_nothing_shown_twice_nothing_is_told() -> None:
    readings = LIGHT.copy()
    readings[::6] = 0
    assert not outlier_readings(PLAN)(readings).any()
    single = make_plan((32, 32), 120, polarity="single-ended")
    outliers = outlier_readings(single)
    assert not outliers(np.where(np.arange(single.exposures) == 5, 0, 100.0)).any()


def test_an_image_does_without_them_and_says_so() -> None:
    readings = LIGHT + 0.1 * np.random.default_rng(2).standard_normal(LIGHT.shape)
    broken = readings.copy()
    broken[[30, 77, 140]] = 0
    results = []
    for each in (readings, broken):
        capture = capture_from_readings(each, PLAN)
        results.append(Reconstructor(capture.setup, ranging=(), depth=())(capture.frame()))
    whole, left = results
    assert whole.notes == {}
    assert left.patterns == whole.patterns - 3
    assert left.warnings == [
        "frame '0' is without 6 of its 240 readings: repeated exposures disagree there "
        "(lost or disturbed?)"
    ]
    off = [np.sqrt(np.mean((each.image - TRUE) ** 2)) for each in results]
    assert off[1] < 1.2 * off[0]

"""The examples do what they say, on small made-up data."""

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from spisim.dataset.plan import load_plan

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module")
def estimator() -> ModuleType:
    pytest.importorskip("sklearn")
    spec = importlib.util.spec_from_file_location("estimator", EXAMPLES / "estimator.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def slanted_walls(estimator: ModuleType, count: int, seed: int):
    """Walls at random distances and slants; the light falls off with their distance."""
    rng = np.random.default_rng(seed)
    distance, slant = rng.uniform(2, 8, count), rng.uniform(-0.3, 0.3, count)
    across = np.linspace(-1, 1, 8)
    depth = distance[:, None, None] * np.exp(slant[:, None, None] * across) * np.ones((8, 1))
    patterns = np.random.default_rng(0).random((60, 64))
    light = (1e6 / depth**2).reshape(count, -1) @ patterns.T
    ranges = depth[:, [2, 2, 6, 6], [2, 6, 2, 6]]
    flat = np.broadcast_to(distance[:, None, None], depth.shape)
    return estimator.Readings(light, ranges, flat, flat), depth


def test_depth_is_learned_from_readings_and_ranges(estimator: ModuleType) -> None:
    learner = estimator.Estimator()
    learner.fit(*slanted_walls(estimator, 120, 1))
    readings, depth_m = slanted_walls(estimator, 40, 2)
    error = np.abs(learner.predict(readings) / depth_m - 1)
    constant = np.abs(readings.distance_m[..., None] / depth_m - 1)
    assert error.mean() < 0.02
    assert constant.mean() > 0.05


def test_missing_ranges_are_stood_in_for(estimator: ModuleType) -> None:
    ranges = np.array([[2.0, np.nan, 4.0, 6.0], [np.nan] * 4])
    maps = np.full((2, 8, 8), np.nan)
    filled = estimator.Readings(np.ones((2, 9)), ranges, maps, maps).filled_range_m
    assert filled.tolist() == [[2, 4, 4, 6], [estimator.FALLBACK_M] * 4]


def test_the_plan_of_the_estimator_can_be_read() -> None:
    planned = load_plan(EXAMPLES / "estimator.yaml")
    assert planned.plan.size >= 300

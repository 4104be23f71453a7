"""The examples that are shipped: they read what data sets hold."""

import estimator
import pytest

from datasets import make_set
from spisim.dataset import open as open_data_set


def test_the_estimator_finds_what_it_learns_from(tmp_path, capture):
    samples = open_data_set(make_set(tmp_path / "set", capture, done=3))
    readings, true_m = estimator.load(samples)
    assert readings.buckets.shape == (3, capture.plan.exposures)
    assert readings.depth_m.shape == readings.depth_nearest_m.shape == true_m.shape
    assert true_m[2] - true_m[0] == pytest.approx(2, nan_ok=True)

"""The examples that are shipped: they read what data sets hold."""

import estimator
import numpy as np

from datasets import make_set
from spisim.dataset import open as open_data_set


def test_the_estimator_learns_and_compares(tmp_path, capture):
    samples = open_data_set(make_set(tmp_path / "set", capture, done=56))
    readings, true_m = estimator.load(samples)
    assert readings.depth_m.shape == readings.depth_nearest_m.shape == true_m.shape
    errors = estimator.compare(samples)
    everywhere = next(iter(errors.values()))
    assert set(everywhere) == {"learned", "anchored (default)", "nearest spot"}
    assert np.isfinite([each["mae_m"] for each in everywhere.values()]).all()

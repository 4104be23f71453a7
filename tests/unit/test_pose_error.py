"""Errors of stated poses: their size, their correlation in time, and their delay."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from spisim.scene import Trajectory
from spisim.simulation.flight import PoseError, StatedPoses

FRAMES, STEP_S = 20_000, 0.01


@pytest.fixture
def path():
    """Forward along x at 2 m/s while it yaws."""
    times_s = np.array([0.0, 100.0, 200.0])
    positions_m = np.stack([2 * times_s, 0 * times_s, 0 * times_s], axis=1)
    return Trajectory.through(
        times_s, positions_m, Rotation.from_rotvec([[0, 0, 0.01 * t] for t in times_s])
    )


def drawn(path, frames=FRAMES, seed=0, **model):
    times_s = STEP_S * (np.arange(frames) + 0.5)
    return StatedPoses.drawn(path, times_s, PoseError(**model), np.random.SeedSequence(seed))


def test_errors_have_the_stated_size_and_correlation(path):
    errors = drawn(path, correlated_m=0.02, correlated_deg=0.3, correlation_s=0.3).errors
    sigma = np.repeat([0.02, np.radians(0.3)], 3)
    fading = np.exp(-STEP_S / 0.3)
    # Independent values among correlated ones: frames (1 - f²) / (1 + f²), Bartlett's formula.
    independent = FRAMES * (1 - fading**2) / (1 + fading**2)
    z = ((errors**2).mean(axis=0) / sigma**2 - 1) / np.sqrt(2 / independent)
    assert np.abs(z).max() < 4
    steps = np.diff(errors, axis=0) ** 2
    expected = 2 * sigma**2 * (1 - fading)
    assert np.abs((steps.mean(axis=0) / expected - 1) / np.sqrt(2 / FRAMES)).max() < 5


def test_drift_grows_with_the_root_of_time(path):
    last = np.array(
        [drawn(path, 100, seed, drift_m_per_sqrt_s=0.02).errors[[24, 99], 0] for seed in range(400)]
    )
    times_s = STEP_S * (np.array([24, 99]) + 0.5)
    z = ((last**2).mean(axis=0) / (0.02**2 * times_s) - 1) / np.sqrt(2 / 400)
    assert np.abs(z).max() < 4
    stated = drawn(path, 100, drift_m_per_sqrt_s=0.02)
    np.testing.assert_allclose(stated.variances[[24, 99], 0], 0.02**2 * times_s)


def test_a_delayed_pose_is_an_earlier_one(path):
    poses = drawn(path, 10, delay_s=0.03).rows(5, 10)
    np.testing.assert_allclose(poses.position_m[:, 0], 2 * (poses.time_s - 0.03))
    assert not poses.covariance.any()


def test_first_errors_do_not_depend_on_the_length_of_the_flight(path):
    model = {"white_m": 0.01, "correlated_deg": 0.2, "drift_m_per_sqrt_s": 0.01}
    np.testing.assert_array_equal(
        drawn(path, 10, **model).errors, drawn(path, 30, **model).errors[:10]
    )

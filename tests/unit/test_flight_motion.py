"""Poses of frames, and what breaks a flight."""

import numpy as np
import pytest

from flights import pose
from reconstruction.capture import Poses
from reconstruction.capture.motion import (
    CORRELATION_S,
    USUAL_SIGMA_M,
    USUAL_SIGMA_RAD,
    break_between,
    pose_at,
)


def stated(**changes):
    """Poses of one frame."""
    fields = {
        "time_s": np.array([2.0]),
        "position_m": np.array([[1.0, 2, 3]]),
        "orientation": np.array([[0, 0, np.sin(0.3), np.cos(0.3)]]),
        "covariance": np.diag([1.0, 4, 1, 0.1, 0.1, 0.4])[None],
    }
    return Poses(**fields | changes)


def test_a_pose_is_read_with_its_mean_variances():
    result = pose_at(stated())
    assert result.time_s == 2
    assert result.position_m.tolist() == [1, 2, 3]
    cosine, sine = np.cos(0.6), np.sin(0.6)
    np.testing.assert_allclose(result.axes, [[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    assert (result.variance_m2, result.variance_rad2) == pytest.approx((2, 0.2))


def test_frames_without_a_pose_have_none():
    assert pose_at(None) is None
    assert pose_at(Poses.none(2), 1) is None
    assert pose_at(stated(orientation=np.full((1, 4), np.nan))) is None


def test_unknown_covariance_is_the_usual_one():
    result = pose_at(stated(covariance=np.full((1, 6, 6), np.nan)))
    assert result.variance_m2 == USUAL_SIGMA_M**2
    assert result.variance_rad2 == pytest.approx(USUAL_SIGMA_RAD**2)


def test_errors_of_poses_close_in_time_are_common():
    now = pose(100, variance_m2=3.0, variance_rad2=5.0)
    before = np.array([now.time_s, now.time_s - CORRELATION_S, now.time_s - 1e9])
    metres2, rad2 = now.since(before, np.full(3, 2.0), np.full(3, 1.0))
    assert metres2 == pytest.approx([0, 5 * (1 - np.exp(-1)), 5])
    assert rad2 == pytest.approx([0, 6 * (1 - np.exp(-1)), 6])


@pytest.mark.parametrize(
    ("after", "why"),
    [
        (pose(10), "time 0.0854701 s is not after 0.0854701 s"),
        (pose(9), "time 0.0769231 s is not after"),
        (pose(10 + 117 * 6), "6 s without a pose"),
        (pose(11, (0, 5.1, 0)), "the position jumps by 5.1 m in 0.00855 s"),
        (pose(11, turn_rad=(0, 3.1, 0)), "the attitude jumps by 178° in 0.00855 s"),
    ],
)
def test_what_breaks_a_flight_is_named(after, why):
    assert why in break_between(pose(10), after)


@pytest.mark.parametrize(
    "after",
    [
        pose(11),
        pose(11, (0, 4.9, 0)),  # of the errors of two poses
        pose(10 + 117, (0, 49, 0)),
        pose(11, turn_rad=(0, 2.9, 0)),
        pose(10 + 117 * 4),
    ],
)
def test_what_a_drone_can_do_breaks_nothing(after):
    assert break_between(pose(10), after) is None

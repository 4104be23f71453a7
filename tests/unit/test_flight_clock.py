"""The clock of a flight's poses, estimated from its images."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from flights import FRAME_S, OPTICS, SHAPE
from reconstruction.capture.motion import CORRELATION_S, PoseAt
from reconstruction.depth import pixel_rays
from reconstruction.depth.memory.clock import (
    APART_S,
    LEVER_S,
    MAX_OFFSET_S,
    SYNCHRONOUS,
    TOLERANCE_S,
    ClockOffset,
    _growth,
)
from reconstruction.depth.memory.registration import Evidence, Registration

WALL_M = 4.0
RAYS = pixel_rays(OPTICS, SHAPE)
STATED = (0.02**2, np.radians(0.3) ** 2)


def at(time_s, stamp_s=None, motion="yaw"):
    """Pose of a drone before a wall at z = 4 m."""
    turn = (0, np.radians(7) * np.sin(2.6 * time_s), 0) if motion == "yaw" else (0, 0, 0)
    way = {
        "yaw": (0, 0, 0),
        "sway": (0.8 * np.sin(2.6 * time_s), 0, 0),
        "ahead": (0.1 * time_s, 0, 0.3 * time_s),
    }[motion]
    axes = Rotation.from_rotvec(turn).as_matrix()
    return PoseAt(time_s if stamp_s is None else stamp_s, np.array(way, float), axes, *STATED)


def view(pose):
    """Image and ln depth of a wall with a texture of some 60 cm."""
    along = RAYS @ pose.axes.T
    way = (WALL_M - pose.position_m[2]) / along[..., 2]
    x, y, _ = np.moveaxis(pose.position_m + way[..., None] * along, -1, 0)
    image = 2 + np.sin(9 * x + 1) * np.cos(7 * y) + np.sin(5 * x + 4 * y)
    return image, np.log(way)


def after(seconds, late_s, motion="yaw", *, rate=1.0, rng=None):
    """Estimate after a flight whose poses are those of `late_s` ago; the images' noise is .3."""
    clock, rng = ClockOffset(OPTICS, SHAPE), rng or np.random.default_rng(3)
    for number in range(round(seconds / FRAME_S * rate)):
        time_s = 1 + number * FRAME_S / rate
        image, log_depth = view(at(time_s, motion=motion))
        noisy = image + 0.3 * rng.standard_normal(SHAPE)
        clock.take(at(time_s - late_s, time_s, motion), noisy, log_depth)
    return clock


@pytest.mark.parametrize("motion", ["yaw", "sway"])
@pytest.mark.parametrize("late_s", [0.1, -0.12, 0.2])
def test_a_constant_delay_is_found_where_the_drone_turns_or_sways(motion, late_s):
    clock = after(3, late_s, motion)
    assert abs(clock.offset_s - late_s) < 3 * max(clock.sigma_s, 0.003)
    assert clock.sigma_s < 0.03


def test_a_delay_beyond_the_grid_is_at_its_end():
    assert after(3, 0.5).offset_s == pytest.approx(MAX_OFFSET_S, abs=0.02)


@pytest.mark.parametrize(("motion", "late_s"), [("yaw", 0.0), ("sway", 0.0), ("ahead", 0.15)])
def test_nothing_is_corrected_where_nothing_speaks_for_it(motion, late_s):
    clock = after(2.5, late_s, motion)
    assert clock.offset_s == 0
    assert clock.corrected() is clock._poses[-1]


def test_before_any_pair_the_prior_is_kept():
    clock = after(0.5, 0.1)
    assert clock.offset_s == 0
    assert clock.sigma_s == pytest.approx(0.13 * np.sqrt(1 - SYNCHRONOUS), rel=0.05)


def test_noise_of_poses_that_changes_from_frame_to_frame_is_no_delay():
    clock, rng = ClockOffset(OPTICS, SHAPE), np.random.default_rng(1)
    for number in range(500):
        true = at(number * FRAME_S)
        off = Rotation.from_rotvec(np.radians(0.3) * rng.standard_normal(3)).as_matrix()
        noisy_m = true.position_m + 0.02 * rng.standard_normal(3)
        clock.take(true._replace(position_m=noisy_m, axes=true.axes @ off), *view(true))
        assert clock.offset_s == 0
    assert clock.sigma_s < 0.03


def test_poses_are_corrected_from_sure_to_unsure():
    clock = ClockOffset(OPTICS, SHAPE)
    near = np.abs(clock._grid_s) < TOLERANCE_S
    for synchronous, corrects in [(0.1, False), (0.04, True), (0.1, True), (0.4, False)]:
        clock._log_likelihood = np.full(len(near), -30.0)
        clock._log_likelihood[-1] = np.log(1 - synchronous) - clock._log_prior[-1]
        clock._log_likelihood[near] = np.log(synchronous / near.sum()) - clock._log_prior[near]
        clock._describe()
        assert (clock.offset_s > 0) == corrects


@pytest.mark.parametrize("late_s", [0.1, -0.1])
def test_a_corrected_pose_is_nearer_to_the_true_one(late_s):
    clock = after(3, late_s)
    stated, corrected = clock._poses[-1], clock.corrected()
    true = at(stated.time_s)
    off = [
        np.degrees(Rotation.from_matrix(true.axes.T @ each.axes).magnitude())
        for each in (stated, corrected)
    ]
    assert off[1] < 0.35 * off[0]
    assert corrected.time_s == stated.time_s
    assert corrected.variance_rad2 > stated.variance_rad2


def test_a_pose_early_by_less_than_the_lever_is_between_its_neighbours():
    clock = ClockOffset(OPTICS, SHAPE)
    for number in range(60):
        clock.take(at(number * FRAME_S), np.ones(SHAPE), None)
    clock.offset_s, clock.sigma_s = -0.05, 0.01
    corrected, true = clock.corrected(), at(59 * FRAME_S - 0.05)
    np.testing.assert_allclose(corrected.axes, true.axes, atol=1e-5)
    spin_rad_s = np.radians(7) * 2.6 * np.cos(2.6 * true.time_s)
    unsure = corrected.variance_rad2 - _growth(0.15, FRAME_S) * STATED[1]
    assert unsure == pytest.approx((0.01 * spin_rad_s) ** 2 / 3, rel=0.05)


def test_after_a_jump_poses_are_as_stated_until_their_motion_is_known():
    clock = after(3, 0.1)
    assert clock.offset_s
    clock.begin()
    for number in range(15):
        pose = at(9 + number * FRAME_S)
        clock.take(pose, *view(pose))
        assert (clock.corrected() is pose) == (number * FRAME_S < LEVER_S)


def test_other_frame_rates_are_as_good():
    assert after(4, 0.1, rate=0.25).offset_s == pytest.approx(0.1, abs=0.03)


@pytest.mark.parametrize("rate", [0.02, 0.06])
def test_few_frames_a_second_say_nothing(rate):
    clock = after(20, 0.1, rate=rate)
    assert clock.sigma_s == ClockOffset(OPTICS, SHAPE).sigma_s


def test_no_pair_spans_a_gap():
    """Nothing is learned until all poses that a pair needs are of after the gap."""
    clock = ClockOffset(OPTICS, SHAPE)
    for number in range(200):
        time_s = number * FRAME_S + (2.0 if number >= 60 else 0.0)
        clock.take(at(time_s), *view(at(time_s)))
        learned = clock.sigma_s != ClockOffset(OPTICS, SHAPE).sigma_s
        assert not learned or number * FRAME_S > 60 * FRAME_S + 2 * MAX_OFFSET_S + APART_S
    assert learned


@pytest.mark.parametrize("image", [np.zeros(SHAPE), np.full(SHAPE, 3.0), np.eye(64)])
def test_images_that_never_change_say_nothing_or_that_all_is_well(image):
    clock = ClockOffset(OPTICS, SHAPE)
    for number in range(300):
        clock.take(at(0, number * FRAME_S), image, np.full(SHAPE, 1.0))
        assert np.isfinite(clock.sigma_s)
    assert clock.offset_s == 0


def test_a_frame_of_one_brightness_says_nothing():
    clock = ClockOffset(OPTICS, SHAPE)
    for number in range(200):
        pose = at(number * FRAME_S)
        image, log_depth = view(pose)
        clock.take(pose, np.full(SHAPE, 3.0) if 60 <= number < 100 else image, log_depth)
        assert np.isfinite(clock.sigma_s)


@pytest.mark.parametrize("shape", [(1, 64), (64, 1), (64, 2), (16, 16), (16, 32), (128, 96)])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e12])
def test_images_of_any_shape_and_scale_are_taken(shape, scale):
    clock, rng = ClockOffset(OPTICS, shape), np.random.default_rng(2)
    for number in range(150):
        log_depth = rng.uniform(np.log(0.1), np.log(50), shape)
        clock.take(at(number * FRAME_S), scale * rng.random(shape), log_depth)
        assert np.isfinite(clock.sigma_s)
        assert np.isfinite(clock.corrected().axes).all()


def test_a_pair_is_learned_once():
    clock, times_s = ClockOffset(OPTICS, SHAPE), []
    evidence = clock._registration.evidence

    def counted(frame, *others):
        times_s.append(frame.time_s)
        return evidence(frame, *others)

    clock._registration.evidence = counted
    for number in range(250):
        image, log_depth = view(at(number * FRAME_S))
        clock.take(at(number * FRAME_S), image, None if 90 < number < 120 else log_depth)
    assert len(times_s) > 20
    assert len(set(times_s)) == len(times_s)


def test_memory_is_flat_and_frames_without_a_map_are_passed_over():
    clock = ClockOffset(OPTICS, SHAPE)
    image, log_depth = view(at(0))
    for number in range(1000):
        clock.take(at(0, number * FRAME_S), image, log_depth if number % 10 == 0 else None)
    assert len(clock._poses) < 1.2 / FRAME_S
    assert len(clock._keyframes) < 12
    clock.begin()
    clock.take(at(0, 0.0), image, log_depth)  # another epoch
    assert len(clock._poses) == 1


def test_images_give_back_the_error_of_a_pose():
    registration, (before, now) = Registration(OPTICS, SHAPE), (at(0.0), at(0.2))
    frames = [registration.keyframe(each.time_s, *view(each)) for each in (before, now)]
    off = np.radians([0.3, -0.2, 0.4])
    stated = now.axes @ Rotation.from_rotvec(off).as_matrix().T
    evidence = registration.evidence(
        frames[1], frames[0], before.axes.T @ stated, np.zeros(3), np.ones(6)
    )
    turn_only = np.linalg.solve(evidence.information[:3, :3], evidence.score[:3])
    np.testing.assert_allclose(np.degrees(turn_only), np.degrees(off), atol=0.1)


def test_views_without_overlap_are_no_evidence():
    registration = Registration(OPTICS, SHAPE)
    frame = registration.keyframe(0.0, *view(at(0)))
    away = Rotation.from_rotvec([0, 1.0, 0]).as_matrix()
    assert registration.evidence(frame, frame, away, np.zeros(3), np.ones(6)) is None


def test_noise_beside_evidence_adds_to_its_variance():
    evidence = Evidence(np.diag(np.full(6, 4.0)), np.full(6, 2.0))
    result = evidence.marginalized(np.full(6, 0.5))
    np.testing.assert_allclose(np.diag(result.information), 1 / (1 / 4 + 1 / 0.5))
    np.testing.assert_allclose(result.score / np.diag(result.information), 0.5)


@pytest.mark.parametrize("part", [-1.0, 0.0, 0.3, 1.0, 2.0])
def test_the_variance_of_a_pose_carried_on_is_that_of_correlated_errors(part):
    rng = np.random.default_rng(5)
    common = np.exp(-0.1 / CORRELATION_S)
    one, other = rng.standard_normal((2, 200_000))
    other = common * one + np.sqrt(1 - common**2) * other
    assert _growth(part, 0.1) == pytest.approx(np.var((1 - part) * one + part * other), rel=0.02)

"""Images along a flight: the last one moved by poses and depths, and what a memory makes of it."""

from dataclasses import replace

import numpy as np
import pytest

from flights import FRAME_S, OPTICS, SHAPE, pose
from images import natural_image
from reconstruction import Reconstructor, make_plan
from reconstruction.capture import Poses
from reconstruction.depth import LastView
from reconstruction.image import Coefficients, Estimate
from reconstruction.image.memory import CHANGE_ERROR, Memory
from reconstruction.image.methods.recursive import _Remembering
from reconstruction.operators import decoder_for
from videos import METHODS, cycle_of, video

PIXEL = 2 * OPTICS.tan_half_width / SHAPE[1]
IMAGE = natural_image(64, 3)
INSIDE = (slice(4, -4), slice(4, -4))
NOISE = 0.3
OPERATOR = decoder_for(make_plan((16, 16), 60, polarity="signed")).operator
EVERY = np.arange(60)


def moved(now, depth_m=4.0, before=None, image=IMAGE):
    """An image as it is seen from the next pose."""
    view = LastView(OPTICS, SHAPE)
    view.turn_to(pose() if before is None else before)
    view.keep(None if depth_m is None else np.full(SHAPE, depth_m))
    view.turn_to(now)
    (result,) = view.motion()(image[None])
    return result


@pytest.mark.parametrize("depth_m", [2.0, 9.0])
def test_a_shift_by_a_pixel_moves_a_plane_by_one(depth_m):
    """Nearly as bright: ranges along the rays differ by the shift."""
    now = pose(1, (PIXEL * depth_m, 0, 0))
    np.testing.assert_allclose(
        moved(now, depth_m)[INSIDE], np.roll(IMAGE, -1, axis=1)[INSIDE], rtol=0.01, atol=1e-9
    )
    down = moved(pose(1, (0, PIXEL * depth_m, 0)), depth_m)
    np.testing.assert_allclose(down[INSIDE], np.roll(IMAGE, -1, axis=0)[INSIDE], rtol=0.01)


@pytest.mark.parametrize("depth_m", [2.0, None])
def test_a_turn_moves_what_is_near_and_far_alike(depth_m):
    now = pose(1, turn_rad=(0, np.arctan(PIXEL), 0))
    middle = (slice(28, 36), slice(28, 36))
    np.testing.assert_allclose(
        moved(now, depth_m)[middle], np.roll(IMAGE, -1, axis=1)[middle], rtol=0.02
    )


def test_what_comes_near_is_brighter():
    """By the square of the range; the map is that of the frame before."""
    nearer = moved(pose(1, (0, 0, 0.4)), image=np.ones(SHAPE))
    assert nearer[32, 32] == pytest.approx((4.4 / 4) ** 2, rel=1e-3)


def test_no_depth_is_far_away():
    still = moved(pose(1, (0.02, 0, 0)), depth_m=None)
    assert np.abs(still - IMAGE).max() < 0.1 * np.abs(np.roll(IMAGE, -1, axis=1) - IMAGE).max()
    holes = np.full(SHAPE, 4.0)
    holes[:, 32:] = np.nan
    assert np.isfinite(moved(pose(1, (0.1, 0, 0)), holes)).all()


@pytest.mark.parametrize(
    ("before", "now"),
    [(pose(), None), (pose(1), pose(0)), (pose(), pose(1, (90, 0, 0))), (pose(), pose(2000))],
)
def test_without_a_pose_that_follows_nothing_is_known(before, now):
    view = LastView(OPTICS, SHAPE)
    view.turn_to(before)
    assert view.motion() is None
    view.keep(np.full(SHAPE, 4.0))
    view.turn_to(now)
    assert view.motion() is None
    view.keep(np.full(SHAPE, 4.0))
    view.turn_to(pose(3000))
    assert view.motion() is None


def test_a_frame_that_failed_is_no_last_one():
    """What is known of a frame is of that just before, or nothing."""
    view = LastView(OPTICS, SHAPE)
    view.turn_to(pose(0))
    view.keep(None)
    view.turn_to(pose(1))
    assert view.motion() is not None
    view.turn_to(pose(2))  # the frame at 1 was not kept
    assert view.motion() is None


def test_absurd_depths_are_as_near_or_far_as_can_be():
    depths = np.full(SHAPE, 1e160)
    depths[:32] = 1e-30
    assert np.isfinite(moved(pose(1, (0.1, 0, 0)), depths)).all()


def pan(frames, pixels):
    """A wide image that moves by whole pixels."""
    wide = natural_image(128, 5)
    return [wide[40:72, t * pixels : t * pixels + 32] for t in range(frames)]


def probabilities(images, changes_of):
    """Of no change and of each stated one, after the last frame."""
    cycle = cycle_of((32, 32), 64, 4, polarity="signed")
    index = np.unique(np.concatenate([decoder_for(plan).index for plan in cycle]))
    every = decoder_for(make_plan((32, 32), index.size, polarity="signed")).operator
    memory, rng = Memory(every), np.random.default_rng(2)
    for number, image in enumerate(images):
        rows = np.searchsorted(index, decoder_for(cycle[number % 4]).index)
        read = every.forward(image)[rows] + rng.normal(0, NOISE, rows.size)
        changes = changes_of(every, images[number - 1], image) if number else None
        memory.take(rows, Coefficients(read, np.full(rows.size, NOISE)), changes)
    return memory._joint.sum(axis=1)


def test_readings_tell_right_changes_from_wrong_ones():
    images, still = pan(16, 2), [pan(2, 2)[0]] * 16

    def right(operator, last, now):
        return operator.forward(now - last)[None]

    def wrong(operator, last, now):
        return operator.forward(last - now)[None]

    def either(operator, last, now):
        return np.concatenate([wrong(operator, last, now), right(operator, last, now)])

    def of_another(operator, *_):
        return operator.forward(images[1] - images[0])[None]

    assert probabilities(images, right)[1] > 0.99
    assert probabilities(images, wrong)[1] < 0.01
    assert probabilities(images, either)[2] > 0.99
    assert probabilities(still, of_another)[1] < 0.01


def test_a_large_change_is_trusted_less():
    """A fraction k = rho S / (rho S + e^2 c^2) of the estimate is left, if no reading says more."""
    memory, change = Memory(OPERATOR, speeds=(0.0,)), np.zeros((1, 60))
    values = OPERATOR.forward(natural_image(16, 1))
    memory.take(EVERY, Coefficients(values, np.full(60, NOISE)))
    prior = memory._expected * memory._scale
    rho = memory._precision * prior / (1 + memory._precision * prior)
    change[0, 7] = 100 * NOISE
    memory.weights = memory._predicted = np.array([1.0, 0.0])
    memory._joint = np.array([[0.0, 0.0], [1.0, 0.0]])
    memory._predict(prior, EVERY[:30], np.zeros(30), np.full(30, 1e12), change)
    kept = 1 / (1 + (CHANGE_ERROR * change[0, 7] / OPERATOR.row_length) ** 2 / (rho[7] * prior[7]))
    assert kept < 0.9
    of_none, of_change = memory._joint[:, 0]
    left = memory._precision * prior / (1 + memory._precision * prior)
    np.testing.assert_allclose(left[7], (of_none + of_change * kept) * rho[7], rtol=1e-6)
    np.testing.assert_allclose(left[8:], rho[8:], rtol=1e-6)


def of_a_turning_camera(images, noise, step_px, seed=0):
    """A recording of images, with poses that turn by so many pixels a frame."""
    turns = np.arctan(np.arange(len(images)) * step_px * 2 * OPTICS.tan_half_width / 32)
    zero = np.zeros_like(turns)
    poses = Poses(
        FRAME_S * (1 + np.arange(len(images))),
        np.zeros((len(images), 3)),
        np.stack([zero, np.sin(turns / 2), zero, np.cos(turns / 2)], axis=1),
        np.full((len(images), 6, 6), np.nan),
    )
    recording = video(images, cycle_of((32, 32), 64, 4), noise, seed)
    return replace(recording, optics=OPTICS, poses=poses)


def gain_db(recording, images):
    """By how much poses lower the error of the later images."""
    errors = []
    for each in (recording, replace(recording, poses=None)):
        results = Reconstructor(each.setup, image=METHODS[1]).batch(each.batch(0, each.frames))
        some = zip(results[6:], images[6:], strict=True)
        errors.append(np.mean([np.mean((result.image - image) ** 2) for result, image in some]))
    return 10 * np.log10(errors[1] / errors[0])


@pytest.mark.parametrize(("noise", "least_db"), [(1.0, 0.7), (10.0, 0.2)])
def test_poses_of_a_turning_camera_count(noise, least_db):
    images = pan(16, 2)
    assert gain_db(of_a_turning_camera(images, noise, 2), images) > least_db


@pytest.mark.parametrize(("noise", "most_lost_db"), [(1.0, 0.01), (5.0, 0.1), (10.0, 0.4)])
def test_wrong_poses_hardly_matter(noise, most_lost_db):
    """In dim light they are less easily known for what they are."""
    moving, still = pan(16, 2), [pan(1, 2)[0]] * 16
    assert gain_db(of_a_turning_camera(moving, noise, -2), moving) > -most_lost_db
    assert gain_db(of_a_turning_camera(still, noise, 1), still) > -most_lost_db


def test_a_veil_stays_with_the_camera():
    """A bright gradient that does not move costs nothing of what poses gain."""
    scene = pan(16, 2)
    veil = 3 * np.ptp(scene[0]) * np.linspace(0, 1, 32) ** 2
    images = [each + veil for each in scene]
    assert gain_db(of_a_turning_camera(images, 1.0, 2), images) > 0.5


def test_unknown_poses_are_as_none():
    images = pan(8, 2)
    known = of_a_turning_camera(images, 1.0, 2)
    nowhere = replace(
        known.poses, position_m=np.full((8, 3), np.nan), orientation=np.full((8, 4), np.nan)
    )
    unknown = replace(known, poses=nowhere)
    one, other = (
        Reconstructor(each.setup, image=METHODS[1]).batch(each.batch(0, 8))
        for each in (unknown, replace(known, poses=None))
    )
    for some, others in zip(one, other, strict=True):
        np.testing.assert_array_equal(some.image, others.image)


class Painted:
    """An image method, wrong in one frame."""

    title = "painted"

    def __init__(self):
        self._frames = 0

    def compile(self, operator):
        def solve(coefficients):
            self._frames += 1
            return Estimate(np.full(operator.image_shape, np.nan if self._frames == 3 else 1.0))

        return solve


def test_an_image_that_is_no_number_is_forgotten():
    plans = cycle_of((32, 32), 64, 4, polarity="signed")
    operators = [decoder_for(plan).operator for plan in plans]
    inner = Painted()
    view = LastView(OPTICS, (32, 32))
    index = np.unique(np.concatenate([each.index for each in operators]))
    remembering = _Remembering(inner, type(operators[0])(operators[0].basis, index), view.motion)
    solve = remembering.compile(operators[0])
    for number in range(6):
        view.turn_to(pose(number, turn_rad=(0, 0.01 * number, 0)))
        solve(Coefficients(np.ones(64) + number, np.ones(64)))
        view.keep(None)
    assert np.isfinite(remembering._memory.weights).all()

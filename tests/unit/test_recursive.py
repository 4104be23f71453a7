"""Frames that remember: closed forms of the memory, and images that are never worse for it."""

import numpy as np
import pytest
from scipy.stats import norm

from images import natural_image
from reconstruction import (
    InputError,
    Reconstructor,
    make_plan,
    read_result,
    reconstruct,
    write_capture,
)
from reconstruction.cli import main
from reconstruction.image import Coefficients
from reconstruction.image.memory import SPEEDS, Memory
from reconstruction.operators import decoder_for
from reconstruction.operators.bases.dense import Dense
from videos import METHODS, cycle_of, gains_db, video

SHAPE = (16, 16)
OPERATOR = decoder_for(make_plan(SHAPE, 60, polarity="signed")).operator
EVERY = np.arange(60)


def pan(frames, pixels_per_frame, seed, side=32):
    """A flight past a wide image: frames (F, side, side), shifted by fractions of a pixel."""
    fine = natural_image(10 * side, seed)
    steps = np.round(np.arange(frames) * pixels_per_frame * 4).astype(int)
    cut = [fine[::1, step : step + 4 * side][: 4 * side] for step in steps]
    return [each.reshape(side, 4, side, 4).mean(axis=(1, 3)) for each in cut]


# The memory


def test_of_a_still_scene_the_variance_is_that_of_the_mean():
    """r / K after K frames, told and in fact."""
    rng = np.random.default_rng(0)
    truth = OPERATOR.forward(natural_image(16, 1))
    noise, frames, runs = 3.0, 8, 60
    errors = np.empty((runs, 60))
    for run in range(runs):
        memory = Memory(OPERATOR, speeds=(0.0,))
        for _ in range(frames):
            read = Coefficients(truth + rng.normal(0, noise, 60), np.full(60, noise))
            given = memory.take(EVERY, read)
        errors[run] = given.values - truth
        np.testing.assert_allclose(given.noise, noise / np.sqrt(frames), rtol=1e-6)
    z = (np.mean(errors**2) * frames / noise**2 - 1) / np.sqrt(2 / errors.size)
    assert abs(z) < 4


def test_the_first_frame_is_as_it_was_read():
    values = OPERATOR.forward(natural_image(16, 2))[:30]
    given = Memory(OPERATOR).take(EVERY[:30], Coefficients(values, np.full(30, 2.0)))
    np.testing.assert_allclose(given.values[:30], values)
    np.testing.assert_allclose(given.noise[:30], 2.0)
    assert not given.measured[30:].any()
    assert not given.values[30:].any()


def test_a_steady_shift_takes_off_the_square_of_its_age():
    """Shifted n times by v it is shifted by n v, and exp(-(2 pi f n v)^2 / 2) is left, not n times
    what one shift leaves; a cut would leave nothing."""
    memory = Memory(OPERATOR, speeds=(0.1,))
    memory.take(EVERY, Coefficients(OPERATOR.forward(natural_image(16, 3)), np.full(60, 1e-3)))
    prior, stays = memory._expected * memory._scale, memory.weights[0]
    no_return = np.zeros(0)

    def reported():
        """E(x) of every coefficient: what is held, by how much that counts against the prior."""
        valid = memory._precision * prior
        return memory._values * valid / (1 + valid)

    first, left = reported(), memory._left[0]
    for age in (1, 2, 3):
        memory._predict(prior, np.zeros(0, dtype=int), no_return, no_return, None)
        np.testing.assert_allclose(reported(), stays**age * left ** (age**2) * first, rtol=1e-3)


def test_what_a_shift_leaves_is_the_correlation_of_shifted_images():
    """By quadrature over the shifts, of images of independent cosines of the prior's variance."""
    speed = 0.5
    frequency = np.hypot.outer(np.arange(16) / 32, np.arange(16) / 32)
    frequency[0, 0] = np.inf
    pixel = np.arange(16) + 0.5
    size = np.sqrt(np.where(np.arange(16) == 0, 1, 2) / 16)

    def seen(down, right):
        """What the rows see of every cosine, (16, 16, 60)."""
        vertical, horizontal = (
            size[:, None] * np.cos(np.pi / 16 * np.outer(np.arange(16), pixel + by))
            for by in (down, right)
        )
        return OPERATOR.forward(np.einsum("ia,jb->ijab", vertical, horizontal))

    still = seen(0, 0)
    nodes, weights = np.polynomial.hermite_e.hermegauss(9)
    weights /= weights.sum()
    shifted = sum(
        one * other * seen(speed * down, speed * right)
        for down, one in zip(nodes, weights, strict=True)
        for right, other in zip(nodes, weights, strict=True)
    )
    covariance = np.einsum("ij,ijk->k", frequency**-2.0, still * shifted)
    variance = np.einsum("ij,ijk->k", frequency**-2.0, still**2)
    varying = OPERATOR.varying
    expected = covariance[varying] / variance[varying]
    np.testing.assert_allclose(Memory(OPERATOR, (speed,))._left[0][varying], expected, rtol=1e-6)
    assert expected.min() < 0.9  # else speed makes no difference here


def test_faster_scenes_leave_less_and_a_cut_nothing():
    left = Memory(OPERATOR)._left
    assert (left[0] == 1).all()
    assert (np.diff(left[:-1], axis=0) <= 1e-12).all()
    assert (left[-1] == 0).all()


def test_speeds_are_weighted_by_their_likelihood():
    """Bayes: a frame's readings are as likely by a speed as the normal densities that it predicts.

    A cut leaves nothing of the frame before, and a scene that stands still all of it.
    """
    rng, noise = np.random.default_rng(8), 20.0
    truth = OPERATOR.forward(natural_image(16, 3))
    first, second = truth + rng.normal(0, noise, (2, 60))
    memory = Memory(OPERATOR, speeds=(0.0,))
    memory.take(EVERY, Coefficients(first, np.full(60, noise)))
    still, cut = 0.8 * memory.weights + 0.2 * memory._predicted
    memory.take(EVERY, Coefficients(second, np.full(60, noise)))
    length = OPERATOR.row_length
    variance, sigma = memory._expected * memory._scale, noise / length
    fraction = variance / (variance + sigma**2)
    by_first = norm(fraction * first / length, np.sqrt((1 - fraction) * variance + sigma**2))
    by_prior = norm(0, np.sqrt(variance + sigma**2))
    odds = np.log(cut / still) + np.sum(
        by_prior.logpdf(second / length) - by_first.logpdf(second / length)
    )
    assert np.log(memory.weights[1] / memory.weights[0]) == pytest.approx(odds, rel=1e-6)


@pytest.mark.parametrize("pixels_per_frame", [0.0, 0.25, 1.0])
def test_the_speed_is_told_from_the_readings(pixels_per_frame):
    operator = decoder_for(make_plan((32, 32), 120, polarity="signed")).operator
    memory = Memory(operator)
    rng = np.random.default_rng(4)
    for image in pan(8, pixels_per_frame, 5):
        values = operator.forward(image)
        memory.take(
            np.arange(120), Coefficients(values + rng.normal(0, 0.3, 120), np.full(120, 0.3))
        )
    reported = memory.weights[:-1] @ SPEEDS
    assert reported < 0.05 if pixels_per_frame == 0 else 0.2 < reported / pixels_per_frame < 2


def test_a_cut_is_told_and_nothing_is_left_of_what_was():
    """What is read again has the noise of its reading alone, what is not is hardly known."""
    memory = Memory(OPERATOR)
    noise = np.full(60, 0.1)
    before, after = (OPERATOR.forward(natural_image(16, seed)) for seed in (6, 7))
    for _ in range(10):
        given = memory.take(EVERY, Coefficients(before, noise))
    np.testing.assert_allclose(given.noise, 0.1 / np.sqrt(10), rtol=0.1)
    given = memory.take(EVERY[:40], Coefficients(after[:40], noise[:40]))
    assert memory.weights[:5].sum() < 1e-6
    np.testing.assert_allclose(given.noise[:40], 0.1, rtol=0.01)
    np.testing.assert_allclose(given.values[:40], after[:40], atol=0.1)
    assert (given.noise[40:] > 30 * 0.1).all()


# Images


@pytest.mark.parametrize(("noise", "seed"), [(0.3, 1), (3.0, 2)])
def test_images_are_never_worse_than_those_of_single_frames(noise, seed):
    """Within what noise makes of a single image."""
    plans = cycle_of((32, 32), 64, 6)
    recordings = {
        "still": [natural_image(32, seed)] * 12,
        "flight": pan(12, 0.1, seed),
        "fast flight": pan(12, 2.0, seed),
        "cuts": [natural_image(32, 10 * seed + frame // 4) for frame in range(12)],
        "other images": [natural_image(32, 100 * seed + frame) for frame in range(12)],
    }
    gains = {
        name: gains_db(video(images, plans, noise, seed), images)
        for name, images in recordings.items()
    }
    for name, gain in gains.items():
        assert gain.min() > -0.3, name
        assert gain.mean() > -0.02, name
    assert gains["still"][7:].min() > 1
    assert gains["flight"][7:].min() > 0.5


def test_a_still_scene_is_soon_as_if_all_patterns_were_one_frame_s():
    """Within 0.3 dB, though some patterns are read more often."""
    image = natural_image(32, 8)
    plans = cycle_of((32, 32), 64, 8, common=0)
    whole = make_plan((32, 32), 1 + 8 * 63, polarity="single-ended")
    result = reconstruct(video([image] * 8, plans, 1.0), 7, image=METHODS[1]).image
    at_once = reconstruct(video([image], [whole], 1.0), image=METHODS[0]).image
    errors = [np.mean((each - image) ** 2) for each in (result, at_once)]
    assert 10 * np.log10(errors[0] / errors[1]) < 0.3


def test_one_frame_is_led_in_by_those_before_it():
    images = pan(6, 0.1, 9)
    recording = video(images, cycle_of((32, 32), 40, 3), 1.0)
    turn = Reconstructor(recording.setup, image=METHODS[1]).batch(recording.batch(0, 6))
    np.testing.assert_array_equal(reconstruct(recording, 5, image=METHODS[1]).image, turn[5].image)
    alone = reconstruct(recording, 5, image=METHODS[0])
    assert np.abs(alone.image - turn[5].image).max() > 1e-3


def test_the_command_leads_a_frame_in_too(tmp_path):
    recording = video(pan(5, 0.1, 9, side=16), cycle_of(SHAPE, 20, 3), 1.0)
    write_capture(recording, tmp_path / "capture.h5")
    command = ["reconstruct", str(tmp_path / "capture.h5"), "--frame", "4", "--image", METHODS[1]]
    assert main([*command, "-o", str(tmp_path / "result")]) == 0
    result, expected = (
        read_result(tmp_path / "result" / "result.h5"),
        reconstruct(recording, 4, image=METHODS[1]),
    )
    np.testing.assert_array_equal(result.image, expected.image)
    assert (result.frame, result.recording) == (4, expected.recording)


def test_every_recording_has_a_memory_of_its_own():
    images = pan(4, 0.1, 9)
    recording = video(images, cycle_of((32, 32), 40, 3), 1.0)
    one, other = (Reconstructor(recording.setup, image=METHODS[1]) for _ in range(2))
    first = one(recording.frame(0)).image
    one.batch(recording.batch(1, 4))
    np.testing.assert_array_equal(other(recording.frame(0)).image, first)


def test_what_cannot_remember_is_refused():
    images = [natural_image(16, 1)]
    dense = Dense(np.random.default_rng(0).random((30, 16, 16)))
    plan = make_plan(SHAPE, 30, "natural", "differential", dense)
    with pytest.raises(InputError, match="'recursive' needs patterns of an orthogonal basis"):
        reconstruct(video(images, [plan], 1.0), image="recursive")
    recording = video(images, cycle_of(SHAPE, 20, 2), 1.0)
    with pytest.raises(InputError, match="is recursive already"):
        reconstruct(recording, image="recursive:recursive")
    with pytest.raises(InputError, match="unknown image method"):
        reconstruct(recording, image="recursive:no-such")

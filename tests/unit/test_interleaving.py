"""Frames that show different patterns: plans, capture, file, selection."""

from dataclasses import replace

import numpy as np
import pytest

from captures import full_capture
from hdf5files import changed
from images import natural_image
from reconstruction import (
    InputError,
    Reconstructor,
    first_patterns,
    open_capture,
    read_capture,
    reconstruct,
    write_capture,
)
from reconstruction.operators import ORDERS, interleaved, make_plan
from reconstruction.operators.bases.hadamard import Hadamard
from videos import cycle_of, video

SHAPE = (16, 16)


@pytest.fixture
def recording():
    images = [natural_image(16, seed) for seed in range(7)]
    return video(images, cycle_of(SHAPE, 20, 3), noise=0.01)


@pytest.mark.parametrize("polarity", ["differential", "single-ended", "signed"])
def test_frames_share_what_is_common_and_together_show_everything(polarity):
    whole = make_plan(SHAPE, 8 + 4 * 12, polarity=polarity)
    plans = interleaved(whole, 4, 8)
    common = set.intersection(*(set(plan.distinct.tolist()) for plan in plans))
    assert common == set(whole.distinct[:8].tolist())
    assert set().union(*(plan.distinct.tolist() for plan in plans)) == set(whole.distinct.tolist())
    assert {plan.sampled for plan in plans} == {20}
    assert len({plan.exposures for plan in plans}) == 1
    for plan in plans:  # in the order of the whole, and of all its frequencies
        indices = np.searchsorted(np.argsort(whole.distinct), plan.distinct)
        assert indices.size == 20
        of_all = np.flatnonzero(np.isin(whole.distinct, plan.distinct))
        assert np.diff(of_all[8:]).max() <= 4


def test_the_level_is_common_wherever_the_order_has_it():
    basis = Hadamard(SHAPE)
    backwards = ORDERS["sequency-2d"](basis)[::-1]
    index = np.append(backwards[-9:], 0)
    plan = replace(
        make_plan(SHAPE, 9, polarity="single-ended"),
        index=index,
        polarity=np.append(np.ones(9), -1),
    )
    assert all(0 in each.distinct for each in interleaved(plan, 4, 1))


@pytest.mark.parametrize(("frames", "common"), [(4, 9), (3, 7), (2, 60), (2, -1)])
def test_what_cannot_be_dealt_out_is_refused(frames, common):
    with pytest.raises(InputError, match=r"56 patterns.*cannot be distributed evenly"):
        interleaved(make_plan(SHAPE, 56), frames, common)


def test_a_file_tells_the_plan_of_every_frame(recording, tmp_path):
    path = tmp_path / "capture.h5"
    write_capture(recording, path)
    whole = read_capture(path)
    assert len(whole.setup.plans) == 3
    for read, written in zip(whole.setup.plans, recording.setup.plans, strict=True):
        np.testing.assert_array_equal(read.index, written.index)
        np.testing.assert_array_equal(read.polarity, written.polarity)
    with open_capture(path) as file:
        for frame in range(7):
            assert file.setup.plan_of(frame).index.tolist() == (
                recording.setup.plans[frame % 3].index.tolist()
            )
            cut = file.capture(frame, min(frame + 2, 7))  # as if recorded from there on
            result, expected = reconstruct(cut), reconstruct(recording, frame)
            assert result.recording == expected.recording
            np.testing.assert_array_equal(result.image, expected.image)


@pytest.mark.parametrize(
    ("name", "change", "reported"),
    [
        (
            "polarity",
            lambda polarity: polarity[0],
            r"has shape \(21,\), expected \(3, 21\)",
        ),
        ("index", lambda index: index[0], "index.*1-D|polarity"),
        ("index", lambda index: index[:, :, None], "non-empty 1-D"),
        ("index", lambda index: index + 500, "outside 0..255"),
    ],
)
def test_plans_that_do_not_fit_together_are_refused(recording, tmp_path, name, change, reported):
    write_capture(recording, tmp_path / "capture.h5")
    with changed(tmp_path / "capture.h5") as file:
        values = file[f"patterns/{name}"][()]
        del file[f"patterns/{name}"]
        file[f"patterns/{name}"] = change(values)
        file[f"patterns/{name}"].attrs["units"] = "1"
    with pytest.raises(InputError, match=reported):
        read_capture(tmp_path / "capture.h5")


def test_more_plans_than_a_cycle_has_are_refused(recording, tmp_path):
    write_capture(recording, tmp_path / "capture.h5")
    with changed(tmp_path / "capture.h5") as file:
        for name in ("index", "polarity"):
            values = np.repeat(file[f"patterns/{name}"][:1], 5000, axis=0)
            del file[f"patterns/{name}"]
            file[f"patterns/{name}"] = values
            file[f"patterns/{name}"].attrs["units"] = "1"
    with pytest.raises(InputError, match=r"5000 rows; 1\.\.4096 are allowed"):
        read_capture(tmp_path / "capture.h5")


def test_frames_are_decoded_by_their_own_plan(recording):
    """Each as a recording of it alone would be."""
    reconstructor = Reconstructor(recording.setup)
    for frame in (4, 0, 5):
        alone = replace(
            recording,
            plan=recording.setup.plan_of(frame),
            following_plans=(),
            buckets=recording.frame(frame).buckets,
        )
        expected = reconstruct(alone)
        result = reconstructor(recording.frame(frame))
        np.testing.assert_array_equal(result.image, expected.image)
        assert result.recording == expected.recording


def test_frames_of_different_sizes_and_bases_are_refused(recording):
    fewer = recording.plan.only(np.arange(21) > 0)
    for plan, reported in [
        (fewer, "frame 1 have exposures 20, those of the first 21"),
        (make_plan((8, 32), 20, polarity="single-ended"), r"frame 1 have shape \(8, 32\)"),
    ]:
        with pytest.raises(InputError, match=reported):
            replace(recording, following_plans=(plan,))


def test_a_detector_that_counts_has_no_differences_in_any_frame():
    capture = full_capture()
    signed = replace(capture.plan, polarity=np.zeros_like(capture.plan.polarity))
    with pytest.raises(InputError, match="polarity 0\\) cannot be corrected"):
        replace(capture, following_plans=(signed,))


def test_fewer_patterns_are_the_first_of_each_frame(recording):
    fewer = first_patterns(recording, 12)
    ordered = ORDERS["sequency-2d"](Hadamard(SHAPE))
    for plan, whole in zip(fewer.setup.plans, recording.setup.plans, strict=True):
        displayed = ordered[np.isin(ordered, whole.index)][:12]
        assert set(plan.distinct.tolist()) == set(displayed.tolist())
    assert fewer.buckets.counts.shape == (7, 13)
    frame = fewer.frame(4).buckets.counts[0]
    plan = recording.setup.plan_of(4)
    retained = np.isin(plan.index, fewer.setup.plan_of(4).index)
    np.testing.assert_array_equal(frame, recording.buckets.counts[4][retained])

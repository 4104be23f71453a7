"""Capture files: frames on demand, older versions, and numbers that no type here holds."""

from dataclasses import fields, replace

import h5py
import numpy as np
import pytest

from captures import full_capture, make_spots
from hdf5files import changed
from reconstruction import (
    InputError,
    Reconstructor,
    evaluate,
    open_capture,
    read_capture,
    reconstruct,
    write_capture,
)
from reconstruction.capture import READINGS, FrameTruth
from reconstruction.capture.schema import present_fields

TRUTH = tuple(field.name for field in fields(FrameTruth))
POSE = ("corridor_m", "position_m", "orientation")


@pytest.fixture
def capture():
    return full_capture()


@pytest.fixture
def path(capture, tmp_path):
    write_capture(capture, tmp_path / "capture.h5")
    return tmp_path / "capture.h5"


def change(path, name, values):
    """Put other values in the place of a dataset; without any, remove it."""
    with changed(path) as file:
        units = file[name].attrs["units"]
        del file[name]
        if values is not None:
            file[name] = values
            file[name].attrs["units"] = units


def first_frame(capture):
    """The same with one frame alone."""
    parts = capture.frame(0)
    truth = replace(
        capture.truth,
        frame=np.zeros(1, dtype=np.int64),
        **{name: getattr(capture.truth, name)[:1] for name in TRUTH},
    )
    return replace(
        capture,
        buckets=parts.buckets,
        spots=parts.spots,
        pattern_taps=parts.pattern_taps,
        poses=parts.poses,
        truth=truth,
    )


def as_version_2(path):
    """What was written before the truth had frames."""
    with h5py.File(path) as file:
        values = {name: file[f"truth/{name}"][0] for name in TRUTH}
    for name, value in values.items():
        change(path, f"truth/{name}", value)
    for name in ("frame", "still", *POSE):
        change(path, f"truth/{name}", None)
    with changed(path) as file:
        file.attrs["version"] = "2.0"


def assert_equal_parts(result, expected):
    """Of frames: the same parts with the same values in the same types."""
    assert len(result) == len(expected)
    assert result.first == expected.first
    for group in ("buckets", "spots", "pattern_taps"):
        one, other = getattr(result, group), getattr(expected, group)
        assert type(one) is type(other)
        for name, _ in present_fields(one):
            values = [np.asarray(getattr(part, name)) for part in (one, other)]
            np.testing.assert_array_equal(*values, strict=True, err_msg=name)


# Frames on demand


@pytest.mark.parametrize("method", READINGS)
def test_a_frame_from_the_file_is_that_of_the_whole_capture(capture, path, method):
    write_capture(replace(capture, spots=make_spots(method)), path)
    whole = read_capture(path)
    with open_capture(path) as file:
        assert file.frames == whole.frames == 2
        assert file.provenance == whole.provenance
        for number in (1, 0):
            frame = file.frame(number)
            assert_equal_parts(frame, whole.frame(number))
            assert frame.digest(file.setup) == whole.frame(number).digest(whole.setup)
        assert_equal_parts(file.batch(0, 2), whole.batch(0, 2))
        for name in TRUTH:
            true = getattr(whole.truth, name)
            np.testing.assert_array_equal(getattr(file.capture(0, 2).truth, name), true)
            of_one = getattr(file.capture(1, 2).truth.at(0), name)
            np.testing.assert_array_equal(of_one, true[1])


def test_a_frame_reads_no_more_than_it_holds(path, monkeypatch):
    read = []
    original = h5py.Dataset.__getitem__

    def counted(dataset, key, *others):
        values = original(dataset, key, *others)
        read.append((dataset.name, np.size(values)))
        return values

    monkeypatch.setattr("h5py.Dataset.__getitem__", counted)
    by_frame = {
        "/buckets/counts": 20,
        "/buckets/saturated": 20,
        "/spots/taps": 12,
        "/spots/saturated": 12,
        "/pattern_taps/taps": 120,
        "/pattern_taps/saturated": 120,
        "/poses/time_s": 1,
        "/poses/position_m": 3,
        "/poses/orientation": 4,
        "/poses/covariance": 36,
    }
    with open_capture(path) as file:
        assert {name: size for name, size in read if name in by_frame} == dict.fromkeys(by_frame, 0)
        assert not any(name.startswith("/truth") for name, _ in read)
        read.clear()
        file.frame(1)
    assert dict(read) == by_frame


@pytest.mark.parametrize("name", ["buckets/counts", "spots/taps", "pattern_taps/taps"])
def test_what_is_wrong_with_another_frame_does_no_harm(capture, path, name):
    group, field = name.split("/")
    values = getattr(getattr(capture, group), field).astype(float)
    values[0].flat[3] = np.nan
    change(path, name, values)
    with open_capture(path) as file:
        result = getattr(getattr(file.frame(1), group), field)
        np.testing.assert_array_equal(result, values[1:])
        with pytest.raises(InputError, match=f"{name} holds values that are not finite"):
            file.frame(0)
    with pytest.raises(InputError, match=f"{name} holds values that are not finite"):
        read_capture(path)


@pytest.mark.parametrize(("start", "stop"), [(2, 3), (-1, 0), (0, 3), (1, 1)])
def test_frames_that_there_are_not_are_refused(capture, path, start, stop):
    with open_capture(path) as file:
        for recording in (file, capture):
            with pytest.raises(InputError, match=r"the capture has frames 0\.\.1"):
                recording.batch(start, stop)


def test_recordings_in_files_and_in_memory_are_reconstructed_alike(capture, path):
    with open_capture(path) as file:
        from_file = reconstruct(file, 1)
        usual = dict.fromkeys(("image", "ranging", "depth"), "usual")
        reconstructor = Reconstructor(file.setup, **usual)
        by_hand = reconstructor(file.frame(1))
    expected = reconstruct(capture, 1)
    for result in (from_file, by_hand):
        assert (result.recording, result.frame) == (expected.recording, 1)
        assert list(result.depths) == list(expected.depths)
        for name, image in expected.images.items():
            np.testing.assert_array_equal(result.images[name], image)
        for name, depth_m in expected.depths.items():
            np.testing.assert_array_equal(result.depths[name], depth_m)


def test_a_wrong_truth_is_told_when_it_is_asked_for(path):
    change(path, "truth/depth_m", np.zeros((1, 4, 8)))
    with open_capture(path) as file:
        file.frame(0)
        with pytest.raises(InputError, match=r"truth/depth_m has shape \(1, 4, 8\), .*truths = 2"):
            file.capture(0, 2)


# Truth of frames


def test_the_truth_of_a_frame_is_its_own(capture, path):
    truth = read_capture(path).truth
    for frame in (0, 1):
        assert truth.knows(frame)
        for field in fields(FrameTruth):
            result = getattr(truth.at(frame), field.name)
            np.testing.assert_array_equal(result, getattr(capture.truth, field.name)[frame])
    assert not truth.knows(2)
    with pytest.raises(
        InputError, match=r"frame 2 has no truth; the capture holds that of frames 0, 1$"
    ):
        truth.at(2)


def test_truths_may_be_of_some_frames_or_one_of_all(capture):
    second = replace(capture.truth, frame=np.array([1, 5]))
    assert [second.knows(frame) for frame in (0, 1, 2, 5)] == [False, True, False, True]
    np.testing.assert_array_equal(second.at(5).image, capture.truth.image[1])
    still = first_frame(capture).truth
    assert not still.knows(7)
    still = replace(still, still=True)
    assert still.knows(7)
    np.testing.assert_array_equal(still.at(7).image, capture.truth.image[0])
    empty = replace(still, **{name: getattr(still, name)[:0] for name in ("frame", *TRUTH)})
    assert not empty.knows(0)
    with pytest.raises(InputError, match="frame 0"):
        empty.at(0)


# Version 2


def test_files_of_version_2_hold_the_truth_of_their_first_frame(capture, path):
    as_version_2(path)
    copy = read_capture(path)
    assert_equal_parts(copy.batch(0, 2), capture.batch(0, 2))
    assert not copy.truth.still
    assert copy.truth.frame.tolist() == [0]
    for field in fields(FrameTruth):
        result, expected = (getattr(c.truth.at(0), field.name) for c in (copy, capture))
        np.testing.assert_array_equal(result, expected, strict=True)
    evaluate(reconstruct(copy, 0), copy)
    with pytest.raises(
        InputError, match=r"frame 1 has no truth; the capture holds that of frames 0$"
    ):
        evaluate(reconstruct(copy, 1), copy)


def test_of_one_frame_that_is_all_there_is(capture, path):
    write_capture(first_frame(capture), path)
    as_version_2(path)
    copy = read_capture(path)
    assert copy.frames == 1
    assert copy.truth.still


def test_files_of_version_2_without_truth_have_none(capture, path):
    write_capture(replace(capture, truth=None), path)
    with changed(path) as file:
        file.attrs["version"] = "2.0"
    assert read_capture(path).truth is None


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        ("depth_m", np.zeros((8, 4)), r"truth/depth_m has shape \(1, 8, 4\), expected"),
        ("image", np.full((4, 8), b"x"), "truth/image must hold numbers"),
        ("spot_range_m", None, "dataset truth/spot_range_m is missing"),
    ],
)
def test_a_wrong_truth_of_version_2_is_named(path, name, values, message):
    as_version_2(path)
    change(path, f"truth/{name}", values)
    with pytest.raises(InputError, match=message):
        read_capture(path)


# Numbers


@pytest.mark.parametrize("name", ["buckets/counts", "spots/taps", "pattern_taps/taps"])
@pytest.mark.parametrize(
    ("dtype", "value"),
    [(np.uint32, 3_000_000_000), (np.int64, -(2**31) - 1), (np.uint64, 2**64 - 1)],
)
def test_integers_that_need_more_bits_are_refused_and_not_wrapped(
    capture, path, name, dtype, value
):
    group, field = name.split("/")
    values = np.ones(getattr(getattr(capture, group), field).shape, dtype=dtype)
    change(path, name, values)
    read = getattr(getattr(read_capture(path), group), field)
    assert read.dtype == np.int32
    assert (read == 1).all()
    values.flat[5] = value
    change(path, name, values)
    with pytest.raises(InputError, match=f"{name} holds integers beyond 32 bits"):
        read_capture(path)


def test_the_largest_integers_that_fit_are_kept(capture, path):
    counts = np.full((2, 20), 2**31 - 1, dtype=np.uint32)
    change(path, "buckets/counts", counts)
    assert (read_capture(path).buckets.counts == 2**31 - 1).all()


# Faults of our own


@pytest.mark.parametrize("error", [TypeError, KeyError, ValueError, AttributeError])
@pytest.mark.parametrize("what", ["PatternPlan", "Setup", "Truth", "Capture"])
def test_a_fault_of_our_own_is_not_reported_as_damage(path, monkeypatch, error, what):
    def faulty(*_, **__):
        raise error("a fault of our own")

    if what == "Truth":  # a data class, whose fields are asked for
        monkeypatch.setattr("reconstruction.capture.file.Truth.__init__", faulty)
    else:
        monkeypatch.setattr(f"reconstruction.capture.file.{what}", faulty)
    with pytest.raises(error, match="a fault of our own"):
        read_capture(path)

"""Poses in a stream: those of each frame arrive as sent, frames may have none."""

from dataclasses import replace

import numpy as np
import pytest

from reconstruction import InputError, read_capture, write_capture
from reconstruction.capture import Poses
from spisim_live import Kind, Parser, Reception, Sender, unpacked
from spisim_live.sinks.records import CaptureRecord
from streams import Clock, Script, film, messages

FIELDS = ("time_s", "position_m", "orientation", "covariance")
FRAMES = 6


def poses(frames):
    """Poses with numbers that no rounding leaves as they are."""
    rng = np.random.default_rng(7)
    quaternions = rng.normal(size=(frames, 4))
    roots = rng.normal(0, 0.1, (frames, 6, 6))
    return Poses(
        time_s=1.8e9 + np.cumsum(rng.uniform(0.01, 0.02, frames)),
        position_m=rng.normal(0, 30, (frames, 3)),
        orientation=quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True),
        covariance=roots @ roots.transpose(0, 2, 1),
    )


def without(stated, *frames):
    """Poses but for those of some frames."""
    none = Poses.none(len(stated.time_s))
    kept = ~np.isin(np.arange(len(stated.time_s)), frames)

    def cut(name):
        values = getattr(stated, name)
        mask = kept.reshape(-1, *[1] * (values.ndim - 1))
        return np.where(mask, values, getattr(none, name))

    return Poses(*map(cut, FIELDS))


@pytest.fixture
def flight(capture):
    return replace(film(capture, FRAMES), poses=poses(FRAMES))


def received(content, recorders=()):
    """The arrivals of a stream, and its counts."""
    clock, arrivals = Clock(), []
    source = Script(*content, clock=clock)
    reception = Reception(source, clock=clock, recorders=[arrivals.append, *recorders])
    reception.run()
    return arrivals, reception.counts


def same(some, others):
    return all(
        np.array_equal(getattr(some, name), getattr(others, name), equal_nan=True)
        for name in FIELDS
    )


def test_poses_arrive_unchanged(flight, tmp_path):
    record = CaptureRecord(tmp_path / "copy.h5")
    arrivals, counts = received(messages(flight), [record.frame])
    record.close()
    assert counts.received == FRAMES
    for number, arrival in enumerate(arrivals):
        assert same(arrival.frame.poses, flight.frame(number).poses)
    assert same(read_capture(tmp_path / "copy.h5").poses, flight.poses)


def test_a_stream_without_poses_says_nothing_of_them(flight, capture):
    plain = film(capture, FRAMES)
    parsed = Parser().feed(b"".join(messages(plain)))
    setup, *frames = [each for each in parsed if each.kind in (Kind.SETUP, Kind.FRAME)]
    assert not [name for name in unpacked(setup.payload) if name.startswith("poses")]
    for number, each in enumerate(frames):
        frame = plain.frame(number)
        parts = (frame.buckets.counts, frame.buckets.saturated)
        parts += (frame.spots.taps, frame.spots.saturated)
        assert each.payload == b"".join(
            part.astype(part.dtype.newbyteorder("<")).tobytes() for part in parts
        )
    located = Parser().feed(b"".join(messages(flight)))
    pose_bytes = 8 * (1 + 3 + 4 + 36)
    assert len(located[1].payload) == len(frames[0].payload) + pose_bytes
    assert located[1].payload.startswith(frames[0].payload)


def test_frames_without_a_pose_are_frames(flight, tmp_path):
    """Whether the sender states nan, or has none to give."""
    sparse = replace(flight, poses=without(flight.poses, 0, 3))
    record = CaptureRecord(tmp_path / "copy.h5")
    arrivals, counts = received(messages(sparse), [record.frame])
    record.close()
    assert (counts.received, counts.refused) == (FRAMES, 0)
    assert [bool(each.frame.poses.known[0]) for each in arrivals] == [
        False,
        True,
        True,
        False,
        True,
        True,
    ]
    copy = read_capture(tmp_path / "copy.h5")
    assert same(copy.poses, sparse.poses)
    sender = Sender(flight.setup)
    frame = replace(flight.frame(0), poses=None)
    (arrival,), counts = received([sender.setup(), sender.frame(frame)])
    assert not arrival.frame.poses.known[0]
    assert counts.refused == 0


@pytest.mark.parametrize(
    ("name", "index", "reason"),
    [
        ("position_m", (0, 1), "poses of frame 0 are nan in part"),
        ("orientation", (0, 0), "poses of frame 0 are nan in part"),
        ("time_s", 0, "poses of frame 0 are nan in part"),
    ],
)
def test_half_a_pose_costs_its_frame_alone(flight, name, index, reason):
    sender, content = Sender(flight.setup), []
    for number in range(FRAMES):
        frame = flight.frame(number)
        if number == 2:
            values = getattr(frame.poses, name).copy()
            values[index] = np.nan
            frame = replace(frame, poses=replace(frame.poses, **{name: values}))
        content.append(sender.frame(frame))
    arrivals, counts = received([sender.setup(), *content])
    assert [each.message.number for each in arrivals] == [0, 1, 3, 4, 5]
    assert counts.refused == 1
    with pytest.raises(InputError, match=reason):
        replace(flight.frame(2).poses, **{name: values}).check()


def test_a_capture_may_lack_poses_of_some_frames(flight, tmp_path):
    sparse = replace(flight, poses=without(flight.poses, 1))
    write_capture(sparse, tmp_path / "flight.h5")
    assert read_capture(tmp_path / "flight.h5").poses.known.tolist() == [True, False, *[True] * 4]
    late = replace(sparse.poses, time_s=sparse.poses.time_s[[2, 1, 0, 3, 4, 5]])
    with pytest.raises(InputError, match=r"time_s of frame 2 is .* last frame with one before"):
        replace(flight, poses=late)


def test_a_record_goes_on_in_another_file_where_the_time_goes_back(flight, tmp_path):
    """As after a restart of the rig."""
    record = CaptureRecord(tmp_path / "flight.h5")
    received([*messages(flight, run=1)[:-1], *messages(flight, run=2)], [record.frame])
    record.close()
    for name in ("flight.h5", "flight-2.h5"):
        assert same(read_capture(tmp_path / name).poses, flight.poses)

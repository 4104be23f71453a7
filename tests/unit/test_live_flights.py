"""Poses in a stream: those of each frame arrive as sent, frames may have none."""

from dataclasses import replace

import numpy as np
import pytest

from reconstruction import InputError, read_capture, write_capture
from reconstruction.capture import Poses
from spisim_live import Kind, Parser, Reception, Sender, unpacked
from spisim_live.senders import AT_ONCE
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


def recorded(flight, times_s, folder):
    """The captures of frames with poses of these times that arrive at once."""
    (arrival, *_), _ = received(messages(flight))
    record = CaptureRecord(folder / "flight.h5")
    for number, time_s in enumerate(times_s):
        stated = replace(arrival.frame.poses, time_s=np.array([time_s]))
        stated = Poses.none(1) if np.isnan(time_s) else stated
        message = arrival.message._replace(number=number)
        frame = replace(arrival.frame, first=number, poses=stated)
        record.frame(arrival._replace(frame=frame, message=message))
    record.close()
    return [read_capture(path) for path in sorted(folder.iterdir(), key=lambda each: each.stem)]


def test_repeats_of_a_flight_are_a_part_each(flight, tmp_path):
    parts = recorded(flight, [*range(20)] * AT_ONCE, tmp_path)
    assert [len(part.poses.time_s) for part in parts] == [20] * AT_ONCE
    assert all(part.poses.known.all() for part in parts)


@pytest.mark.parametrize(
    ("times_s", "parts", "located"),
    [([1.0] * 30, 1, 1), ([1, 1, 2, 2, 3, 3], 1, 3), (range(60, 0, -1), 1 + AT_ONCE, 1 + AT_ONCE)],
)
def test_times_that_stand_or_go_back_do_not_fill_the_disk(
    flight, tmp_path, times_s, parts, located
):
    captures = recorded(flight, times_s, tmp_path)
    assert len(captures) == parts
    assert sum(each.frames for each in captures) == len(times_s)
    assert sum(each.poses.known.sum() for each in captures) == located


def test_a_frame_without_a_pose_leaves_the_time_of_poses_as_it_is(flight, tmp_path):
    captures = recorded(flight, [5, np.nan, 6, 5.5], tmp_path)
    assert [each.frames for each in captures] == [3, 1]

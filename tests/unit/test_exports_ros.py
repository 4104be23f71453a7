"""Recordings of ROS 2, read back by libraries that did not write what they read.

The container is written by mcap and read by rosbags; messages are encoded by rosbags and decoded by
mcap-ros2-support.
"""

import runpy
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from exported import with_scene
from reconstruction import Reconstructor, write_capture
from reconstruction.cli import main
from reconstruction.depth import pixel_rays
from reconstruction.exports import Shot, shots_of
from reconstruction.exports.poses import OPTICAL_IN_BODY
from spisim.dataset.poses import placed
from spisim_live import Counts, Loop, Reception, Sender, State
from spisim_live.ros.messages import STALE, WARN, along, ranging_status, state_message
from spisim_live.sinks import sink_to
from spisim_live.sinks.mcap import McapRecord
from streams import Clock, Script, film, messages

pytest.importorskip("mcap")
pytest.importorskip("rosbags")

FRAMES = 4
FRAME_S = 0.1
MAPS = (
    *("/camera/image", "/camera/camera_info", "/camera/points"),
    *("/camera/depth/image_rect", "/camera/depth/camera_info"),
)


@pytest.fixture(scope="module")
def recording(capture):
    """Frames of 0.1 s, each of which is written with its maps."""
    made = with_scene(film(capture, FRAMES))
    made.spots.saturated[2, 1] = True
    return lasting(made, FRAME_S)


def lasting(recording, frame_s):
    """The same with frames of so many seconds."""
    period_s = frame_s / recording.plan.exposures
    return replace(recording, buckets=replace(recording.buckets, pattern_period_s=period_s))


@pytest.fixture(scope="module")
def results(recording):
    reconstruct = Reconstructor(recording.setup)
    return [reconstruct(recording.frame(number)) for number in range(FRAMES)]


@pytest.fixture(scope="module")
def bag(recording, tmp_path_factory):
    """Written with the poses of the simulated scene, as `spisim export` does."""
    from reconstruction.exports import EXPORTS, write_export

    folder = tmp_path_factory.mktemp("bags")
    write_capture(recording, folder / "flight.h5")
    shots = shots_of([folder / "flight.h5"], placed)
    write_export(EXPORTS["mcap"], shots, folder / "flight.mcap")
    return folder / "flight.mcap"


def decoded(path):
    """(topic, message, log time in ns) of all messages, by mcap-ros2-support."""
    reader = pytest.importorskip("mcap_ros2.reader")
    return [
        (each.channel.topic, each.ros_msg, each.log_time_ns)
        for each in reader.read_ros2_messages(str(path))
    ]


def stamp_ns(header):
    return header.stamp.sec * 10**9 + header.stamp.nanosec


def pose_of(transform):
    t, q = transform.translation, transform.rotation
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix()
    pose[:3, 3] = t.x, t.y, t.z
    return pose


def test_the_container_is_one_of_rosbag2(bag):
    from rosbags.highlevel import AnyReader

    with AnyReader([bag]) as reader:
        topics = {each.topic: each for each in reader.connections}
        stamps = [stamp for _, stamp, _ in reader.messages()]
        cloud = topics["/camera/points"]
        assert cloud.msgtype == "sensor_msgs/msg/PointCloud2"
        assert cloud.msgcount == FRAMES
        quality = topics["/tf_static"].ext.offered_qos_profiles[0]
    assert stamps == sorted(stamps)
    assert quality.durability.name == "TRANSIENT_LOCAL"
    assert set(topics) == {
        *("/tf", "/tf_static", "/diagnostics", "/camera/points"),
        *("/camera/image", "/camera/camera_info"),
        *("/camera/depth/image_rect", "/camera/depth/camera_info"),
        *(f"/camera/spot_{k}/range" for k in range(4)),
    }


def test_the_container_is_compressed(bag):
    from mcap.reader import make_reader

    with bag.open("rb") as file:
        chunks = make_reader(file).get_summary().chunk_indexes
    assert {chunk.compression for chunk in chunks} == {"zstd"}
    assert sum(chunk.compressed_size for chunk in chunks) < sum(
        chunk.uncompressed_size for chunk in chunks
    )


@pytest.mark.parametrize(("frame_s", "with_maps"), [(0.11, 4), (0.1, 4), (0.05, 2), (0.03, 1)])
def test_maps_come_ten_times_a_second_at_most_and_ranges_with_each_frame(
    recording, tmp_path, frame_s, with_maps
):
    from rosbags.highlevel import AnyReader

    write_capture(lasting(recording, frame_s), tmp_path / "a.h5")
    assert main(["export", str(tmp_path / "a.h5"), "-o", str(tmp_path / "a.mcap")]) == 0
    with AnyReader([tmp_path / "a.mcap"]) as reader:
        count = {each.topic: each.msgcount for each in reader.connections}
    assert {count.pop(topic) for topic in MAPS} == {with_maps}
    assert count.pop("/tf_static") == 1
    assert set(count.values()) == {FRAMES}


def test_clouds_are_equal_to_float_precision(bag, recording, results):
    clouds = [message for topic, message, _ in decoded(bag) if topic == "/camera/points"]
    rays = pixel_rays(recording.optics, recording.plan.shape)
    for cloud, result in zip(clouds, results, strict=True):
        assert (cloud.height, cloud.width, cloud.is_bigendian) == (16, 16, False)
        types = [(field.name, "<f4") for field in cloud.fields]
        assert [field.offset for field in cloud.fields] == [0, 4, 8, 12]
        points = np.frombuffer(bytes(cloud.data), types).reshape(16, 16)
        expected = (rays * result.depth_m[..., None]).astype("f4")
        outcome = np.stack([points[axis] for axis in "xyz"], axis=-1)
        assert np.array_equal(outcome, expected, equal_nan=True)
        assert np.array_equal(points["intensity"], result.image)
        assert cloud.header.frame_id == "camera_optical_frame"


def test_depth_images_have_their_camera(bag, recording, results):
    reported = decoded(bag)
    images = [message for topic, message, _ in reported if topic == "/camera/depth/image_rect"]
    infos = [message for topic, message, _ in reported if topic == "/camera/depth/camera_info"]
    rays = pixel_rays(recording.optics, recording.plan.shape)
    for image, info, result in zip(images, infos, results, strict=True):
        assert (image.encoding, image.step) == ("32FC1", 64)
        depth = np.frombuffer(bytes(image.data), "<f4").reshape(16, 16)
        assert np.array_equal(depth, result.depth_m, equal_nan=True)
        assert stamp_ns(image.header) == stamp_ns(info.header)
        matrix = np.reshape(info.k, (3, 3))
        u, v = np.meshgrid(np.arange(info.width), np.arange(info.height))
        assert (u - matrix[0, 2]) / matrix[0, 0] == pytest.approx(rays[..., 0])
        assert (v - matrix[1, 2]) / matrix[1, 1] == pytest.approx(rays[..., 1])
        assert np.reshape(info.p, (3, 4))[:, :3].tolist() == matrix.tolist()


def test_ranges_have_their_variance_and_none_is_nan(bag, results):
    reported = decoded(bag)
    for spot in range(4):
        ranges = [
            message for topic, message, _ in reported if topic == f"/camera/spot_{spot}/range"
        ]
        for frame, (outcome, result) in enumerate(zip(ranges, results, strict=True)):
            if (frame, spot) == (2, 1):
                assert np.isnan(outcome.range)
                assert outcome.variance == 0
                continue
            assert outcome.range == np.float32(result.ranges.range_m[spot])
            assert outcome.variance == pytest.approx(result.ranges.sigma_m[spot] ** 2, rel=1e-6)
            assert outcome.header.frame_id == f"spot_{spot}"


def test_stamps_increase_and_frames_are_one_tree(bag, recording):
    last: dict[str, int] = {}
    parents: dict[str, str] = {}
    poses: dict[str, np.ndarray] = {}
    number = -1
    for topic, message, log_ns in decoded(bag):
        if topic in ("/tf", "/tf_static"):
            number += topic == "/tf"
            for each in message.transforms:
                child = each.child_frame_id
                assert parents.setdefault(child, each.header.frame_id) == each.header.frame_id
                poses[child] = pose_of(each.transform)
            stamp = stamp_ns(message.transforms[0].header)
        else:
            stamp = stamp_ns(message.header)
        assert stamp > last.get(topic, 0)
        assert stamp == log_ns
        last[topic] = stamp
        if topic == "/camera/points":
            world = np.eye(4)
            frame = message.header.frame_id
            while frame != "map":
                world, frame = poses[frame] @ world, parents[frame]
            expected = placed(recording, number).pose
            assert world == pytest.approx(expected, abs=1e-9)
    assert set(parents.values()) - set(parents) == {"map"}
    assert poses["camera_optical_frame"] == pytest.approx(OPTICAL_IN_BODY, abs=1e-12)
    for k, direction in enumerate(recording.spots.directions):
        assert poses[f"spot_{k}"][:3, 0] == pytest.approx(direction, abs=1e-9)


def test_diagnostics_say_what_is_wrong(bag):
    reported = [message.status[0] for topic, message, _ in decoded(bag) if topic == "/diagnostics"]
    assert [int(each.level) for each in reported] == [0, 0, WARN, 0]
    values = {each.key: each.value for each in reported[2].values}
    assert values["spot 1"] == "saturated"
    assert reported[2].message == "3 of 4 spots have a range"


def test_what_fog_ranging_finds_is_told(recording, results):
    from reconstruction.ranging.ranges import FogOptics

    ranges = replace(results[0].ranges, fog=FogOptics(0.06, 0.001, 0.1))
    shot = replace(Shot.of(results[0], recording.setup, 0), ranges=ranges)
    assert {"key": "fog: extinction, 1/m", "value": "0.06"} in ranging_status(shot)["values"]


def test_a_stream_that_loses_frames_warns(recording):
    def state(**counts):
        return State(Counts(**counts), 0.1, 0.01, 0.02, 100.0, "").numbers

    first = state_message(0, state(lost=2), None).fields["status"][0]
    assert (first["level"], first["message"]) == (WARN, "more frames are lost")
    assert {"key": "lost", "value": "2"} in first["values"]
    following = state_message(0, state(lost=2), state(lost=2)).fields["status"][0]
    assert (following["level"], following["message"]) == (0, "frames come")
    none = State(Counts(), np.nan, np.nan, np.nan, 0.0, "waiting for tcp://rig:1").numbers
    assert state_message(0, none, None).fields["status"][0]["level"] == STALE


def test_a_stream_can_be_recorded_so(recording, results, tmp_path):
    sink = sink_to(str(tmp_path / "live.mcap"))
    clock = Clock()
    content = messages(recording)
    del content[2]  # frame 1
    reception = Reception(Script(*content, clock=clock), clock=clock, waiting=100)
    loop = Loop(reception, results=[sink.result], states=[sink.state], clock=clock)
    reception.run()
    loop.run()
    sink.close()
    reported = decoded(tmp_path / "live.mcap")
    ranges = [message for topic, message, _ in reported if topic == "/camera/spot_0/range"]
    assert [stamp_ns(each.header) for each in ranges][1:] == [2000, 3000]  # the sender's clock
    assert [each.range for each in ranges] == [
        np.float32(results[number].ranges.range_m[0]) for number in (0, 2, 3)
    ]
    clouds = [message for topic, message, _ in reported if topic == "/camera/points"]
    # Of frame 0, stamped when it was received, and of the first of the sender's stamps
    for cloud, result in zip(clouds, (results[0], results[2]), strict=True):
        points = np.frombuffer(bytes(cloud.data), "<f4").reshape(16, 16, 4)
        assert np.array_equal(points[..., 3], result.image)
    (stream,) = [m.status[0] for t, m, _ in reported if t == "/diagnostics"
                 and m.status[0].name == "spisim: stream"]  # fmt: skip
    assert {each.key: each.value for each in stream.values}["lost"] == "1"
    with sink_to(str(tmp_path / "live.mcap")).ready():
        pass  # its own file it replaces
    assert "/tf" not in {topic for topic, _, _ in reported}  # nobody knows where a rig is


def test_stamps_that_ros_has_no_numbers_for_are_those_of_receipt(recording, tmp_path):
    """As of a clock that counts from 1900: it was a file of nothing."""
    sender, ntp_ns = Sender(recording.setup, run=1), 3_973_000_000 * 10**9
    stamps = [ntp_ns, 5, 2**64 - 1]
    content = [sender.setup()]
    content += [sender.frame(recording.frame(n), stamp) for n, stamp in enumerate(stamps)]
    sink = McapRecord(tmp_path / "live.mcap", clock_ns=lambda: 7)
    reception = Reception(Script(*content), waiting=100)
    loop = Loop(reception, results=[sink.result])
    reception.run()
    loop.run()
    sink.close()
    reported = decoded(tmp_path / "live.mcap")
    ranges = [message for topic, message, _ in reported if topic == "/camera/spot_0/range"]
    assert [stamp_ns(each.header) for each in ranges] == [7, 5, 7]


def test_files_of_others_are_not_replaced(recording, tmp_path, capsys):
    write_capture(recording, tmp_path / "a.h5")
    (tmp_path / "a.mcap").write_text("mine")
    words = ["export", str(tmp_path / "a.h5"), "-o", str(tmp_path / "a.mcap")]
    assert main(words) == 2
    assert "a.mcap exists and is not an earlier export; --overwrite" in capsys.readouterr().err
    assert main([*words, "--overwrite"]) == 0
    assert main(words) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.h5", "a.mcap"]


@pytest.mark.parametrize("module", ["mcap.writer", "zstandard", "rosbags.typesys"])
def test_without_a_library_it_says_how_to_get_them(
    recording, tmp_path, monkeypatch, capsys, module
):
    write_capture(recording, tmp_path / "a.h5")
    monkeypatch.setitem(sys.modules, module, None)
    assert main(["export", str(tmp_path / "a.h5"), "-o", str(tmp_path / "a.mcap")]) == 2
    output = capsys.readouterr().err
    assert f"need mcap, zstandard and rosbags ({module} is missing): pip install" in output
    assert [path.name for path in tmp_path.iterdir()] == ["a.h5"]


def test_a_capture_without_spots_or_depth_is_recorded_as_it_is(recording, tmp_path):
    bare = replace(recording, spots=None, optics=None)
    write_capture(bare, tmp_path / "a.h5")
    assert main(["export", str(tmp_path / "a.h5"), "-o", str(tmp_path / "a.mcap")]) == 0
    topics = {topic for topic, _, _ in decoded(tmp_path / "a.mcap")}
    assert topics == {"/tf_static", "/camera/image", "/diagnostics"}


def test_the_example_node_publishes_the_same(recording, results, monkeypatch):
    """With stand-ins for rclpy, which this machine need not have."""
    published: dict[str, list] = {}

    class Node:
        def __init__(self, name):
            self.name = name

        def declare_parameter(self, name, value):
            return SimpleNamespace(value=value)

        def get_clock(self):
            return SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=5))

        def create_publisher(self, kind, topic, quality):
            assert published.setdefault(topic, []) == []
            return SimpleNamespace(publish=published[topic].append)

    stand_ins = {
        "rclpy": {},
        "rclpy.node": {"Node": Node},
        "rclpy.qos": {"DurabilityPolicy": MagicMock(), "QoSProfile": MagicMock()},
        "rosidl_runtime_py": {},
        "rosidl_runtime_py.set_message": {"set_message_fields": dict.update},
        "rosidl_runtime_py.utilities": {"get_message": lambda name: dict},
    }
    for name, content in stand_ins.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    path = Path(__file__).parents[2] / "examples" / "ros2" / "spisim_node.py"
    node = runpy.run_path(str(path))["Camera"]()
    reception = Reception(Script(*messages(recording)), waiting=100)
    loop = Loop(reception, results=[node.result], states=[node.state])
    reception.run()
    loop.run()
    assert len(published["/camera/points"]) == FRAMES
    assert len(published["/tf_static"]) == 1
    assert published["/camera/spot_0/range"][3]["range"] == results[3].ranges.range_m[0]
    assert published["/diagnostics"][0]["status"][0]["level"] == b"\x00"
    assert published["/diagnostics"][-1]["status"][0]["name"] == "spisim: stream"


@pytest.mark.parametrize("direction", [(0.1, -0.2, 1.0), (0.0, 0.3, 4.0)])
def test_a_spots_frame_is_orthonormal_and_looks_along_it(direction):
    pose = along(np.array(direction))
    np.testing.assert_allclose(pose[:3, :3].T @ pose[:3, :3], np.eye(3), atol=1e-12)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1)
    np.testing.assert_allclose(pose[:3, 0], np.array(direction) / np.linalg.norm(direction))
    assert pose[1, 2] < 0  # its z axis points up, y of an optical frame down

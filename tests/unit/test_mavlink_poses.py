"""Poses from an autopilot: axes, clocks, interpolation, and whatever is wrong with messages."""

import math
import socket
import sys
import threading
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from reconstruction import read_capture, write_capture
from reconstruction.base.errors import InputError
from reconstruction.cli import main
from spisim_live import Parser, Reception, pack
from spisim_live.mavlink import PoseSigmas, PoseSource
from spisim_live.mavlink.clock import RECENT, WINDOW_S, WITNESSES, Clock
from spisim_live.mavlink.connections import mavlink_outlet, mavlink_source
from spisim_live.mavlink.readings import reading_of
from spisim_live.mavlink.track import MAX_GAP_S, Track, rotation_vector, slerp
from streams import Clock as StreamClock
from streams import Script, film, messages

NED_TO_ENU = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]])


def message(kind, **fields):
    """A message as pymavlink gives it."""
    return SimpleNamespace(
        get_type=lambda: kind, get_srcSystem=lambda: 1, get_srcComponent=lambda: 1, **fields
    )


def attitude(roll=0.0, pitch=0.0, yaw=0.0, ms=0):
    return message("ATTITUDE", time_boot_ms=ms, roll=roll, pitch=pitch, yaw=yaw)


def odometry(**fields):
    usual = {
        "time_usec": 1_000_000, "frame_id": 1, "x": 1.0, "y": 2.0, "z": -3.0, "quality": 0,
        "q": (1.0, 0.0, 0.0, 0.0), "pose_covariance": [math.nan] * 21,
    }  # fmt: skip
    return message("ODOMETRY", **usual | fields)


def axes(quaternion):
    """The optical axes right, down and forward in the world."""
    return Rotation.from_quat(quaternion).as_matrix().T


@pytest.mark.parametrize(
    ("angles_deg", "right", "down", "forward"),
    [
        ((0, 0, 0), (1, 0, 0), (0, 0, -1), (0, 1, 0)),  # level, to the north
        ((0, 0, 90), (0, -1, 0), (0, 0, -1), (1, 0, 0)),  # to the east
        ((0, 90, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)),  # nose up
        ((90, 0, 0), (0, 0, -1), (-1, 0, 0), (0, 1, 0)),  # right wing down
    ],
)
def test_axes_of_the_camera_in_the_world(angles_deg, right, down, forward):
    """The world has east, north and up."""
    orientation = reading_of(attitude(*np.radians(angles_deg))).orientation
    np.testing.assert_allclose(axes(orientation), [right, down, forward], atol=1e-12)


def test_angles_and_quaternions_say_the_same():
    angles = (0.3, -0.4, 2.5)
    x, y, z, w = Rotation.from_euler("ZYX", angles[::-1]).as_quat()
    quaternion = message("ATTITUDE_QUATERNION", time_boot_ms=1500, q1=w, q2=x, q3=y, q4=z)
    some, other = reading_of(attitude(*angles, ms=1500)), reading_of(quaternion)
    assert some.time_s == other.time_s == 1.5
    np.testing.assert_allclose(some.orientation, other.orientation, atol=1e-12)
    whole = reading_of(odometry(q=(w, x, y, z)))
    np.testing.assert_allclose(whole.orientation, other.orientation, atol=1e-12)
    np.testing.assert_array_equal(whole.position_m, [2, 1, 3])
    assert whole.covariance is None


def test_covariance_turns_with_the_axes():
    variances = np.array([1.0, 2, 3, 4, 5, 6])  # north, east, down; roll, pitch, yaw
    upper = np.diag(variances)[np.triu_indices(6)].tolist()
    covariance = reading_of(odometry(pose_covariance=upper)).covariance
    np.testing.assert_allclose(np.diag(covariance), [2, 1, 3, 5, 6, 4])  # pitch is about the right


@pytest.mark.parametrize("variances", [np.zeros(6), [1, 1, 1, 0, 0, 0], [np.nan] * 6])
def test_covariances_that_are_left_empty_are_unknown(variances):
    upper = np.diag(variances)[np.triu_indices(6)].tolist()
    assert reading_of(odometry(pose_covariance=upper)).covariance is None


def test_other_messages_are_none():
    assert reading_of(message("HEARTBEAT")) is None


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        (attitude(roll=math.nan), "ATTITUDE has angles that are not finite"),
        (attitude(yaw=math.inf), "not finite"),
        (odometry(q=(math.nan, 0, 0, 0)), "must have length 1"),
        (odometry(q=(2, 0, 0, 0)), "must have length 1"),
        (odometry(x=math.nan), "must lie within"),
        (odometry(z=2e6), "must lie within"),
        (odometry(frame_id=20), "frame_id 20; used is 1, MAV_FRAME_LOCAL_NED"),
        (odometry(quality=-1), "it has failed"),
        (
            odometry(pose_covariance=[-1.0] + [0.0] * 20),
            "pose_covariance has a variance of -1; must",
        ),
        (
            odometry(pose_covariance=[1.0] * 2 + [0.0] * 19),
            "has correlations with an eigenvalue of",
        ),
    ],
)
def test_bad_numbers_are_refused(wrong, reason):
    with pytest.raises(InputError, match=reason):
        reading_of(wrong)


def test_the_offset_is_that_of_the_least_delay():
    clock, rng = Clock(), np.random.default_rng(1)
    stamps_s = np.arange(0, 20, 0.02)
    arrivals_s = stamps_s + 500 + 0.003 + rng.exponential(0.05, stamps_s.size)
    instants = [clock.at(*each) for each in zip(stamps_s, arrivals_s, strict=True)]
    assert abs(instants[-1].time_s - (stamps_s[-1] + 500 + 0.003)) < 2 * instants[-1].sigma_s < 0.05
    assert (np.array([each.time_s for each in instants]) <= arrivals_s).all()


def test_a_clock_that_drifts_is_followed():
    clock = Clock()
    for stamp_s in np.arange(0, 10 * WINDOW_S, 0.5):
        instant = clock.at(stamp_s, 1.0001 * stamp_s)
        assert abs(instant.time_s - 1.0001 * stamp_s) <= 1e-4 * 1.5 * WINDOW_S
    assert instant.sigma_s < 1e-4 * 2 * WINDOW_S


@pytest.mark.parametrize("step_s", [-900.0, -2.0, -0.2, 0.2, 2.0])
def test_a_clock_that_steps_is_followed_once_witnesses_agree(step_s):
    clock = Clock()
    for number in range(20):
        assert clock.at(900 + 0.1 * number, 5 + 0.1 * number).confirmed
    for number in range(20, 40):
        arrival_s = 5 + 0.1 * number
        instant = clock.at(900 + step_s + 0.1 * number, arrival_s)
        assert instant.confirmed == (number >= 20 + WITNESSES - 1)
        assert abs(instant.time_s - arrival_s) < 3 * instant.sigma_s < 0.03


def test_one_stamp_out_of_turn_changes_nothing():
    rng = np.random.default_rng(2)
    for ahead_s in rng.uniform(-1, 1, 50):
        clock = Clock()
        for number in range(40):
            if number == 20:
                clock.at(900 + 0.1 * number + ahead_s, 5 + 0.1 * number)
            instant = clock.at(900 + 0.1 * number, 5 + 0.1 * number)
            assert abs(instant.time_s - (5 + 0.1 * number)) <= 3 * instant.sigma_s < 0.06


def test_messages_that_queue_up_may_as_well_be_a_step_and_the_sigma_spans_both():
    clock = Clock()
    for number in range(60):
        late_s = 0.05 * (number >= 20)
        instant = clock.at(0.1 * number, 0.1 * number + late_s)
        assert abs(instant.time_s - 0.1 * number) <= 1.01 * instant.sigma_s
        assert abs(instant.time_s - (0.1 * number + late_s)) <= 1.01 * instant.sigma_s
    for number in range(60, 60 + round(20 * WINDOW_S) + RECENT):
        instant = clock.at(0.1 * number, 0.1 * number + 0.05)
    assert instant.time_s == pytest.approx(0.1 * number + 0.05)  # what lasts is a step


def test_after_a_window_the_least_delay_before_it_is_forgotten_a_window_later():
    """A step back of less than shows, halfway believed, then wholly."""
    clock, times_s = Clock(), []
    for number in range(300):
        arrival_s = 0.1 * number
        times_s.append(clock.at(arrival_s - 0.02 * (number >= 90), arrival_s).time_s - arrival_s)
    begun = round(10 * WINDOW_S) + 1
    assert times_s[begun : 2 * begun] == pytest.approx([-0.01] * begun)
    assert times_s[2 * begun + 1 :] == pytest.approx([0.0] * (299 - 2 * begun))


def test_interpolation_is_along_the_arc():
    turns = Rotation.from_euler("ZYX", [[0.1, 0.2, 0.3], [2.0, -0.5, 0.7]])
    track, expected = Track(10.0, slerp, rotation_vector), Slerp([1.0, 1.2], turns)
    first, second = turns.as_quat()
    track.add(1.2, -second)  # the same attitude
    track.add(1.0, first)
    for time_s in (1.0, 1.05, 1.19, 1.2):
        turn = Rotation.from_quat(track.at(time_s))
        assert (turn * expected(time_s).inv()).magnitude() < 1e-9
    assert np.array_equal(slerp(first, first, 0.4), first)
    spin = (turns[0].inv() * turns[1]).as_rotvec() / 0.2
    np.testing.assert_allclose(track.rate(1.15), spin, rtol=1e-9)
    np.testing.assert_array_equal(rotation_vector(first, -first), 0)


def test_messages_out_of_order_find_their_place():
    track = Track(10.0)
    for time_s in (0.0, 0.3, 0.1, 0.2, 0.1):
        track.add(time_s, np.array([10 * time_s]))
    np.testing.assert_allclose(
        [track.at(time_s)[0] for time_s in (0.05, 0.15, 0.25)], [0.5, 1.5, 2.5]
    )


def test_beyond_a_quarter_of_a_second_there_is_nothing():
    track = Track(10.0)
    assert track.at(0.0) is None
    track.add(1.0, np.array([1.0]))
    track.add(2.0, np.array([2.0]))
    assert MAX_GAP_S == 0.25
    assert track.at(2.24)[0] == 2.0  # as it was
    assert track.at(0.76)[0] == 1.0
    assert track.at(1.2)[0] == pytest.approx(1.2)
    assert [track.at(time_s) for time_s in (2.26, 0.74, 1.5)] == [None] * 3
    track.add(20.0, np.array([20.0]))
    assert track.at(2.0) is None  # forgotten


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("upd:14550", "unknown kind of MAVLink connection 'upd': did you mean 'udp'"),
        ("14550", "allowed: udp, udpin, tcp, tcpin, /dev/DEVICE,BAUD, a .tlog file"),
        ("udp:", "udp:: after udp: comes PORT or HOST:PORT, as in udp:14550"),
        ("udp:host:port", "comes PORT or HOST:PORT"),
        ("udp:99999", "comes PORT or HOST:PORT"),
        ("tcp:5760", "after tcp: comes HOST:PORT, as in tcp:192.168.0.10:14550"),
        ("udpout:localhost:1", "unknown kind of MAVLink connection 'udpout'"),
        ("/dev/ttyACM0,fast", "baud is 'fast', must be a whole number"),
    ],
)
def test_wrong_connections_say_what_is_allowed(text, reason):
    with pytest.raises(InputError) as refusal:
        mavlink_source(text)
    assert reason in str(refusal.value)


def test_a_sink_does_not_listen_for_datagrams():
    with pytest.raises(InputError, match="'udp': did you mean 'udpout'"):
        mavlink_outlet("mavlink:udp:14550")


def test_without_pymavlink_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pymavlink.dialects.v20", None)
    with pytest.raises(InputError, match=r"pip install './reconstruction\[mavlink\]'"):
        PoseSource("udp:14550")


@pytest.fixture
def common():
    return pytest.importorskip("pymavlink.dialects.v20.common")


@pytest.fixture
def source(common):
    source = PoseSource("udp:127.0.0.1:0", sigmas=PoseSigmas(0.1, 0.01))
    yield source
    source.stop()


@pytest.fixture
def flight(capture):
    return film(capture, 10)


def received(poses, capture, at_s, *, stamped=True):
    """Frames of a stream that arrive at these times, stamped with them less 1000 s."""
    setup, *frames, end = messages(capture)
    parsed = Parser().feed(b"".join(frames))
    clock, arrivals = StreamClock(), []
    reception = Reception(
        Script(clock=clock), clock=clock, poses=poses, recorders=[arrivals.append]
    )
    reception.take(setup)
    for each, time_s in zip(parsed, at_s, strict=True):
        clock.now_s = time_s
        stamp = round(1e9 * (time_s - 1000)) if stamped else 0
        reception.take(pack(each._replace(time_ns=stamp)))
    reception.take(end)
    return [each.frame.poses for each in arrivals]


def fly(source, *, skip=(), offset_s=1000.0, every_s=0.02):
    """An autopilot that has run for an hour flies north at 1 m/s and turns right at 0.1 rad/s."""
    for number in range(100):
        time_s = number * every_s
        ms = round(1e3 * (3600 + time_s))
        if not any(low <= time_s <= high for low, high in skip):
            source.take(attitude(yaw=0.1 * time_s, ms=ms), offset_s + time_s)
            place = {"x": time_s, "y": 0.0, "z": -10.0}
            position = message("LOCAL_POSITION_NED", time_boot_ms=ms, **place)
            source.take(position, offset_s + time_s + 0.001)


AT_S = 1000.5 + 0.0973 * np.arange(10)


@pytest.mark.parametrize("stamped", [True, False])
def test_frames_get_the_pose_at_their_time(source, flight, stamped):
    fly(source)
    poses = received(source, flight, AT_S, stamped=stamped)
    first = 0 if stamped else 1  # with the first frame time begins
    for stated, at_s in zip(poses[first:], AT_S[first:], strict=True):
        time_s = at_s - 1000
        assert stated.time_s[0] == pytest.approx(time_s if stamped else at_s, abs=1e-6)
        assert stated.position_m[0] == pytest.approx([0, time_s, 10], abs=2e-3)
        heading = Rotation.from_quat(stated.orientation[0]).as_matrix()[:, 2]
        assert np.arctan2(heading[0], heading[1]) == pytest.approx(0.1 * time_s, abs=2e-4)
        assert np.diag(stated.covariance[0]) == pytest.approx([0.01] * 3 + [1e-4] * 3, rel=0.02)
    assert (source.located, source.missing, source.trouble) == (10, 0, None)


def test_frames_without_stamps_that_arrive_together_are_in_order(source, flight, tmp_path):
    fly(source)
    poses = received(source, flight, np.full(10, 1001.0), stamped=False)
    assert (np.diff([each.time_s[0] for each in poses]) > 0).all()


def test_frames_far_from_any_message_have_none(source, flight):
    fly(source, skip=[(0.9, 1.6)])
    poses = received(source, flight, AT_S)
    away_s = [0.0 if t < 0.88 else min(t - 0.88, 1.62 - t) for t in AT_S - 1000]
    assert [bool(each.known[0]) for each in poses] == [each <= 0.25 for each in away_s]
    assert source.missing == sum(each > 0.25 for each in away_s) > 0
    assert "no pose near the last frame" in source.trouble


def test_an_autopilot_that_restarts_is_followed(source, flight):
    fly(source)
    for number in range(100):  # from 0, two seconds later
        time_s = number * 0.02
        source.take(attitude(ms=round(1e3 * time_s) + 1), 1002 + time_s)
        position = {"x": 7.0, "y": 0.0, "z": 0.0}
        source.take(
            message("LOCAL_POSITION_NED", time_boot_ms=round(1e3 * time_s) + 1, **position),
            1002 + time_s,
        )
    poses = received(source, flight, 2 + AT_S)
    assert all(each.known[0] for each in poses)
    assert poses[3].position_m[0] == pytest.approx([0, 7, 0])


def test_bad_messages_are_counted_and_others_go_on(source, flight):
    source.take(attitude(roll=math.nan), 1000.0)
    assert source.refused == 1
    assert "ATTITUDE has angles that are not finite" in source.trouble
    fly(source)
    assert source.trouble is None
    assert all(each.known[0] for each in received(source, flight, AT_S))


def test_the_first_sender_of_a_pose_is_heard(source, flight):
    other = odometry(x=500.0, time_usec=3600_000_000)
    other.get_srcComponent = lambda: 197
    fly(source)
    for time_s in np.arange(1000, 1002, 0.01):
        source.take(other, time_s)
    poses = received(source, flight, AT_S)
    assert max(abs(each.position_m[0]).max() for each in poses) < 11


def test_a_moved_offset_moves_the_poses(common, flight):
    late = PoseSource("udp:127.0.0.1:0", offset_s=-0.1)
    fly(late)
    poses = received(late, flight, AT_S)
    late.stop()
    assert poses[0].position_m[0, 1] == pytest.approx(AT_S[0] - 1000.1, abs=2e-3)
    assert np.isnan(poses[0].covariance).all()  # nobody has stated one


def test_datagrams_of_pymavlink_are_read_noise_among_them(common, source):
    """Of a real encoder, over a socket, in a thread."""
    port = source._link.port
    codec = common.MAVLink(None, srcSystem=1, srcComponent=1)
    covariance = np.diag([0.01, 0.02, 0.03, 1e-4, 2e-4, 3e-4])[np.triu_indices(6)].tolist()
    sent = common.MAVLink_odometry_message(
        5_000_000, 1, 12, 1.5, -2.5, -3.5, [1, 0, 0, 0], 0, 0, 0, 0, 0, 0, covariance, [0] * 21
    )
    heard = threading.Event()
    take = source.take

    def taken(each, arrival_s):
        take(each, arrival_s)
        if each.get_type() == "ODOMETRY":
            heard.set()

    source.take = taken
    thread = threading.Thread(target=source.run)
    thread.start()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as outlet:
        outlet.sendto(b"\xfd\x00noise\xfe" * 9, ("127.0.0.1", port))
        for _ in range(40):  # a false header swallows some
            outlet.sendto(sent.pack(codec), ("127.0.0.1", port))
        assert heard.wait(30)
    source.stop()
    thread.join(30)
    assert not thread.is_alive()
    now_s = source._positions._times_s[-1]
    assert source._positions.at(now_s).tolist() == [-2.5, 1.5, 3.5]
    diagonal = np.diag(source._covariances.at(now_s))
    np.testing.assert_allclose(diagonal, [0.02, 0.01, 0.03, 2e-4, 3e-4, 1e-4], rtol=1e-6)


@pytest.fixture
def tlog(common, tmp_path):
    """What a ground station has recorded of the flight, from 1970 on, and the same messages."""
    mavutil = pytest.importorskip("pymavlink.mavutil")
    codec = common.MAVLink(None, srcSystem=1, srcComponent=1)
    recorded = []

    class Recorder:
        def take(self, each, arrival_s):
            recorded.append((each, arrival_s))

    fly(Recorder(), offset_s=1.7e9)
    path = tmp_path / "flight.tlog"
    with path.open("wb") as file:
        for each, arrival_s in recorded:
            fields = {
                name: value for name, value in vars(each).items() if not name.startswith("get_")
            }
            if each.get_type() == "ATTITUDE":
                whole = common.MAVLink_attitude_message(
                    **fields, rollspeed=0, pitchspeed=0, yawspeed=0
                )
            else:
                whole = common.MAVLink_local_position_ned_message(**fields, vx=0, vy=0, vz=0)
            file.write(round(1e6 * arrival_s).to_bytes(8, "big") + whole.pack(codec))
    reader = mavutil.mavlogfile(str(path))
    assert reader.recv_match(type="ATTITUDE") is not None  # as pymavlink reads it
    reader.close()
    return path


def test_a_recording_of_a_ground_station_gives_the_same_poses(tlog, source, flight):
    fly(source)
    log = PoseSource(str(tlog), sigmas=PoseSigmas(0.1, 0.01), offset_s=1.7e9)
    for some, other in zip(
        received(log, flight, AT_S), received(source, flight, AT_S), strict=True
    ):
        assert some.position_m == pytest.approx(other.position_m, abs=1e-4)
        assert some.orientation == pytest.approx(other.orientation, abs=1e-5)
        assert some.time_s == pytest.approx(other.time_s)


def test_damage_in_a_recording_costs_what_it_hits(tlog, flight):
    content = tlog.read_bytes()
    middle = len(content) // 2
    tlog.write_bytes(content[:middle] + b"\xfd\x00\xfe\xff" * 5 + content[middle:-7])
    log = PoseSource(str(tlog), offset_s=1.7e9)
    poses = received(log, flight, AT_S)
    for stated, at_s in zip(poses, AT_S, strict=True):
        assert stated.position_m[0] == pytest.approx([0, at_s - 1000, 10], abs=2e-3)


def test_live_takes_poses_of_a_recording(tlog, capture, tmp_path, capsys):
    """Into captures, with frames that end after the poses do."""
    buckets = replace(capture.buckets, pattern_period_s=0.25 / capture.plan.exposures)
    write_capture(film(replace(capture, buckets=buckets), 12), tmp_path / "flight.h5")
    copy = tmp_path / "copy.h5"
    options = ["--poses", str(tlog), "--pose-offset", "1.7e9", "--pose-sigma", "0.1,1", "--quiet"]
    assert main(["live", str(tmp_path / "flight.h5"), "--to", str(copy), *options]) == 0
    poses = read_capture(copy).poses
    assert poses.known.tolist() == [True] * 9 + [False] * 3
    assert poses.position_m[:8, 1] == pytest.approx(0.25 * np.arange(8), abs=2e-3)
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("warning: 3 frames have no pose; ")
    assert line.endswith("flight.tlog: no pose near the last frame")


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["--poses", "none.tlog"], "none.tlog: no such recording of MAVLink"),
        (["--poses", "empty.tlog"], "empty.tlog has no message of a pose"),
        (["--poses", "upd:14550"], "did you mean 'udp'"),
        (["--pose-offset", "1"], "--pose-offset goes with --poses"),
        (["--pose-sigma", "1,1"], "--pose-sigma goes with --poses"),
        (["--pose-sigma", "1"], "is not two numbers, metres and degrees"),
        (["--pose-sigma", "1,nan"], "is not two numbers"),
        (["--pose-offset", "inf"], "is not a number of seconds"),
    ],
)
def test_mistakes_are_told(common, options, reason, capture, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty.tlog").write_bytes(b"\0" * 8 + b"\xfd\x09")
    write_capture(capture, tmp_path / "flight.h5")
    try:
        status = main(["live", "flight.h5", *options])
    except SystemExit as stop:
        status = stop.code
    assert status == 2
    assert reason in capsys.readouterr().err


def test_a_rig_that_restarts_is_followed(source):
    """Its time stamps begin anew, less than a second before the last ones."""
    fly(source)

    def arrival(stamp_s, received_s, run):
        stamped = SimpleNamespace(time_ns=round(1e9 * stamp_s), number=9, run=run)
        return SimpleNamespace(message=stamped, received_s=received_s)

    assert source(arrival(0.7, 1000.7, 1)).position_m[0, 1] == pytest.approx(0.7, abs=2e-3)
    assert source(arrival(0.1, 1001.1, 2)).position_m[0, 1] == pytest.approx(1.1, abs=2e-3)


def test_a_connection_that_breaks_is_opened_again(source, monkeypatch):
    class Breaking:
        """Refuses, then raises what nobody expects, then has nothing more to give."""

        def __init__(self):
            self.faults = [ConnectionRefusedError(111, "refused"), ValueError("odd"), None]
            self.troubles = []

        def open(self):
            self.troubles.append(source.trouble)
            if isinstance(self.faults[0], OSError):
                raise self.faults.pop(0)

        def receive(self, timeout_s):
            fault = self.faults.pop(0)
            if fault is not None:
                raise fault
            source.stop()
            return b""

        def close(self):
            """Nothing is open."""

    monkeypatch.setattr("spisim_live.mavlink.source.FIRST_DELAY_S", 0.0)
    source._link.close()
    source._link = link = Breaking()
    source.run()
    assert link.troubles == [
        "no pose yet from udp:127.0.0.1:0",
        "waiting for udp:127.0.0.1:0: refused",
        "waiting for udp:127.0.0.1:0: ValueError: odd",
    ]


SPEED_M_S, SIGMA_M = 5.0, 0.1


def flown(common, rng, *, step_s=0.0, forged_s=None, side):
    """Errors in m and sigmas of the poses of 180 frames, nan without, and when in s since the step.

    An autopilot at 50 Hz, a rig at 30 Hz, and delays that vary by 5 ms.
    """
    source = PoseSource("udp:127.0.0.1:0", sigmas=PoseSigmas(SIGMA_M, 0.01))
    at_s, events, stated = rng.uniform(1, 5), [], []
    for name, period_s, begun_s in (("autopilot", 0.02, 0.0), ("rig", 1 / 30, 0.2)):
        times_s = np.arange(begun_s, 6, period_s)
        arrivals_s = times_s + 0.01 + rng.exponential(0.005, times_s.size)
        stamps_s = times_s + (step_s if name == side else 0.0) * (times_s >= at_s)
        arrivals_s = np.maximum.accumulate(arrivals_s)
        events += zip(arrivals_s, [name] * times_s.size, times_s, stamps_s, strict=True)
    if forged_s is not None:
        events.append((at_s, side, math.nan, at_s + forged_s))
    for arrival_s, name, time_s, stamp_s in sorted(events):
        if name == "autopilot":
            ms = round(1e3 * (stamp_s + 60))
            place = {"x": SPEED_M_S * np.nan_to_num(time_s), "y": 0.0, "z": 0.0}
            source.take(attitude(ms=ms), arrival_s)
            source.take(message("LOCAL_POSITION_NED", time_boot_ms=ms, **place), arrival_s)
        else:
            stamped = SimpleNamespace(time_ns=round(1e9 * (stamp_s + 90)), number=9, run=1)
            pose = source(SimpleNamespace(message=stamped, received_s=arrival_s))
            error_m = pose.position_m[0, 1] - SPEED_M_S * time_s
            stated.append((error_m, math.sqrt(pose.covariance[0, 1, 1]), time_s - at_s))
    source.stop()
    errors_m, sigmas_m, since_s = np.array(stated)[~np.isnan([each[2] for each in stated])].T
    return errors_m, sigmas_m, since_s


@pytest.mark.parametrize("side", ["autopilot", "rig"])
def test_steps_of_either_clock_leave_errors_within_their_sigma(common, side):
    beyond = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        step_s = rng.uniform(-2, 2) if seed % 2 else rng.uniform(-0.2, 0.2)
        errors_m, sigmas_m, since_s = flown(common, rng, step_s=step_s, side=side)
        assert np.isfinite(errors_m[(since_s < 0) | (since_s > 1)]).all()
        assert np.median(sigmas_m[since_s > 1]) < 3 * SIGMA_M
        beyond += list(np.abs(errors_m) > 3 * sigmas_m)
    assert np.mean(beyond) <= 0.005


@pytest.mark.parametrize("side", ["autopilot", "rig"])
def test_one_forged_message_costs_few_frames(common, side):
    for seed in range(6):
        rng = np.random.default_rng(seed)
        forged_s = rng.uniform(-1, 1)
        errors_m, sigmas_m, _ = flown(common, rng, forged_s=forged_s, side=side)
        assert (~(np.abs(errors_m) < 3 * sigmas_m)).sum() <= 3

"""A simulated drone in place of a rig: how it flies, where light is solved, and what it answers."""

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from reconstruction.base.errors import InputError
from reconstruction.capture import Poses
from scenefiles import MINIMAL
from spisim.scene import load_trajectory
from spisim.simulation.flight import PathKeys, PoseKeys, flown
from spisim_live import Kind, Message, Parser, Pose, Reception, command, pack
from spisim_live.links import Ended, Outlet, Source
from spisim_live.senders import QUIET_S
from spisim_serving.drone import Drone, Follower, Gust
from spisim_serving.line import Line
from spisim_serving.server import Server
from streams import Clock, Script, film

FRAME_S = 0.01


@pytest.fixture
def place(load):
    """A wall 5 m ahead, along x."""
    return load(MINIMAL)


def fly(drone, reported, frames, start=0):
    motions = [drone.fly(reported, (start + n) * FRAME_S, FRAME_S) for n in range(frames)]
    return motions, motions[-1].stop_m


def test_a_drone_is_where_it_is_told_no_faster_than_it_can(place):
    drone = Drone(place)
    motions, stop_m = fly(drone, Pose((1.0, 0.5, -0.2)), 30)
    np.testing.assert_allclose(stop_m, [1.0, 0.5, 0.8], atol=1e-12)
    steps_m = [np.linalg.norm(each.stop_m - each.start_m) for each in motions]
    assert max(steps_m) == pytest.approx(5.0 * FRAME_S)
    for before, after in pairwise(motions):
        np.testing.assert_array_equal(before.stop_m, after.start_m)


def test_it_turns_about_its_own_axes(place):
    half = np.radians(30) / 2
    drone = Drone(place)
    motions, _ = fly(drone, Pose(quaternion=(0, 0, np.sin(half), np.cos(half))), 30)
    ahead = motions[-1].stop.as_matrix()[:, 2]
    np.testing.assert_allclose(ahead, [np.cos(2 * half), np.sin(2 * half), 0], atol=1e-12)
    assert (motions[0].start.inv() * motions[0].stop).magnitude() == pytest.approx(np.pi * FRAME_S)


def test_a_gust_moves_it_and_it_does_not_notice(place):
    drone = Drone(place, (Gust(0.1, 0.2, (-0.4, 0.1, 0.0)),))
    _, stop_m = fly(drone, None, 10)
    np.testing.assert_allclose(stop_m, [0, 0, 1], atol=1e-12)
    _, stop_m = fly(drone, None, 10, 10)
    np.testing.assert_allclose(stop_m, [-0.2, 0.05, 1], atol=1e-9)
    _, stop_m = fly(drone, None, 50, 20)
    np.testing.assert_allclose(stop_m, [-0.4, 0.1, 1], atol=1e-9)
    _, stop_m = fly(drone, Pose((0.3, 0.0, 0.0)), 50, 70)
    np.testing.assert_allclose(stop_m, [-0.1, 0.1, 1], atol=1e-9)


def test_it_stops_before_a_wall_and_can_go_back(place):
    drone = Drone(place)
    _, stop_m = fly(drone, Pose((9.0, 0.0, 0.0)), 200)
    assert stop_m[0] == pytest.approx(4.8, abs=0.021)
    assert drone.trouble is not None
    assert "the drone stays here: object 'wall' is less than 0.2 m away" in drone.trouble
    _, stop_m = fly(drone, Pose(), 200, 200)
    np.testing.assert_allclose(stop_m, [0, 0, 1], atol=1e-9)
    assert drone.trouble is None


def test_it_stays_in_the_scene(place):
    drone = Drone(place)
    _, stop_m = fly(drone, Pose((0.0, 0.0, 1000.0)), 1000)
    assert stop_m[2] == pytest.approx(3 + 15, abs=0.021)
    assert drone.trouble.endswith("the scene ends 15 m beyond its surfaces")


@pytest.mark.parametrize(
    ("position", "message"), [("4.9, 0, 1", "'wall' is less than 0.2 m"), ("5, 0, 90", "ends 15 m")]
)
def test_where_it_cannot_begin_is_told(load, position, message):
    scene = MINIMAL.replace("position_m: [0, 0, 1]", f"position_m: [{position}]")
    with pytest.raises(InputError, match=message):
        Drone(load(scene.replace("look_at_m: [5, 0, 1]", "look_at_m: [9, 0, 1]")))


def test_it_does_not_begin_within_something(load):
    scene = load(
        MINIMAL + "  - {name: box, shape: box, size_m: [1, 1, 1], translate_m: [2, 0, 1],"
        " material: concrete}"
    )
    moved = np.array([2.0, 0.1, 1.0])
    pose = scene.drone_pose.copy()
    pose[:3, 3] = moved
    with pytest.raises(InputError, match="starts inside object 'box'"):
        Drone(replace(scene, drone_pose=pose))


def test_what_moves_gets_in_the_way(load):
    drone = Drone(load(MINIMAL.replace("material:", "velocity_m_s: [-10, 0, 0], material:")))
    _, _ = fly(drone, None, 40)
    assert drone.trouble is None
    fly(drone, None, 9, 40)  # it is 0.1 m away
    assert "object 'wall' is less than 0.2 m away" in drone.trouble


def test_key_poses_are_where_their_numbers_say(place):
    keys = PoseKeys(place, 0.04)
    drone = Drone(place)
    motions, _ = fly(drone, Pose((0.02, 0.01, 0.0), (0, np.sin(0.01), 0, np.cos(0.01))), 5)
    positions = keys.positions(motions[-1], np.array([0.0, 1.0]))
    # Optical axes: x right, y down, z ahead.
    np.testing.assert_allclose(positions[1, :3], [-0.25, 0, 0.5], atol=1e-9)
    np.testing.assert_allclose(positions[1, 3:], [-2.2918, 0, 0], atol=1e-3)
    node = (1, -2, 3, 10, 0, -20)
    pose = keys.scene(node).drone_pose
    turn = motions[0].start.from_matrix(pose[:3, :3])
    there = type(motions[0])(0.0, 1.0, pose[:3, 3], pose[:3, 3], turn, turn)
    np.testing.assert_allclose(keys.positions(there, np.zeros(1))[0], node, atol=1e-9)


def test_where_things_move_keys_have_a_time(load):
    scene = load(MINIMAL.replace("material:", "velocity_m_s: [-1, 0, 0], material:"))
    keys = PoseKeys(scene, 0.05)
    motion = Drone(scene).fly(None, 0.5, FRAME_S)
    assert keys.positions(motion, np.zeros(1))[0, 6] == pytest.approx(10.0)
    wall = keys.scene((0, 0, 0, 0, 0, 0, 10)).objects[0]
    assert wall.mesh.bounds[0, 0] == pytest.approx(4.5)


def test_keys_of_a_path_are_near_each_other(place, tmp_path):
    file = tmp_path / "path.csv"
    file.write_text("t,x,y,z,look_x,look_y,look_z\n0,0,0,1,5,0,1\n2,1,0,1,5,0,1\n4,1,0,1,5,0.2,1\n")
    path = load_trajectory(file)
    keys = PathKeys(place, path, 0.05)
    poses = [keys.scene((number,)).drone_pose for number in range(keys.count)]
    steps_m = np.linalg.norm(np.diff([pose[:3, 3] for pose in poses], axis=0), axis=1)
    assert steps_m.max() <= 0.05 * 1.01
    np.testing.assert_allclose(poses[0], path.pose(0), atol=1e-9)
    np.testing.assert_allclose(poses[-1], path.pose(4), atol=1e-9)
    motion = Follower(path).fly(None, 1.0, FRAME_S)
    place_there = keys.positions(motion, np.zeros(1))[0, 0]
    low, high = (keys.scene((int(place_there) + n,)).drone_pose[0, 3] for n in (0, 1))
    assert low <= motion.start_m[0] <= high
    assert Follower(path).fly(None, 3.995, FRAME_S) is None


def test_a_flown_path_is_a_path_to_fly(place, tmp_path):
    motions, _ = fly(Drone(place), Pose((0.3, 0.1, 0.0), (0, 0, 0.6, 0.8)), 30)
    (tmp_path / "flown.csv").write_text(flown(motions))
    path = load_trajectory(tmp_path / "flown.csv")
    assert path.duration_s == pytest.approx(30 * FRAME_S)
    pose = path.pose(0.2)
    np.testing.assert_allclose(pose[:3, 3], motions[20].start_m, atol=1e-6)
    np.testing.assert_allclose(pose[:3, :3], motions[20].start.as_matrix(), atol=1e-6)


class Wire(Source, Outlet):
    """A line in hand: bytes or errors to be received, and all that was sent."""

    def __init__(self, *acts):
        super().__init__("wire")
        self.acts = list(acts)
        self.sent = b""
        self.opened = 0
        self.closed = False
        self.broken = 0

    def open(self):
        self.opened += 1

    def receive(self, timeout_s):
        if not self.acts:
            raise Ended
        act = self.acts.pop(0)
        if isinstance(act, Exception):
            raise act
        return act

    def send(self, content):
        if self.broken:
            self.broken -= 1
            raise BrokenPipeError(32, "Broken pipe")
        self.sent += content

    def close(self):
        self.closed = True

    @property
    def messages(self):
        return Parser().feed(self.sent)


def serve(capture, wire, clock=None, costs_s=(), setup=None, **options):
    """A server whose camera takes the frames of a film, each at some cost of time."""
    clock = clock or Clock()
    taken, costs = film(capture, 8), iter(costs_s)
    instrument = SimpleNamespace(frame_time_s=FRAME_S)

    def shoot(motions, number):
        clock.wait(next(costs, 0.0))
        return [SimpleNamespace(frame=taken.frame(number % 8), motion=motions[0], number=number)]

    said = []
    line = Line(wire, wire, lasting=True, say=said.append, wait=clock.wait, clock=clock)
    pilot = SimpleNamespace(trouble=None, reported=[])

    def go(reported, time_s, duration_s):
        pilot.reported.append(reported)
        return SimpleNamespace(time_s=time_s)

    pilot.fly = go
    server = Server(
        SimpleNamespace(instrument=instrument, shoot=shoot),
        pilot,
        line,
        setup or taken.setup,
        taken.provenance,
        say=said.append,
        clock=clock,
        wait=clock.wait,
        **options,
    )
    return server, pilot, said


POSE = Pose((1.0, 0.0, 0.0))


def test_in_step_there_is_a_frame_for_each_command(capture):
    corrupted = bytearray(command(POSE, 1))
    corrupted[40] ^= 1
    wire = Wire(
        command(None, 0),
        command(POSE, 1) + command(POSE, 1),  # asked for again, because it did not come
        b"",
        bytes(corrupted),
        command(POSE, 9),
        pack(Message(Kind.COMMAND, b"none", 2)),
        pack(Message(Kind.COMMAND, b"", 3, version=9)),
        pack(Message(Kind.END)),
        command(POSE, 3),
    )
    server, pilot, said = serve(capture, wire)
    server.run_in_step()
    server.end()
    messages = [(each.kind, each.number, each.time_ns) for each in wire.messages]
    assert messages == [
        (Kind.SETUP, 0, 0),
        (Kind.FRAME, 0, 0),
        (Kind.FRAME, 1, 10_000_000),
        (Kind.FRAME, 1, 10_000_000),
        (Kind.FRAME, 2, 20_000_000),
        (Kind.END, 3, 30_000_000),
    ]
    assert pilot.reported == [None, POSE, POSE]  # what was told last, until it is told to the pilot
    tally = server.tally
    assert (tally.frames, tally.repeated, tally.refused, tally.corrupted) == (3, 1, 3, 1)
    assert "it requests frame 9; the next is 2" in said[0]
    assert "a pose of 4 bytes" in said[1]


def test_in_step_a_caller_that_says_nothing_gives_way_to_one_that_does(capture):
    clock = Clock()

    class Shared(Wire):
        """Nothing comes until somebody else is let in, who has called already."""

        wanted = True

        def open(self):
            super().open()
            self.wanted = self.opened < 2

        def receive(self, timeout_s):
            clock.wait(timeout_s)
            return b"" if self.opened < 2 else super().receive(timeout_s)

    wire = Shared(command(None, 0))
    server, _, said = serve(capture, wire, clock)
    began_s = clock.now_s
    server.run_in_step()
    assert wire.opened == 2
    assert QUIET_S < clock.now_s - began_s < QUIET_S + 1
    assert said == ["wire: no command arrives, and another peer is waiting."]
    assert [each.kind for each in wire.messages] == [Kind.SETUP, Kind.SETUP, Kind.FRAME]


def test_commands_come_from_one_sender_at_a_time(capture):
    """And a header of a long message keeps none of them, nor does somebody else end the flight."""
    header = Message(Kind.COMMAND, b"x" * 2**16)
    outlet, datagrams = Wire(), Wire()
    acts = [
        ("them", pack(Message(Kind.END))),
        ("me", pack(header)[:2000]),
        ("me", command(None, 0)),
    ]
    acts += [
        ("them", command(POSE, 1)),
        ("them", pack(Message(Kind.END))),
        ("me", command(POSE, 1)),
    ]

    def receive(timeout_s):
        if not acts:
            raise Ended
        datagrams.sender, content = acts.pop(0)
        return content

    datagrams.receive = receive
    clock = Clock()
    line = Line(outlet, datagrams, lasting=True, say=print, wait=clock.wait, clock=clock)
    line.open()
    reported = []
    while not line.over:
        reported += line.messages(0)
    assert [(each.kind, each.number) for each in reported] == [(Kind.COMMAND, 0), (Kind.COMMAND, 1)]
    assert line.senders.ignored_bytes == len(command(POSE, 1)) + len(pack(Message(Kind.END)))


def test_in_step_it_ends_with_its_commands(capture):
    wire = Wire(command(None, 0))
    server, _, _ = serve(capture, wire)
    server.run_in_step()
    server.end()
    assert [each.kind for each in wire.messages] == [Kind.SETUP, Kind.FRAME, Kind.END]


def test_at_rate_frames_leave_when_they_are_over(capture):
    clock = Clock()
    began_s = clock.now_s
    wire = Wire(*[b""] * 3, command(POSE, 0), *[b""] * 300)
    server, pilot, _ = serve(capture, wire, clock, costs_s=[0.002] * 300, maximum=250)
    server.run_at_rate()
    assert clock.now_s - began_s == pytest.approx(250 * FRAME_S)
    assert (server.tally.late, server.tally.behind_s) == (0, 0.0)
    assert [n for n, reported in enumerate(pilot.reported) if reported is not None] == [3]
    kinds = [each.kind for each in wire.messages]
    assert kinds.count(Kind.SETUP) == 3  # once a second
    stamps = [each.time_ns for each in wire.messages if each.kind == Kind.FRAME]
    np.testing.assert_allclose(np.diff(stamps), 1e9 * FRAME_S)


def test_frames_have_their_true_poses_if_the_setup_has_poses(capture, place):
    wire = Wire(*[b""] * 9)
    posed = replace(film(capture, 8).setup, poses=Poses.none(0))
    server, pilot, _ = serve(capture, wire, setup=posed, maximum=3)
    drone = Drone(place)
    pilot.fly = lambda reported, time_s, period_s: drone.fly(Pose((1.0, 0, 0)), time_s, period_s)
    server.run_at_rate()
    clock, arrivals = Clock(), []
    Reception(Script(wire.sent, clock=clock), clock=clock, recorders=[arrivals.append]).run()
    poses = [each.frame.poses for each in arrivals]
    np.testing.assert_allclose([each.time_s[0] for each in poses], [0.005, 0.015, 0.025])
    np.testing.assert_allclose([each.position_m[0, 0] for each in poses], [0.025, 0.075, 0.125])
    assert all(each.known.all() for each in poses)


def test_late_frames_are_counted_and_not_made_up_for(capture):
    clock = Clock()
    began_s = clock.now_s
    wire = Wire(*[b""] * 30)
    costs_s = [0.002, 0.002, 0.5, 0.002, 0.013, 0.002]
    server, _, _ = serve(capture, wire, clock, costs_s=costs_s, maximum=6)
    server.run_at_rate()
    assert server.tally.late == 2
    assert server.tally.behind_s == pytest.approx(0.49 + 0.003)
    assert clock.now_s - began_s == pytest.approx(6 * FRAME_S + 0.493)


def test_whoever_goes_away_may_come_back(capture):
    gone = ConnectionResetError("the other side has closed the connection")
    wire = Wire(command(None, 0), gone, command(POSE, 1))
    server, _, said = serve(capture, wire)
    server.run_in_step()
    assert wire.opened == 2
    messages = [(each.kind, each.number) for each in wire.messages]
    assert messages == [(Kind.SETUP, 0), (Kind.FRAME, 0), (Kind.SETUP, 1), (Kind.FRAME, 1)]
    assert said == ["wire: the other side has closed the connection."]


def test_at_rate_nothing_is_late_while_nobody_is_there(capture):
    clock = Clock()
    wire = Wire(*[b""] * 30)
    wire.broken = 1  # the first setup

    class Slow(Wire):
        def open(self):
            super().open()
            clock.wait(5.0)

    wire.__class__ = Slow
    server, _, said = serve(capture, wire, clock, maximum=5)
    server.run_at_rate()
    assert wire.opened == 2
    assert (server.tally.frames, server.tally.late) == (5, 0)
    assert said == ["wire: broken pipe."]


def test_a_pipe_that_breaks_is_an_error(capture):
    wire = Wire()
    line = Line(wire, None, lasting=False, say=print, wait=print)
    line.open()
    wire.broken = 1
    with pytest.raises(BrokenPipeError):
        line.send(b"x")

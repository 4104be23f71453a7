"""A simulated drone on the command line, and an autopilot that it obeys."""

import json
import socket
import threading
from pathlib import Path

import numpy as np
import pytest
import yaml

import spisim
from commands import mistake
from commands import spisim as run
from reconstruction import read_capture, reconstruct
from scenefiles import MINIMAL
from spisim.scene import load_trajectory
from spisim_live import Kind, Message, Parser, Pose, StreamSetup, command, pack
from spisim_live.links import source_at
from spisim_serving.record import SEGMENT, FlightRecord

FRAMES = 9


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Scene, path, and an instrument of few pixels."""
    folder = tmp_path_factory.mktemp("serve")
    (folder / "wall.yaml").write_text(MINIMAL)
    (folder / "path.csv").write_text(
        "t,x,y,z,look_x,look_y,look_z\n0,0,0,1,5,0,1\n0.4,0.8,0,1,5,0,1\n"
    )
    (folder / "long.csv").write_text("t,x,y,z,look_x,look_y,look_z\n0,0,0,1,5,0,1\n1,3,0,1,5,0,1\n")
    fields = yaml.safe_load(spisim.load_instrument("paper").text)
    fields["projector"]["shape"] = [16, 16]
    fields["plan"]["patterns"] = 63
    (folder / "small.yaml").write_text(yaml.safe_dump(fields))
    return folder


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as probe:
        return int(probe.getsockname()[1])


def arguments(folder: Path, *options: str) -> list[str]:
    scene, small = folder / "wall.yaml", folder / "small.yaml"
    return [*map(str, ("serve", scene, "--instrument", small, "--light", "surrogate")), *options]


def approach(port: int, step_m: float) -> list[Message]:
    """Ask for frames in step, each time a step farther ahead; all that came, in turn."""
    link, parser, came = source_at(f"tcp://127.0.0.1:{port}"), Parser(), []
    while not came:
        try:
            link.open()
            came += parser.feed(link.receive(1.0))
        except OSError:
            continue
    for number in range(FRAMES):
        link.send(command(Pose((step_m * number, 0.0, 0.0)), number))
        while came[-1].kind != Kind.FRAME or came[-1].number != number:
            came += parser.feed(link.receive(60.0))
    link.send(pack(Message(Kind.END)))
    while came[-1].kind != Kind.END:
        came += parser.feed(link.receive(60.0))
    link.close()
    return came


def fly(folder: Path, step_m: float, *options: str):
    """The messages that came, and what the command said."""
    port = free_port()
    result: list[Message] = []
    pilot = threading.Thread(target=lambda: result.extend(approach(port, step_m)))
    pilot.start()
    address = f"tcp-listen://127.0.0.1:{port}"
    reported = run(*arguments(folder, "--lockstep", "--to", address, "--json", *options))
    pilot.join()
    assert reported.exit_code == 0, reported.stderr
    return result, reported


def test_a_drone_goes_where_it_is_told_the_same_way_each_time(folder):
    record = folder / "flight.h5"
    came, reported = fly(folder, 0.02, "--record", str(record), "--truths", "4")
    report = json.loads(reported.stdout)
    assert (report["frames"], report["commands"], report["stops"]) == (FRAMES, FRAMES, 0)
    stream = StreamSetup(came[0].payload)
    assert stream.provenance.is_surrogate
    assert stream.provenance.source == "simulation"
    capture, flown = read_capture(record), load_trajectory(folder / "flight.csv")
    assert capture.provenance.is_surrogate
    assert capture.truth.frame.tolist() == [0, 4, 8]
    frames = [each for each in came if each.kind == Kind.FRAME]
    for number, message in enumerate(frames):
        frame = stream.frames(message.payload, number)
        np.testing.assert_array_equal(frame.buckets.counts[0], capture.buckets.counts[number])
    # The middle of frame 8, in which it goes from 0.14 to 0.16 m, at most 5 m/s.
    middle_m = flown.pose(8.5 * flown.duration_s / FRAMES)[0, 3]
    assert middle_m == pytest.approx(0.15, abs=1e-6)
    along = stream.setup.spots.directions[:, 2]
    np.testing.assert_allclose(capture.truth.spot_range_m[2], (5 - middle_m) / along, rtol=1e-6)
    result = reconstruct(capture, 8)
    assert result.ranges.valid.all()
    off_m = result.ranges.range_m - capture.truth.spot_range_m[2]
    assert (np.abs(off_m) < 5 * result.ranges.sigma_m).all()
    again, _ = fly(folder, 0.02)
    assert [each.payload for each in again] == [each.payload for each in came]


def test_a_drone_that_is_told_into_a_wall_stops_and_says_so(folder):
    came, reported = fly(folder, 5.0, "--pose", "4.7,0,1")
    assert len([each for each in came if each.kind == Kind.FRAME]) == FRAMES
    assert json.loads(reported.stdout)["stops"] == 1
    assert "the drone stays here: object 'wall' is less than 0.2 m away" in reported.stderr


def test_a_path_is_sent_frame_by_frame_to_a_file(folder):
    stream = folder / "path.stream"
    options = ("--path", str(folder / "path.csv"), "--to", str(stream), "--duration", "0.05")
    reported = run(*arguments(folder, *options, "--speed", "2", "--spacing", "0.1", "--json"))
    assert reported.exit_code == 0, reported.stderr
    report = json.loads(reported.stdout)
    came = Parser().feed(stream.read_bytes())
    assert [came[0].kind, came[-1].kind] == [Kind.SETUP, Kind.END]
    assert report["frames"] == len(came) - 2 == round(0.05 * 15_000 / 64)
    assert report["key_poses"] == 9  # 0.8 m in steps of 0.1 m


def record_path(folder: Path, name: str, duration_s: float):
    """Record a flight along a path, as fast as it goes."""
    words = ("--path", str(folder / "path.csv"), "--to", str(folder / f"{name}.stream"))
    words += ("--record", str(folder / f"{name}.h5"), "--duration", str(duration_s))
    return run(*arguments(folder, *words, "--spacing", "0.1", "--json"))


def test_what_is_recorded_survives_a_kill(folder, monkeypatch):
    monkeypatch.setattr(FlightRecord, "finish", lambda record, provenance: [])  # as if killed
    reported = record_path(folder, "killed", 0.3)
    assert json.loads(reported.stdout)["frames"] == 70
    assert read_capture(folder / "killed.h5").frames == SEGMENT
    assert load_trajectory(folder / "killed.csv").duration_s == pytest.approx(SEGMENT * 64 / 15e3)
    monkeypatch.undo()
    assert record_path(folder, "killed", 0.3).exit_code == 0
    assert read_capture(folder / "killed.h5").frames == 70
    assert not list(folder.glob(".killed*"))


def test_a_long_record_has_parts(folder, monkeypatch):
    monkeypatch.setattr("spisim_serving.record.FRAMES_OF_A_PART", SEGMENT)
    reported = record_path(folder, "parts", 0.3)
    assert reported.exit_code == 0, reported.stderr
    names = [f"{stem}.{suffix}" for stem in ("parts", "parts-2") for suffix in ("h5", "csv")]
    written = json.loads(reported.stdout)["written"]
    assert [Path(name).name for name in written] == names
    first, second = (read_capture(folder / name) for name in names[::2])
    assert (first.frames, second.frames) == (SEGMENT, 6)
    assert second.poses.time_s[0] - first.poses.time_s[-1] == pytest.approx(64 / 15e3)


@pytest.fixture
def taken():
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server


def test_wrong_arguments_are_told_before_any_work(folder, taken):
    port = taken.getsockname()[1]
    (folder / "mine.h5").write_text("mine")
    path, long = (("--path", str(folder / name)) for name in ("path.csv", "long.csv"))
    for options, message in [
        (("--to", f"tcp-listen://127.0.0.1:{port}"), f"cannot listen at port {port}: address alr"),
        (("--to", "tpc://localhost:1"), "did you mean 'tcp'"),
        (("--to", "flight.txt"), "'.txt' is no ending of a stream"),
        (("--to", "udp://localhost:5899", "--lockstep"), "has none: add --commands"),
        ((*path, "--pose", "1,0,1"), "--path and --pose exclude each other"),
        ((*path, "--gust", "1,1,1,0,0"), "--path and --gust exclude each other"),
        (("--path", str(folder / "none.csv")), "none.csv"),
        (("--record", str(folder / "mine.h5")), "exists and is not an earlier"),
        (("--record", str(folder / "flight.txt")), "'.txt'"),
        (("--pose", "1,2"), "--pose 1,2: must be X,Y,Z[,YAW[,PITCH]]"),
        (("--pose", "4.9,0,1"), "cannot start here: object 'wall' is less than 0.2 m away"),
        (("--pose", "0,0,99"), "cannot start here: the scene ends 15 m beyond its surfaces"),
        (("--gust", "1,0,1,0,0"), "and last longer than 0 s"),
        (("--gust", "1,1,x,0,0"), "--gust 1,1,x,0,0: must be START,SECONDS,X,Y,Z"),
        (("--spacing", "0.5"), "0.5 is not a number from 0.001 to 0.1"),
        ((*long, "--spacing", "0.001"), "has 3001 key poses; at most 2000 are allowed in real"),
    ]:
        to = () if "--to" in options else ("--to", f"tcp-listen://127.0.0.1:{free_port()}")
        said = " ".join(mistake(*arguments(folder, *options, *to)).split())
        assert message in said, said
    assert "did you mean 'warehouse'" in mistake("serve", "warehose")

"""Streams on the command line: senders, replays, results; and what is refused with status 2."""

import io
import json
import shutil
import signal
import subprocess
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from reconstruction import read_capture, reconstruct, write_capture
from reconstruction.cli import main
from spisim_live import Message, Parser, pack
from spisim_live.cli import replay
from spisim_live.cli.live import _StatusPrinter
from spisim_live.counts import Counts
from spisim_live.links import source_at
from spisim_live.results import State
from streams import Clock, film

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples" / "live"
sys.path.insert(0, str(EXAMPLES))


@pytest.fixture(scope="module")
def stream(tmp_path_factory):
    """What the sender in Python sends of 20 frames."""
    import sender

    path = tmp_path_factory.mktemp("stream") / "rig.stream"
    path.write_bytes(b"".join(sender.stream(20)))
    return path


@pytest.fixture
def path(capture, tmp_path):
    write_capture(film(capture, 4), tmp_path / "flight.h5")
    return tmp_path / "flight.h5"


def test_the_sender_in_python_is_read_and_its_ranges_are_right(stream, tmp_path, capsys):
    out = tmp_path / "rig"
    sinks = ["--to", "-", "--to", str(out / "copy.h5"), "--to", str(out / "copy.stream")]
    assert main(["live", str(stream), *sinks]) == 0
    reported = capsys.readouterr()
    _, *lines = map(json.loads, reported.out.splitlines())
    frames = [line for line in lines if "frame" in line]
    assert [line["frame"] for line in frames] == list(range(20))
    assert np.allclose(frames[7]["range_m"], [2, 3, 4, 5], atol=0.02)
    assert lines[-1]["state"]["reconstructed"] == 20
    assert "frame 19, " in reported.err
    copy = read_capture(out / "copy.h5")
    image = reconstruct(copy, 16).image
    row, column = np.mgrid[:8, :8]
    displayed = 20 + 5 * column + 120 * ((row >= 2) & (row < 6) & ((column - 1) % 8 < 3))
    assert np.allclose(image, 1000 * displayed, rtol=1e-3)
    assert main(["live", str(out / "copy.stream"), "--frames", "3", "--quiet"]) == 0
    assert capsys.readouterr().err == ""


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_the_sender_in_c_sends_the_same_bytes(stream, tmp_path):
    program = tmp_path / "sender"
    strict = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    subprocess.run(["cc", *strict, "-o", program, EXAMPLES / "sender.c"], check=True)
    sent = subprocess.run([program, "20"], check=True, capture_output=True).stdout
    assert sent == stream.read_bytes()


def test_the_sender_in_c_takes_no_memory_at_run_time():
    source = (EXAMPLES / "sender.c").read_text(encoding="utf-8")
    assert "alloc" not in source


def test_a_replay_is_the_capture(path, tmp_path, capsys):
    stream = tmp_path / "flight.stream"
    assert main(["replay", str(path), "--to", str(stream), "--times", "2"]) == 0
    copy = tmp_path / "copy.h5"
    assert main(["live", str(stream), "--to", str(copy), "--image", "zero-filled"]) == 0
    counts = read_capture(path).buckets.counts
    assert np.array_equal(read_capture(copy).buckets.counts, np.concatenate([counts, counts]))
    assert main(["live", str(path), "--quiet", "--depth", "nearest"]) == 0


def test_frames_of_a_replay_are_on_time(capture):
    clock = Clock()
    began_s, sent = clock.now_s, []
    outlet = SimpleNamespace(send=lambda content: sent.append((clock.now_s, content)))
    replay.send(film(capture, 30), outlet, 0.1, clock=clock, wait=clock.wait)
    result = Parser().feed(b"".join(content for _, content in sent))
    assert [each.kind for each in result].count(1) == 3  # once a second
    frames = [(at_s, each) for (at_s, _), each in zip(sent, result, strict=True) if each.kind == 2]
    for number, (at_s, each) in enumerate(frames):
        assert at_s - began_s == pytest.approx(0.1 * number)
        assert each.number == number
        assert each.time_ns == pytest.approx(1e8 * number, abs=2)
        assert each.run > 0


def test_a_replay_waits_until_somebody_is_there(capsys):
    refusals = [ConnectionRefusedError(111, "refused")] * 3

    def open_it():
        if refusals:
            raise refusals.pop()

    clock = Clock()
    began_s = clock.now_s
    replay._opened(SimpleNamespace(open=open_it, address="tcp://rig:5800"), clock.wait)
    assert clock.now_s - began_s == 3 * replay.AGAIN_S
    assert capsys.readouterr().err == "waiting for tcp://rig:5800: refused\n"


def test_results_come_over_tcp_from_a_sender_over_tcp(path, monkeypatch, capsys):
    """A rig, this, and an autopilot."""
    ports = []
    for _ in range(2):
        probe = source_at("tcp-listen://127.0.0.1:0")
        probe.check()
        ports.append(probe.port)
        probe.close()
    pilot = source_at(f"tcp-listen://127.0.0.1:{ports[1]}")
    pilot.check()
    source = f"tcp-listen://127.0.0.1:{ports[0]}"
    reported = []

    def fly():
        status = main(["live", source, "--to", f"tcp://127.0.0.1:{ports[1]}", "--quiet"])
        reported.append(status)

    flying = threading.Thread(target=fly)
    flying.start()
    sending = threading.Thread(
        target=main, args=(["replay", str(path), "--to", f"tcp://127.0.0.1:{ports[0]}"],)
    )
    sending.start()
    parser, result = Parser(), []
    while True:
        try:
            pilot.open()
            break
        except TimeoutError:
            assert flying.is_alive()
    while not any(each.kind == 3 for each in result):
        result += parser.feed(pilot.receive(60.0))
    pilot.close()
    for thread in (sending, flying):
        thread.join(60)
    assert reported == [0]
    assert {each.kind for each in result} == {3, 4, 5}
    assert parser.discarded_bytes == 0


def test_wrong_streams_end_with_status_2_and_one_line(path, tmp_path, capsys):
    (tmp_path / "newer.stream").write_bytes(pack(Message(1, b"", version=9)))
    (tmp_path / "noise.stream").write_bytes(b"noise" * 100)
    (tmp_path / "plan.stream").write_bytes(pack(Message(1, b"\x01au1\x00\0")))
    (tmp_path / "mine.jsonl").write_text("mine")
    new = str(tmp_path / "new.stream")
    source = str(path)
    for arguments, message in [
        (["live", str(tmp_path / "newer.stream")], "messages of version 9; this program reads ver"),
        (["live", str(tmp_path / "plan.stream")], "its setup cannot be used: patterns/basis is"),
        (
            ["live", str(tmp_path / "noise.stream")],
            "noise.stream: no frame was reconstructed: discarded_bytes 500",
        ),
        (["live", str(tmp_path / "none.stream")], "no such stream or capture file"),
        (["live", str(tmp_path / "none.h5")], "none.h5: no such capture file"),
        (["live", str(tmp_path)], "is a folder; the name of a capture file is needed"),
        (["live", "tpc://localhost:1"], "did you mean 'tcp'"),
        (["live", source, "--to", str(tmp_path / "mine.jsonl")], "exists and is not an earlier"),
        (["live", source, "--to", str(tmp_path / "film.mp4")], "unknown extension"),
        (["live", source, "--to", source, "--overwrite"], "is read by this command; give its"),
        (["live", source, "--to", "-", "--to", "-"], "--to - is given twice"),
        (["live", source, "--image", "zero-fill"], "did you mean 'zero-filled'"),
        (["live", source, "--depth", "dense"], "'dense' needs pattern taps, which"),
        (["replay", source, "--to", str(tmp_path / "new.txt")], "'.txt' is no ending of a stream"),
        (["replay", str(tmp_path / "none.h5"), "--to", new], "no such capture file"),
        (["replay", source, "--to", "tcp://localhost"], "lacks a host and port"),
    ]:
        assert main([*arguments, *(["--quiet"] if arguments[0] == "live" else [])]) == 2, arguments
        error = capsys.readouterr().err
        assert error.startswith("error: ")
        assert message in error
        assert error.count("\n") == 1
    assert not Path(new).exists()


@pytest.mark.parametrize(
    "arguments",
    [["--frames", "0"], ["--waiting", "x"], ["--reorder", "65"], ["--waiting", "-1"]],
)
def test_wrong_numbers_are_told(arguments, path):
    with pytest.raises(SystemExit) as stop:
        main(["live", str(path), *arguments])
    assert stop.value.code == 2


def test_a_capture_that_tells_no_time_needs_a_rate(capture, tmp_path, capsys):
    from dataclasses import replace

    path = tmp_path / "timeless.h5"
    buckets = replace(capture.buckets, pattern_period_s=np.nan)
    write_capture(replace(capture, buckets=buckets), path)
    assert main(["replay", str(path), "--to", "udp://localhost:5899"]) == 2
    assert "state the frame rate with --rate" in capsys.readouterr().err
    assert main(["replay", str(path), "--to", "udp://localhost:5899", "--rate", "inf"]) == 0
    with pytest.raises(SystemExit):
        main(["replay", str(path), "--to", "-", "--rate", "0"])


def test_a_stated_rate_is_that_of_the_replay(path, tmp_path, monkeypatch):
    periods = []
    monkeypatch.setattr(replay, "send", lambda capture, outlet, *given: periods.append(given[0]))
    new = str(tmp_path / "new.stream")
    assert main(["replay", str(path), "--to", new, "--rate", "20"]) == 0
    assert periods == [1 / 20]


def test_an_interrupt_ends_a_stream_with_what_it_has(path, tmp_path, monkeypatch):
    """And closes its sinks."""
    from spisim_live.cli import live

    class Interrupted(live.Loop):
        def run(self, maximum=None):
            super().run(2)
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(live, "Loop", Interrupted)
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    out = tmp_path / "kept.h5"
    assert main(["live", str(path), "--to", str(out)]) == 0
    assert 2 <= read_capture(out).frames <= 4


@pytest.fixture
def interruptible():
    """SIGINT as in a terminal, though the tests run where it is ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interruptible")
@pytest.mark.parametrize("kind", [SystemExit, KeyboardInterrupt, GeneratorExit])
@pytest.mark.parametrize("fails", ["spisim_live.loop.Reconstructor.__call__",
                                   "spisim_live.sinks.records.CaptureRecord.frame",
                                   "spisim_live.cli.live.CaptureSource.receive"])  # fmt: skip
def test_what_would_end_the_program_is_reported(kind, fails, path, tmp_path, monkeypatch, capsys):
    def ends(*_):
        raise kind(0)

    monkeypatch.setattr(fails, ends)
    assert main(["live", str(path), "--to", str(tmp_path / "a.h5"), "--quiet"]) == 2
    assert f"{kind.__name__}: 0" in capsys.readouterr().err


@pytest.mark.usefixtures("interruptible")
def test_once_interrupted_a_command_ignores_further_ones(path, monkeypatch, capsys):
    def interrupted(options):
        raise KeyboardInterrupt

    def failing(line, file):
        if file is sys.stderr:
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr("spisim_live.cli.live.run", interrupted)
    monkeypatch.setattr("builtins.print", failing)
    assert main(["live", str(path)]) == 130
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_sink_that_failed_to_the_end_is_an_error(path, tmp_path, monkeypatch, capsys):
    from spisim_live.sinks.records import CaptureRecord

    def full(self):
        raise OSError(28, "No space left on device", "flight.h5")

    monkeypatch.setattr(CaptureRecord, "_write", full)
    assert main(["live", str(path), "--to", str(tmp_path / "a.h5"), "--quiet"]) == 2
    assert "a.h5: flight.h5: No space left on device" in capsys.readouterr().err


def test_a_sink_that_failed_at_times_is_an_error_too(path, tmp_path, monkeypatch, capsys):
    """And the others have what they should."""
    from spisim_live.sinks.lines import JsonLines

    def odd(self, outcome):
        if outcome.result.frame == 1:
            raise ValueError("Out of range float values")

    monkeypatch.setattr(JsonLines, "result", odd)
    copy = tmp_path / "copy.h5"
    sinks = ["--to", str(tmp_path / "a.jsonl"), "--to", str(copy)]
    assert main(["live", str(path), *sinks, "--quiet"]) == 2
    messages = capsys.readouterr().err
    assert "a.jsonl: ValueError: Out of range float values; lost 1" in messages
    assert read_capture(copy).frames == 4


def test_nothing_but_what_the_rig_has_is_loaded(path):
    code = (
        "import sys; from reconstruction.cli import main; "
        f"status = main(['live', {str(path)!r}, '--quiet']); "
        "banned = {'spisim', 'mitsuba', 'matplotlib', 'serial', 'numba', 'multiprocessing'}; "
        "sys.exit(status or sorted(banned & set(sys.modules)) or None)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr


def test_the_example_has_no_other_needs():
    """Of what MicroPython has not."""
    import ast

    tree = ast.parse((EXAMPLES / "sender.py").read_text(encoding="utf-8"))
    names = {n.name for node in ast.walk(tree) if isinstance(node, ast.Import) for n in node.names}
    assert names == {"binascii", "struct", "sys", "socket"}


def test_a_replay_that_is_interrupted_leaves_no_file(path, tmp_path, monkeypatch, capsys):
    def interrupted(self, content):
        raise KeyboardInterrupt

    monkeypatch.setattr("spisim_live.links.NewFile.send", interrupted)
    assert main(["replay", str(path), "--to", str(tmp_path / "a.stream")]) == 130
    assert not (tmp_path / "a.stream").exists()
    assert capsys.readouterr().err == "error: interrupted; no file is left half-written\n"


def test_results_that_nobody_took_are_told(path, capsys):
    probe = source_at("tcp-listen://127.0.0.1:0")
    probe.check()
    port = probe.port
    probe.close()
    assert main(["live", str(path), "--to", f"tcp://127.0.0.1:{port}", "--quiet"]) == 0
    messages = capsys.readouterr().err
    assert messages == f"warning: tcp://127.0.0.1:{port}: Connection refused; lost 4\n"


def test_spots_without_a_range_are_named_by_their_status(capsys):
    ranges = SimpleNamespace(range_m=np.array([2.0, 3.0]), status=("ok", "no signal"))
    printer = _StatusPrinter([], None, quiet=False)
    printer.result(SimpleNamespace(result=SimpleNamespace(frame=3, ranges=ranges)))
    printer.state(State(Counts(), 0.1, 0.01, 0.02, 30.0, ""))
    assert "ranges 2.00 m, no signal" in capsys.readouterr().err

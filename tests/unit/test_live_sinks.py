"""What sinks write: captures, streams, lines, the latest result, messages; and a window."""

import io
import json
import os
import sys
from dataclasses import replace

import numpy as np
import pytest

from reconstruction import (
    InputError,
    Reconstructor,
    make_plan,
    read_capture,
    read_result,
    reconstruct,
)
from spisim_live import Kind, Loop, Parser, Reception, drawing, unpacked
from spisim_live.drawing import Incoming, Window, status_lines
from spisim_live.links import NewFile
from spisim_live.results import STATUSES, text_of
from spisim_live.sinks import records, sink_to
from spisim_live.sinks.latest import EVERY_S, LatestResult
from spisim_live.sinks.lines import JsonLines
from spisim_live.sinks.messages import MessageSink
from spisim_live.sinks.records import CaptureRecord, StreamRecord
from spisim_live.sinks.window import WindowSink
from streams import Clock, Script, film, messages


@pytest.fixture
def recording(capture):
    return film(capture, 6)


def require(sink):
    """A sink that is ready for a moment."""
    with sink.ready():
        pass


def fed(sink, content, **options):
    """A sink after a stream of these messages."""
    clock = Clock()
    reception = Reception(
        Script(*content, clock=clock), clock=clock, waiting=1000, recorders=[sink.frame]
    )
    loop = Loop(reception, results=[sink.result], states=[sink.state], clock=clock, **options)
    reception.run()
    loop.run()
    sink.close()
    return sink


class Outgoing(NewFile):
    """Remembers what is sent; nobody listens while ``deaf``."""

    def __init__(self):
        self.content = b""
        self.deaf = False
        self.opened = 0

    def open(self):
        self.opened += 1
        if self.deaf:
            raise ConnectionRefusedError(111, "Connection refused")

    def send(self, content):
        if self.deaf:
            raise BrokenPipeError(32, "Broken pipe")
        self.content += content

    def close(self):
        pass


def test_a_capture_holds_the_frames_and_gives_the_same_results(recording, tmp_path):
    fed(CaptureRecord(tmp_path / "flight.h5"), messages(recording))
    copy = read_capture(tmp_path / "flight.h5")
    assert copy.frames == 6
    assert copy.provenance.source == "simulation"
    assert np.array_equal(copy.buckets.counts, recording.buckets.counts)
    assert np.array_equal(copy.spots.taps, recording.spots.taps)
    one, other = reconstruct(copy, 3), reconstruct(recording, 3)
    assert one.image.tobytes() == other.image.tobytes()


def test_captures_are_whole_at_any_time_and_of_bounded_length(recording, tmp_path, monkeypatch):
    monkeypatch.setattr(records, "FRAMES_OF_A_PART", 4)
    monkeypatch.setattr(records, "FRAMES_BETWEEN", 2)
    path = tmp_path / "flight.h5"
    sink = CaptureRecord(path)
    clock = Clock()
    output = messages(recording)
    reception = Reception(Script(*output, clock=clock), clock=clock, recorders=[sink.frame])
    seen = []
    while not reception.over:
        reception.step()
        seen.append(read_capture(path).frames if path.exists() else 0)
    assert sorted(set(seen)) == [0, 2, 4]
    sink.close()
    assert read_capture(tmp_path / "flight-2.h5").frames == 2


def test_a_part_that_cannot_be_written_costs_the_next_one_nothing(recording, tmp_path, monkeypatch):
    write = records.write_capture
    broken = [InputError("optics/aperture is nan")]

    def failing(capture, path):
        if broken:
            raise broken.pop()
        write(capture, path)

    monkeypatch.setattr(records, "write_capture", failing)
    monkeypatch.setattr(records, "FRAMES_OF_A_PART", 4)
    sink = CaptureRecord(tmp_path / "flight.h5")
    reception = Reception(Script(*messages(recording)), waiting=100)
    reception.run()
    for _ in range(3):
        sink.frame(reception.queue.get(0))
    with pytest.raises(InputError, match="aperture is nan; its 4 frames are lost"):
        sink.frame(reception.queue.get(0))
    for _ in range(2):
        sink.frame(reception.queue.get(0))
    sink.close()
    assert read_capture(tmp_path / "flight-2.h5").frames == 2


def test_where_patterns_take_turns_a_gap_begins_another_capture(capture, tmp_path):
    plans = [make_plan((16, 16), 128, f"random:{seed}") for seed in range(3)]
    dealt = replace(film(capture, 8), plan=plans[0], following_plans=tuple(plans[1:]))
    content = messages(dealt)
    del content[5]  # frame 4
    fed(CaptureRecord(tmp_path / "a.h5"), content)
    first, second = (read_capture(tmp_path / name) for name in ("a.h5", "a-2.h5"))
    assert (first.frames, second.frames) == (4, 3)
    for number in range(3):
        assert second.setup.digest(number) == dealt.setup.digest(5 + number)
        displayed = reconstruct(second, number).image, reconstruct(dealt, 5 + number).image
        assert np.array_equal(*displayed)


def test_a_record_of_the_stream_is_the_stream(recording, tmp_path):
    path = tmp_path / "flight.stream"
    content = messages(recording)
    fed(StreamRecord(NewFile(path)), content)
    assert path.read_bytes()[: -len(content[-1])] == b"".join(content[:-1])


class Text(io.StringIO):
    """Can be read when it is closed."""

    def close(self):
        pass


def test_lines_are_of_numbers(recording):
    recording.spots.saturated[3, 2] = True
    text = Text()
    fed(JsonLines(lambda: text), messages(recording))
    made, *lines = map(json.loads, text.getvalue().splitlines())
    assert made == {"made": "made by spisim: results of a stream"}
    frames = [line for line in lines if "frame" in line]
    assert [line["frame"] for line in frames] == list(range(6))
    expected = Reconstructor(recording.setup)(recording.frame(3))
    assert frames[3]["range_m"][2] is None
    assert frames[3]["range_status"][2] == "saturated"
    assert frames[3]["range_m"][0] == expected.ranges.range_m[0]
    assert frames[3]["nearest_m"] == pytest.approx(float(np.nanmin(expected.depth_m)))
    assert frames[3]["obstacle_m"] == pytest.approx(expected.obstacle_m)
    assert lines[-1]["state"]["reconstructed"] == 6
    assert lines[-1]["state"]["lost"] == 0


def test_the_latest_result_is_replaced_once_a_second(recording, tmp_path):
    clock = Clock()
    sink = LatestResult(tmp_path / "now", clock=clock)
    reception = Reception(Script(*messages(recording), clock=clock), clock=clock, waiting=100)
    results = []
    loop = Loop(reception, results=[results.append], states=[sink.state], clock=clock)
    reception.run()
    loop.run()
    displayed = []
    for outcome in results:
        sink.result(outcome)
        displayed.append(read_result(tmp_path / "now" / "result.h5").frame)
        clock.wait(EVERY_S / 2 + 1e-6)
    assert displayed == [0, 0, 2, 2, 4, 4]
    sink.close()
    assert read_result(tmp_path / "now" / "result.h5").frame == 5
    assert (tmp_path / "now" / "depth.png").is_file()
    state = json.loads((tmp_path / "now" / "state.json").read_text())
    assert state["reconstructed"] == 6
    require(LatestResult(tmp_path / "now"))  # its own files it replaces
    (tmp_path / "now" / "state.json").write_text("{}")
    with pytest.raises(InputError, match=r"state\.json exists and is not an earlier state"):
        require(LatestResult(tmp_path / "now"))


def test_results_go_out_in_the_framing(recording):
    outlet = Outgoing()
    fed(MessageSink(outlet), messages(recording))
    *results, state, end = Parser().feed(outlet.content)
    assert [each.kind for each in results] == [Kind.RESULT] * 6
    assert (state.kind, end.kind) == (Kind.STATUS, Kind.END)
    expected = Reconstructor(recording.setup, image="edge-preserving")(recording.frame(4))
    result = unpacked(results[4].payload)
    assert (results[4].number, results[4].time_ns) == (4, 4000)
    for name, values in (
        ("image", expected.image),
        ("depth_m", expected.depth_m),
        ("range_m", expected.ranges.range_m),
        ("range_sigma_m", expected.ranges.sigma_m),
    ):
        assert result[name].dtype == values.dtype
        assert np.array_equal(result[name], values, equal_nan=True)
    assert tuple(STATUSES[n] for n in result["range_status"]) == expected.ranges.status
    assert text_of(result["image_unit"]) == "electron"
    reported = unpacked(state.payload)
    assert reported["reconstructed"] == 6
    assert text_of(reported["trouble"]) == ""


def test_while_nobody_listens_results_are_gone_and_who_comes_gets_new_ones(recording):
    clock, outlet = Clock(), Outgoing()
    sink = MessageSink(outlet, clock)
    reception = Reception(Script(*messages(recording)), waiting=100)
    results = []
    loop = Loop(reception, results=[results.append])
    reception.run()
    loop.run()
    outlet.deaf = True
    for outcome in results[:2]:
        with pytest.raises(OSError, match="refused"):
            sink.result(outcome)
    assert outlet.opened == 1  # not tried again at once
    outlet.deaf = False
    clock.wait(10)
    sink.result(results[3])
    outlet.deaf = True
    with pytest.raises(BrokenPipeError):
        sink.result(results[4])
    outlet.deaf = False
    clock.wait(10)
    sink.result(results[5])
    assert [each.number for each in Parser().feed(outlet.content)] == [3, 5]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("film.mp4", r"unknown extension '\.mp4'; allowed: \.jsonl"),
        ("tpc://localhost:1", "unknown scheme 'tpc': did you mean 'tcp'"),
        ("tcp://localhost", "lacks a host and port, 0 to 65535, as in tcp://"),
        ("tcp://localhost:99999", "lacks a host and port"),
        ("udp://:5800", "lacks a host and port"),
        ("serial:///dev/ttyUSB0?bod=1", "unknown option 'bod': allowed: baud"),
        ("serial:///dev/ttyUSB0?baud=fast", "baud is 'fast', must be a whole number"),
        ("serial://ttyUSB0", "lacks a device, as in serial:///dev/ttyUSB0"),
    ],
)
def test_what_is_no_sink_is_told(name, message):
    with pytest.raises(InputError, match=message):
        sink_to(name)


@pytest.mark.parametrize("name", ["a.jsonl", "a.stream", "a.h5"])
def test_files_of_others_are_not_replaced(name, tmp_path):
    path = tmp_path / name
    path.write_text("mine")
    with pytest.raises(InputError, match="exists and is not an earlier"):
        require(sink_to(str(path)))
    require(sink_to(str(path), overwrite=True))
    assert path.read_text() == "mine"


def test_a_window_that_cannot_be_opened_says_why():
    said = "print('there is no display to open it on')"
    with pytest.raises(InputError, match="window: there is no display to open it on"):
        require(WindowSink([sys.executable, "-c", said]))
    with pytest.raises(InputError, match="window: it cannot be opened"):
        require(WindowSink([sys.executable, "-c", ""]))


def test_a_window_without_a_display_says_so(monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("MPLBACKEND", "agg")
    with pytest.raises(InputError, match=r"window: there is no display; use --to FOLDER"):
        require(WindowSink())


def test_the_window_draws_until_its_input_ends(recording, monkeypatch, capsys):
    """With a toolkit that has no windows, but believes to have."""
    import matplotlib as mpl
    from matplotlib import pyplot as plt

    outlet = Outgoing()
    fed(MessageSink(outlet), messages(recording))
    reading, writing = os.pipe()
    os.write(writing, outlet.content)
    os.close(writing)
    monkeypatch.setattr(mpl, "get_backend", lambda: "TkAgg")
    monkeypatch.setattr(plt, "show", lambda block: None)
    monkeypatch.setattr(drawing, "Incoming", lambda: Incoming(reading))
    assert drawing.main() == 0
    assert capsys.readouterr().out == "ready\n"
    image, depth, _ = plt.gcf().axes
    assert image.images[0].get_array().shape == depth.images[0].get_array().shape == (16, 16)
    plt.close("all")
    os.close(reading)


def test_a_window_that_its_user_has_closed_is_no_trouble(recording):
    sink = WindowSink([sys.executable, "-c", "print('ready')"])
    require(sink)
    sink._process.wait(600)
    fed(sink, messages(recording))
    sink.abandon()
    sink._process.stdin.close()
    sink._process.stdout.close()


def test_what_the_window_draws(recording, tmp_path):
    from matplotlib.figure import Figure

    recording.spots.saturated[5, 2] = True
    outlet = Outgoing()
    fed(MessageSink(outlet), messages(recording))
    incoming = Incoming()
    figure = Figure(figsize=(10, 5))
    window = Window(figure)
    window.show(incoming)
    assert status_lines(incoming) == []
    incoming.take(outlet.content)
    window.show(incoming)
    ranges, age, state = status_lines(incoming)
    assert ranges.startswith("ranges  4.200 +- 0.007 m")
    assert "saturated" in ranges
    assert age.startswith("frame 5, ")
    assert state.startswith("frames_per_s ")
    figure.savefig(tmp_path / "window.png")
    assert (tmp_path / "window.png").stat().st_size > 10_000

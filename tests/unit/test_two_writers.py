"""Two writers of one output: the second is refused by name, the first stays whole."""

import json
import os
import threading
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest

from commands import mistake
from holders import held
from reconstruction import read_capture, read_result, write_capture
from reconstruction.base.errors import InputError
from reconstruction.base.files import Output
from reconstruction.base.folders import output_files
from reconstruction.cli import main
from spisim_live import Kind, Loop, Parser, Reception
from spisim_live.sinks import sink_to
from streams import Script, film, messages

FRAMES = 4
SINKS = ["a.jsonl", "a.stream", "a.h5", "a.mcap", "latest"]


@pytest.fixture
def recording(capture, tmp_path):
    write_capture(film(capture, FRAMES), tmp_path / "flight.h5")
    return tmp_path / "flight.h5"


@contextmanager
def held_by_another(path):
    """A file as another process writes it."""
    with held(path.with_name(f".{path.name}.lock")):
        yield f"{path.name}: process 123 on there is writing into it; wait for it or end it"


def count(path):
    """Frames in what a sink wrote, read to its end."""
    if path.suffix == ".jsonl":
        return sum("frame" in json.loads(line) for line in path.read_text().splitlines())
    if path.suffix == ".stream":
        kinds = [message.kind for message in Parser().feed(path.read_bytes())]
        assert kinds[-1] == Kind.END
        return kinds.count(Kind.FRAME)
    if path.suffix == ".h5":
        return read_capture(path).frames
    if path.suffix == ".mcap":
        reader = pytest.importorskip("mcap.reader")
        with path.open("rb") as file:
            found = reader.make_reader(file).iter_messages(topics=["/camera/spot_0/range"])
            return sum(1 for _ in found)
    return read_result(path / "result.h5").frame + 1


@pytest.mark.parametrize("name", SINKS)
def test_a_second_live_is_refused_and_the_first_is_whole(name, recording, tmp_path, capsys):
    path = tmp_path / name
    sink = sink_to(str(path))
    reception = Reception(Script(*messages(read_capture(recording))), recorders=[sink.frame])
    loop = Loop(reception, results=[sink.result], states=[sink.state])
    second = []

    def other():
        second.append(main(["live", str(recording), "--to", str(path), "--overwrite", "--quiet"]))

    with sink.ready():
        reception.run()
        thread = threading.Thread(target=other)
        thread.start()
        thread.join()
        loop.run()
        sink.close()
    assert second == [2]
    assert f"{name}: process " in capsys.readouterr().err
    assert count(path) == FRAMES
    other()
    assert second == [2, 0]
    assert not [each.name for each in tmp_path.rglob("*") if each.name.endswith((".lock", ".tmp"))]


def test_parts_of_a_recording_are_locked_too(capture, tmp_path, monkeypatch):
    monkeypatch.setattr("spisim_live.sinks.records.FRAMES_OF_A_PART", 2)
    sink = sink_to(str(tmp_path / "a.h5"))
    reception = Reception(Script(*messages(film(capture, 3))))
    reception.run()
    arrivals = [reception.queue.get(0) for _ in range(3)]
    with sink.ready(), held_by_another(tmp_path / "a-2.h5") as refused:
        for arrival in arrivals:
            sink.frame(arrival)
        with pytest.raises(InputError, match=refused):
            sink.close()
    assert count(tmp_path / "a.h5") == 2


@pytest.mark.parametrize("name", ["a.jsonl", "./a.jsonl", "../here/a.jsonl"])
def test_one_output_is_named_once(name, recording, tmp_path, monkeypatch, capsys):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    assert main(["live", str(recording), "--to", "a.jsonl", "--to", name]) == 2
    assert f"--to {name} is given twice" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["a.jsonl", "a.stream", "a.mcap"])
def test_another_name_of_an_earlier_recording_keeps_it(name, recording, tmp_path):
    path = tmp_path / name
    assert main(["live", str(recording), "--to", str(path), "--quiet"]) == 0
    before = path.read_bytes()
    (tmp_path / "kept").hardlink_to(path)
    assert main(["live", str(recording), "--to", str(path), "--quiet", "--overwrite"]) == 0
    assert (tmp_path / "kept").read_bytes() == before
    assert not path.samefile(tmp_path / "kept")


COMMANDS = {
    "replay {capture} --to": "out.stream",
    "calibrate {capture} --repeat {capture} -o": "out.h5",
    "import {readings} --shape 4x4 -o": "out.h5",
    "export {capture} -o": "out",
    "reconstruct {capture} -o": "out",
}


@pytest.mark.parametrize(("words", "name"), COMMANDS.items())
def test_commands_of_the_rig_refuse(words, name, recording, tmp_path, capsys):
    np.save(tmp_path / "readings.npy", np.arange(16))
    words = words.format(capture=recording, readings=tmp_path / "readings.npy")
    out = tmp_path / name
    lock = out / ".lock" if words.startswith("reconstruct") else tmp_path / f".{name}.lock"
    with held(lock):
        assert main([*words.split(), str(out)]) == 2
    assert f"{name}: process 123 on there is writing into it" in capsys.readouterr().err


PROGRAM = {
    "simulate target-plane -o": "out.h5",
    "fly warehouse --path warehouse-flight --rate frames -o": "out.h5",
    "transport target-plane -o": "out.exr",
    "picture target-plane -o": "out.exr",
    "scenes show target-plane -o": "out.png",
    "scenes draw warehouse -o": "out.yaml",
    "scenes export warehouse -o": "out.glb",
    "budget paper -o": "out.png",
    "instrument new --defaults -o": "out.yaml",
    "serve warehouse --light surrogate --record": "out.h5",
    "serve warehouse --light surrogate --to": "out.stream",
    "compare {capture} {capture} --page": "out.html",
    "fit {capture} --scene target-plane --free projector.power_w -o": "out.yaml",
    "fit {capture} --scene target-plane --free projector.power_w --page": "out.html",
    "fit {capture} --scene target-plane --free projector.power_w --output-instrument": "out.yaml",
    "dataset sheet {folder} -o": "out.html",
    "view {capture} --save": "out.rrd",
}


@pytest.mark.parametrize(("words", "name"), PROGRAM.items())
def test_commands_of_the_program_refuse(words, name, recording, tmp_path):
    if words.startswith("view"):
        pytest.importorskip("rerun")
    words = words.format(capture=recording, folder=tmp_path)
    with held_by_another(tmp_path / name) as refused:
        assert refused in mistake(*words.split(), str(tmp_path / name))
    assert not (tmp_path / name).exists()


def test_files_are_locked_together_and_freed_together(tmp_path: Path) -> None:
    outputs = [Output(tmp_path / "new" / each, "notes") for each in ("one", "two")]
    with output_files(outputs):
        assert (tmp_path / "new" / ".two.lock").exists()
    assert not list(tmp_path.iterdir())
    with ExitStack() as others:
        others.enter_context(held(tmp_path / "new" / ".two.lock"))
        with pytest.raises(InputError, match="two: process 123"), output_files(outputs):
            pass
        assert not (tmp_path / "new" / ".one.lock").exists()


@pytest.mark.parametrize("name", SINKS)
def test_what_a_killed_run_left_is_replaced_by_the_next(name, recording, tmp_path):
    """What it had not flushed is lost."""
    path = tmp_path / name
    child = os.fork()
    if child == 0:
        killed = sink_to(str(path))
        reception = Reception(Script(*messages(read_capture(recording))), recorders=[killed.frame])
        loop = Loop(reception, results=[killed.result], states=[killed.state])
        with killed.ready():
            reception.run()
            loop.run()
            os._exit(9)
    os.waitpid(child, 0)
    assert main(["live", str(recording), "--to", str(path), "--quiet"]) == 0
    assert count(path) == FRAMES

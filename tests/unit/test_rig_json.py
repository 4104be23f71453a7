"""Each of the rig's commands tells programs what it has done, or what is wrong."""

import json

import numpy as np
import pytest

from reconstruction import read_capture, write_capture
from reconstruction.cli import COMMANDS, main
from reconstruction.cli.others import OTHERS
from streams import film


@pytest.fixture
def path(capture, tmp_path):
    write_capture(film(capture, 3), tmp_path / "flight.h5")
    return tmp_path / "flight.h5"


def reported(capsys, *arguments):
    """The one object that a command prints."""
    assert main([*map(str, arguments), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.parametrize("command", [*COMMANDS, *OTHERS])
def test_every_command_has_the_option(command, capsys):
    with pytest.raises(SystemExit, match="0"):
        main([command, "--help"])
    assert "--json" in capsys.readouterr().out


def test_import(tmp_path, capsys):
    np.save(tmp_path / "a.npy", np.random.default_rng(0).poisson(900, (2, 64)))
    new = tmp_path / "new.h5"
    report = reported(capsys, "import", tmp_path / "a.npy", "--shape", "8x8", "-o", new)
    assert report.pop("warnings")
    assert report == {
        "written": str(new),
        "frames": 2,
        "shape": [8, 8],
        "exposures": 64,
        "order": "natural",
        "time_of_flight": None,
    }
    np.save(tmp_path / "t.npy", 1.0 + np.arange(16).reshape(4, 4))
    taps = ["--taps", tmp_path / "t.npy", "--frequency", "20e6"]
    report = reported(capsys, "import", *taps, "-o", new)
    assert (report["exposures"], report["shape"], report["time_of_flight"]) == (0, None, "cw")


def test_export(path, tmp_path, capsys):
    out = tmp_path / "clouds"
    report = reported(capsys, "export", path, "-o", out, "--format", "pcd")
    assert report == {"written": str(out), "frames": 3}


def test_replay_and_live(path, tmp_path, capsys):
    stream, copy = tmp_path / "flight.stream", tmp_path / "copy.h5"
    report = reported(capsys, "replay", path, "--to", stream, "--times", 2)
    assert report == {"to": str(stream), "frames": 6}
    report = reported(capsys, "live", stream, "--to", copy, "--image", "zero-filled", "--quiet")
    assert (report["received"], report["reconstructed"], report["lost"]) == (6, 6, 0)
    assert report["sinks"] == {str(copy): {"lost": 0, "dropped": 0}}
    assert read_capture(copy).frames == 6


@pytest.mark.parametrize("command", ["live", "replay"])
def test_two_things_do_not_go_to_standard_output(path, capsys, command):
    assert main([command, str(path), "--to", "-", "--json"]) == 2
    assert "both write to standard output" in json.loads(capsys.readouterr().out)["error"]

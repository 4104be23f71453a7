"""What all commands have in common: version, errors of one line, tables of any width, Tab."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

import spisim as spisim_library
from commands import spisim
from reconstruction import Capture, write_capture
from reconstruction.base.text import shortened
from reconstruction.cli import main as rig
from scenefiles import MINIMAL
from spisim.version import __version__
from spisim_app.cli import app, complete
from spisim_app.cli.inputs import scene_with
from spisim_app.cli.weather_options import Weather
from spisim_app.report.capture import write_report


def test_versions_are_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert spisim("--version").stdout == f"spisim {__version__}\n"
    with pytest.raises(SystemExit, match="0"):
        rig(["--version"])
    assert capsys.readouterr().out == f"spisim-reconstruct {__version__}\n"


@pytest.mark.parametrize(
    ("arguments", "reported"),
    [
        ("simulate warehouse -o c.h5 --spp x", "x is not a whole number"),
        ("simulate warehouse", "Missing option '--output'"),
        ("simulate warehose -o c.h5", "did you mean 'warehouse'"),
        ("scenes shwo", "No such command 'shwo'"),
        ("dataset status nowhere", "nowhere"),
        ("materials brik", "unknown material 'brik': did you mean 'brick'"),
    ],
)
def test_an_error_is_one_line_and_with_json_an_object_too(arguments: str, reported: str) -> None:
    run = spisim(*arguments.split())
    assert (run.exit_code, run.stdout) == (2, "")
    assert run.stderr.startswith("error: ")
    assert run.stderr.count("\n") == 1
    assert reported in run.stderr
    run = spisim(*arguments.split(), "--json")
    report = json.loads(run.stdout)
    assert report["status"] == run.exit_code == 2
    if "No such" not in reported:
        assert reported in report["error"]


@pytest.mark.parametrize(
    ("arguments", "reported"),
    [
        ("c.h5 -o r --frame x", "argument --frame: invalid int value: 'x'"),
        ("c.h5", "the following arguments are required: -o/--output"),
        ("nowhere.h5 -o r", "nowhere.h5: no such capture file"),
    ],
)
def test_the_rig_tells_errors_alike(
    arguments: str, reported: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="2"):
        raise SystemExit(rig([*arguments.split(), "--json"]))
    out, error = capsys.readouterr()
    assert error.startswith("error: ")
    assert error.count("\n") == 1
    assert reported in error
    assert reported in json.loads(out)["error"]


@pytest.mark.parametrize("arguments", ["materials {}", "doctor --{}", "simulate {} -o c.h5"])
def test_what_is_wrong_is_told_in_a_few_words_however_long_it_is(arguments: str) -> None:
    run = spisim(*arguments.format("a" * 70_000).split(), "--json")
    assert run.exit_code == 2
    assert "a" * 100 in run.stderr
    assert len(run.stderr) < 1000
    assert len(run.stdout) < 1000


def test_the_rig_does_not_echo_endless_names(capsys: pytest.CaptureFixture[str]) -> None:
    assert rig(["a" * 70_000, "-o", "r"]) == 2
    assert "a" * 100 in (messages := capsys.readouterr().err)
    assert len(messages) < 1000


def test_of_an_endless_message_beginning_and_end_are_told() -> None:
    reported = shortened(f"first {'word ' * 10_000} last")
    assert len(reported) < 5000
    assert reported.startswith("first word")
    assert reported.endswith("word  last")
    assert shortened("as it is") == "as it is"


@pytest.mark.parametrize("command", ["budget paper", "materials", "scenes list targets"])
def test_a_table_loses_nothing_on_40_columns(command: str) -> None:
    wide = CliRunner().invoke(app, command.split(), env={"COLUMNS": "300"}).stdout
    narrow = CliRunner().invoke(app, command.split(), env={"COLUMNS": "40"}).stdout
    assert "…" not in narrow
    lost = set(wide.replace(",", " ").split()) - set(
        narrow.replace(",", " ").replace(":", "").split()
    )
    assert not {word for word in lost if word[0].isdigit()}
    assert {"reflectance"} & set(narrow.split()) or "parameter" in narrow


def test_what_goes_into_a_file_is_as_wide_as_it_needs(tmp_path: Path) -> None:
    """Of standard output that is no terminal, nothing is cut off either."""
    from rich.console import Console

    from spisim_app.cli import tables

    table = tables.plain_table("first", *(f"column-{n}" for n in range(20)))
    table.add_row("row", *(f"value-{n}" for n in range(20)))
    with (tmp_path / "out").open("w") as file, pytest.MonkeyPatch.context() as patch:
        patch.delenv("COLUMNS", raising=False)
        patch.setattr(tables, "results", Console(file=file, width=80))
        tables.print_table(table)
    head, row = (tmp_path / "out").read_text().splitlines()
    assert head.split()[1:] == [f"column-{n}" for n in range(20)]
    assert row.split()[1:] == [f"value-{n}" for n in range(20)]


def test_the_rigs_table_is_told_row_by_row_where_it_is_narrow(
    capture: Capture,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    write_capture(capture, tmp_path / "c.h5")
    monkeypatch.setenv("COLUMNS", "40")
    arguments = [str(tmp_path / "c.h5"), "-o", str(tmp_path / "r"), "--image", "zero-filled"]
    assert rig(arguments) == 0
    messages = capsys.readouterr().out
    assert "cw: spot 3\n  range / m: 4.800\n" in messages


def test_a_shell_completes_commands_and_names() -> None:
    env = {
        "_SPISIM_COMPLETE": "complete_bash",
        "COMP_WORDS": "spisim simulate ware",
        "COMP_CWORD": "2",
    }
    assert CliRunner().invoke(app, [], prog_name="spisim", env=env).stdout.split() == ["warehouse"]


def test_files_of_the_user_are_completed_beside_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "warm").mkdir()
    for name in ("wares.yaml", "warm/up.yaml", "ware.txt"):
        (tmp_path / name).touch()
    assert complete.scenes("war") == ["warehouse", "wares.yaml", "warm/"]
    assert complete.scenes("warm/") == ["warm/up.yaml"]
    assert "paper" in complete.instruments("p")
    assert complete.studies("fog-and") == ["fog-and-rain"]
    assert complete.materials("brick-d") == ["brick-dark"]
    assert complete.scenes("nowhere/x") == []


def test_materials_are_listed_with_their_sources() -> None:
    listed = json.loads(spisim("materials", "--json", "--wavelength", "905").stdout)
    rows = {row["name"]: row for row in listed["materials"]}
    assert listed["wavelength_nm"] == 905
    assert rows["brick"]["reflectance"] == 0.24
    assert rows["brick"]["bsdf"] == "diffuse"
    assert "source" in rows["brick"]
    assert "fired clay" in spisim("materials", "brick").stdout


def test_snow_and_smoke_take_the_place_of_the_scenes_own(tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(MINIMAL)
    scene, _ = scene_with(str(tmp_path / "s.yaml"), 1550.0, Weather(snow=2.0, smoke=30.0))
    kinds = [medium["kind"] for medium in scene.media_summary()]
    assert "fog-machine" in " ".join(kinds)
    assert "snow" in " ".join(kinds)


def test_a_spot_that_is_too_faint_is_named_with_what_it_lies_on(tmp_path: Path) -> None:
    text = MINIMAL + "materials: {soot: {reflectance: 0.0001, source: test}}\n"
    (tmp_path / "s.yaml").write_text(text.replace("material: concrete", "material: soot"))
    run = spisim("scenes", "show", tmp_path / "s.yaml", "-o", tmp_path / "s.png", "--json")
    lost = json.loads(run.stdout)["lost"]
    assert lost
    assert all("is too faint" in why and "(soot)" in why for why in lost.values())


def test_an_interrupt_that_a_library_has_wrapped_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    def wrapped(*_: object) -> None:
        raise SystemError("returned a result with an exception set") from KeyboardInterrupt()

    monkeypatch.setattr("spisim.scene.materials.material_table", wrapped)
    run = spisim("materials")
    assert (run.exit_code, run.stderr) == (
        130,
        "error: interrupted; no file is left half-written\n",
    )


WITHOUT = """
import importlib.abc, sys
class Without(importlib.abc.MetaPathFinder):
    def find_spec(self, name, *_):
        if name == sys.argv[1]:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Without())
"""
PROGRAM = "from spisim.__main__ import main; main()"
REPORT = "import spisim; spisim.load_scene; spisim.write_report"
MISSING = (
    "the commands and pages that come with spisim are missing; reinstall it: pip install spisim\n"
)


@pytest.mark.parametrize(
    ("gone", "code", "status", "reported"),
    [
        ("spisim_app", PROGRAM, 2, f"error: {MISSING}"),
        ("spisim_app", REPORT, 1, f"InputError: {MISSING}"),
        ("spisim_app.cli", PROGRAM, 1, "ModuleNotFoundError: No module named 'spisim_app.cli'\n"),
    ],
)
def test_the_library_says_what_to_install_if_its_program_is_missing(
    gone: str, code: str, status: int, reported: str
) -> None:
    run = subprocess.run(
        [sys.executable, "-c", WITHOUT + code, gone], capture_output=True, text=True, check=False
    )
    assert (run.returncode, run.stdout) == (status, "")
    assert run.stderr.endswith(reported)
    assert ("Traceback" in run.stderr) == (status == 1)


def test_the_library_writes_the_programs_report() -> None:
    assert spisim_library.write_report is write_report

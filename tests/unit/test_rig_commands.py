"""Commands that other packages add to those of the rig, by entry points."""

import json
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from plugins import install
from reconstruction.cli import COMMANDS, completion, main
from reconstruction.cli.others import OTHERS

SOURCE = """
SUMMARY = "a name -> a greeting"
EXAMPLE = "python -m reconstruction greet World"

def add_options(parser):
    parser.add_argument("whom")

def run(options):
    print("hello", options.whom)

import sys
greet = sys.modules[__name__]
"""
ENTRIES = {
    "reconstruction.commands": {
        "greet": "polite:greet",
        "broken": "polite:missing",
        "absent": "nowhere:greet",
    }
}


def run(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """A command in an installation that has the other package too."""
    install(folder, "polite", ENTRIES, SOURCE)
    code = (
        f"import sys; sys.path.insert(0, {str(folder)!r}); "
        "from reconstruction.cli import main; sys.exit(main(sys.argv[1:]))"
    )
    return subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=False
    )


def test_a_command_of_another_package_runs(tmp_path: Path) -> None:
    done = run(tmp_path, "greet", "you")
    assert (done.returncode, done.stdout, done.stderr) == (0, "hello you\n", "")


def test_a_wrong_argument_of_it_is_an_error_of_one_line(tmp_path: Path) -> None:
    done = run(tmp_path, "greet", "--json")
    assert done.returncode == 2
    assert "the following arguments are required: whom" in json.loads(done.stdout)["error"]


@pytest.mark.parametrize(
    ("name", "why"), [("broken", "has no attribute 'missing'"), ("absent", "No module named")]
)
def test_one_that_cannot_be_loaded_is_named_when_called(
    name: str, why: str, tmp_path: Path
) -> None:
    done = run(tmp_path, name)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"error: command {name!r} of polite (")
    assert why in done.stderr
    assert done.stderr.count("\n") == 1


def test_help_lists_all_and_names_those_that_cannot_be_loaded(tmp_path: Path) -> None:
    done = run(tmp_path, "--help")
    assert done.returncode == 0
    words = done.stdout.split()
    assert {*COMMANDS, "live", "replay", "greet"} <= set(words)
    assert "a name -> a greeting" in done.stdout
    assert not {"broken", "absent"} & set(words)
    first, second = done.stderr.splitlines()
    assert first.startswith("warning: command 'absent' of polite (nowhere:greet) cannot be loaded")
    assert second.startswith("warning: command 'broken' of polite")


def test_completion_knows_all_commands_and_their_options(monkeypatch: pytest.MonkeyPatch) -> None:
    parsers = []
    fake = SimpleNamespace(autocomplete=lambda parser: parsers.append(parser) or sys.exit(0))
    monkeypatch.setitem(sys.modules, "argcomplete", fake)
    monkeypatch.setenv(completion.VARIABLE, "1")
    with pytest.raises(SystemExit, match="0"):
        main([])
    (parser,) = parsers
    for command, option in (("import", "--shape"), ("live", "--follow"), ("replay", "--rate")):
        commands = parser._subparsers._group_actions[0].choices
        assert option in commands[command].format_help()


def test_streams_are_loaded_by_their_commands_alone(tmp_path: Path) -> None:
    assert set(OTHERS) >= {"live", "replay"}
    for arguments, loaded in (
        (["nowhere.h5", "-o", "new"], False),
        (["check", "nowhere.h5"], False),
        (["live", "nowhere.stream"], True),
    ):
        code = (
            f"import sys; from reconstruction.cli import main; assert main({arguments!r}) == 2; "
            "print('spisim_live' in sys.modules)"
        )
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path
        )
        assert done.stdout == f"{loaded}\n", done.stderr

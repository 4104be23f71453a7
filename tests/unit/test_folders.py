"""Folders that one program at a time writes into."""

import subprocess
import sys
import threading
from pathlib import Path

import pytest

from holders import held
from reconstruction.base.errors import InputError
from reconstruction.base.files import Output
from reconstruction.base.folders import holder, locked_folder, locked_name, output_folder

HOLDS = """
import sys, time
from reconstruction.base.folders import locked_folder
with locked_folder(sys.argv[1]):
    print(flush=True)
    sys.stdin.read()
"""


def test_a_folder_is_held_by_one_process_until_it_dies(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    with subprocess.Popen(
        [sys.executable, "-c", HOLDS, folder], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as other:
        assert other.stdout is not None
        other.stdout.readline()
        refused = rf"out: process {other.pid} on \S+ is writing into it; wait for it or end it"
        with pytest.raises(InputError, match=refused), locked_folder(folder):
            pass
        other.kill()
    assert (folder / ".lock").exists()
    assert holder(folder / ".lock") is None
    with locked_folder(folder):
        assert holder(folder / ".lock")
        (folder / "result").touch()
    assert [path.name for path in folder.iterdir()] == ["result"]


def test_what_is_called_by_the_holder_holds_it_too_but_no_other_thread(tmp_path: Path) -> None:
    refused: list[str] = []

    def other() -> None:
        try:
            with locked_folder(tmp_path / "out"):
                pass
        except InputError as error:
            refused.append(str(error))

    with locked_folder(tmp_path / "out"):
        with locked_folder(tmp_path / "out"):
            pass
        thread = threading.Thread(target=other)
        thread.start()
        thread.join()
    assert len(refused) == 1
    other()
    assert len(refused) == 1


def test_a_new_folder_that_stays_empty_is_removed(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no"), locked_folder(tmp_path / "a" / "b"):
        raise InputError("no")
    assert not list(tmp_path.iterdir())


def test_an_empty_lock_of_somebody_else_stays(tmp_path: Path) -> None:
    (tmp_path / ".lock").touch()
    with locked_folder(tmp_path):
        pass
    assert (tmp_path / ".lock").read_bytes() == b""


def test_a_name_is_held_beside_it(tmp_path: Path) -> None:
    with held(tmp_path / ".cloud.lock"):
        with pytest.raises(InputError, match="cloud: process 123"), locked_name(tmp_path / "cloud"):
            pass
        with locked_name(tmp_path / "other"):
            assert (tmp_path / ".other.lock").exists()
    assert not list(tmp_path.iterdir())


def test_what_killed_runs_had_not_finished_is_removed_and_nothing_else(tmp_path: Path) -> None:
    ours = [".flight.gif.0123abcd.tmp", "plots/.a.svg.0123abcd.tmp"]
    others = [".flight.gif.tmp", ".notes.0123abcd.tmp", "flight.gif.0123abcd.tmp", "plots/a.svg"]
    for name in (*ours, *others):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    (tmp_path / ".flight.gif.ffffffff.tmp").symlink_to(tmp_path / "plots/a.svg")
    outputs = [Output(tmp_path / "flight.gif", "flight"), Output(tmp_path / "plots/a.svg", "study")]
    with output_folder(tmp_path, outputs, overwrite=True):
        assert not any((tmp_path / name).exists() for name in ours)
        assert all((tmp_path / name).exists() for name in others)
        assert (tmp_path / ".flight.gif.ffffffff.tmp").is_symlink()

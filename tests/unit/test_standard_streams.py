"""Programs whose output is not read to its end or does not fit, and that are ended as they load."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from reconstruction import Capture, InputError, write_capture
from reconstruction.base.errors import naming

RIG = "import sys; from reconstruction.cli import main; sys.exit(main())"
SPISIM = "from spisim_app.cli import main; main()"
FULL = Path("/dev/full")
BUFFERED = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
LOADING = """
import importlib.abc, os, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in the background of a shell
class Interrupt(importlib.abc.MetaPathFinder):
    def find_spec(self, name, *_):
        if name == "spisim_app.cli":
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Interrupt())
from spisim.__main__ import main
main()
"""


@pytest.fixture(scope="module")
def file(capture: Capture, tmp_path_factory: pytest.TempPathFactory) -> str:
    """A capture."""
    path = tmp_path_factory.mktemp("streams") / "c.h5"
    write_capture(capture, path)
    return str(path)


def _unread(code: str, *arguments: str) -> tuple[int, str]:
    """Status and stderr of a program of whose output nothing is read."""
    with subprocess.Popen(
        [sys.executable, "-c", code, *arguments],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=BUFFERED,
    ) as process:  # fmt: skip
        assert process.stdout
        assert process.stderr
        process.stdout.close()
        reported = process.stderr.read().decode()
    return process.returncode, reported


def test_who_stops_reading_is_told_nothing(file: str, tmp_path: Path) -> None:
    assert _unread(RIG, file, "-o", str(tmp_path / "r")) == (1, "")
    assert _unread(RIG, "replay", file, "--to", "-", "--rate", "inf", "--times", "99") == (1, "")
    assert _unread(SPISIM, "schema", "plan") == (1, "")


def test_an_error_is_told_though_nobody_reads_its_object(file: str) -> None:
    status, reported = _unread(RIG, "check", file, "--json")
    assert status == 2
    assert reported.count("\n") == 1
    assert reported.startswith(f"error: {file}: spots/detector_axes is unknown")


@pytest.mark.skipif(not FULL.exists(), reason="no device that is always full")
@pytest.mark.parametrize(("code", "words"), [(RIG, "-o {folder}"), (SPISIM, "--json")])
def test_output_that_does_not_fit_is_an_error(
    code: str, words: str, file: str, tmp_path: Path
) -> None:
    verb = ["reconstruct"] if code is RIG else ["evaluate"]
    words = words.format(folder=tmp_path / "r")
    with FULL.open("w") as full:
        run = subprocess.run(
            [sys.executable, "-c", code, *verb, file, *words.split()],
            stdout=full, stderr=subprocess.PIPE, text=True, check=False, env=BUFFERED,
        )  # fmt: skip
    assert run.returncode == 2
    assert run.stderr == "error: standard output: No space left on device\n"


def test_an_interrupt_while_the_program_loads_ends_it_without_a_word() -> None:
    run = subprocess.run([sys.executable, "-c", LOADING], capture_output=True, check=False)
    assert (run.returncode, run.stderr) == (-signal.SIGINT, b"")


def test_a_file_is_named_once() -> None:
    for reported in ("c.h5: no such capture file", "c.h5 is a folder"):
        with pytest.raises(InputError, match=f"^{reported}$"), naming("c.h5"):
            raise InputError(reported)
    with pytest.raises(InputError, match=r"^c\.h5: frame 1"), naming("c.h5"):
        raise InputError("frame 1")


def test_an_ignored_interruption_stays_ignored(monkeypatch: pytest.MonkeyPatch) -> None:
    """As in the background of a shell; else Ctrl-C ends what is loading, and then a command."""
    from spisim.__main__ import main

    during: list[object] = []

    class Program:
        @staticmethod
        def main() -> None:
            during.append(signal.getsignal(signal.SIGINT))

    def load(name: str) -> type[Program]:
        during.append(signal.getsignal(signal.SIGINT))
        return Program

    monkeypatch.setattr("spisim.__main__.import_app", load)
    before = signal.getsignal(signal.SIGINT)
    try:
        for handler in (signal.SIG_IGN, signal.default_int_handler):
            signal.signal(signal.SIGINT, handler)
            main()
    finally:
        signal.signal(signal.SIGINT, before)
    ignored, own = signal.SIG_IGN, signal.default_int_handler
    assert during == [ignored, ignored, signal.SIG_DFL, own]

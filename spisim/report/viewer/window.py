"""The viewer's window: a program of Rerun that listens to this machine alone."""

import subprocess
import sys
import time
from contextlib import suppress
from socket import create_connection
from tempfile import TemporaryFile
from typing import IO

from reconstruction.base.errors import InputError

#: Rerun's own: a window that is open there takes further recordings.
PORT = 9876
#: Without it Rerun listens on all interfaces, so that everyone in the network can send to it.
LOOPBACK = "127.0.0.1"
#: Beside the library, whether or not PATH has it.
PROGRAM = (sys.executable, "-m", "rerun_cli")
#: For a window to open; and for one to fail that listens already.
OPENS_S, FAILS_S = 60.0, 1.0


def open_window(port: int = PORT) -> str:
    """Open the viewer, unless it is open; the address that takes recordings.

    Raises InputError, with what Rerun says, where it cannot be opened.
    """
    if not _listens(port):
        with TemporaryFile() as said:
            process = subprocess.Popen(
                command(port),
                stdin=subprocess.DEVNULL,
                stdout=said,
                stderr=said,
                start_new_session=True,  # it outlives this program, and its Ctrl-C
            )
            _wait(process, port, said)
    return f"rerun+http://{LOOPBACK}:{port}/proxy"


def command(port: int) -> list[str]:
    """The program and its arguments."""
    return [*PROGRAM, "--bind", LOOPBACK, "--port", str(port), "--expect-data-soon"]


def _wait(process: subprocess.Popen[bytes], port: int, said: IO[bytes]) -> None:
    end = time.monotonic() + OPENS_S
    while not _listens(port) and process.poll() is None and time.monotonic() < end:
        time.sleep(0.05)
    with suppress(subprocess.TimeoutExpired):
        process.wait(FAILS_S)
        said.seek(0)
        raise InputError(
            f"the viewer cannot be opened: {_reason(said.read().decode(errors='replace'))}; --save "
            "FILE.rrd writes a recording, and `rerun FILE.rrd` opens it elsewhere"
        )


def _listens(port: int) -> bool:
    with suppress(OSError), create_connection((LOOPBACK, port), timeout=1.0):
        return True
    return False


def _reason(said: str) -> str:
    """What Rerun says went wrong; its last words where none of them says so."""
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    errors = [line.removeprefix("Error: ") for line in lines if line.startswith("Error: ")]
    return (errors or lines or ["it ended without a word"])[-1]

"""The viewer's window: a Rerun process that listens on this machine only."""

import subprocess
import sys
import time
from contextlib import suppress
from socket import create_connection
from tempfile import TemporaryFile
from typing import IO

from reconstruction.base.errors import InputError

#: Rerun's default port; a window open there accepts further recordings.
PORT = 9876
#: By default Rerun listens on all interfaces, open to everyone in the network.
LOOPBACK = "127.0.0.1"
#: Beside the library, because PATH may lack it.
PROGRAM = (sys.executable, "-m", "rerun_cli")
#: Time limits for a window to open, and for one to fail on an occupied port.
OPENS_S, FAILS_S = 60.0, 1.0


def open_window(port: int = PORT) -> str:
    """Open the viewer unless it is open; return the address that accepts recordings.

    Raises InputError, with Rerun's message, if it cannot be opened.
    """
    if not _listens(port):
        with TemporaryFile() as said:
            process = subprocess.Popen(
                command(port),
                stdin=subprocess.DEVNULL,
                stdout=said,
                stderr=said,
                start_new_session=True,  # it outlives this program and ignores its Ctrl-C
            )
            _wait(process, port, said)
    return f"rerun+http://{LOOPBACK}:{port}/proxy"


def command(port: int) -> list[str]:
    """Return the program and its arguments."""
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
    """Return Rerun's error message, or else its last line."""
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    errors = [line.removeprefix("Error: ") for line in lines if line.startswith("Error: ")]
    return (errors or lines or ["it ended without a message"])[-1]

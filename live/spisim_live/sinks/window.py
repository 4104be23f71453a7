"""Window with the latest result, in a separate process so that drawing delays no frame."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from reconstruction.base.errors import InputError

from ..framing import Kind, Message, pack
from ..results import Outcome, State, result_entries, state_entries
from ..tables import packed
from .sink import Sink

READY = "ready"


class WindowSink(Sink):
    """Sends results to the drawing process; raises InputError if there can be no window."""

    waiting = 2
    skips = True

    def __init__(self, program: list[str] | None = None) -> None:
        self._program = program or [sys.executable, "-m", "spisim_live.drawing"]
        self._process: subprocess.Popen[bytes] | None = None

    @contextmanager
    def ready(self) -> Iterator[None]:
        self._process = subprocess.Popen(
            self._program, stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        assert self._process.stdout is not None
        reply = self._process.stdout.readline().decode(errors="replace").strip()
        if reply != READY:
            self._process.communicate()
            raise InputError(f"window: {reply or 'it cannot be opened'}")
        yield

    def result(self, outcome: Outcome) -> None:
        payload = packed(result_entries(outcome))
        self._send(Message(Kind.RESULT, payload, outcome.result.frame, outcome.time_ns))

    def state(self, state: State) -> None:
        self._send(Message(Kind.STATUS, packed(state_entries(state))))

    def abandon(self) -> None:
        if self._process is not None and self._process.poll() is None:
            self._process.terminate()

    def _send(self, message: Message) -> None:
        process = self._process
        assert process is not None
        if process.poll() is not None:
            return  # closed by the user
        assert process.stdin is not None
        process.stdin.write(pack(message))
        process.stdin.flush()

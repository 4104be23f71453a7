"""The latest result in a folder."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from reconstruction.base.files import Output, mark, write_atomically
from reconstruction.base.folders import output_folder
from reconstruction.base.text import json_line
from reconstruction.outputs import outputs_in, write_outputs

from ..results import Outcome, State
from .lines import state_report
from .sink import Sink

EVERY_S = 1.0
STATE, KIND = "state.json", "state of a stream"


class LatestResult(Sink):
    """Writes the files of a reconstruction and the state once a second, each file whole."""

    waiting = 2
    skips = True

    def __init__(
        self,
        folder: Path,
        read: Sequence[Path] = (),
        *,
        overwrite: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._folder = folder
        self._read = read
        self._overwrite = overwrite
        self._clock = clock
        self._written_s = -float("inf")
        self._latest: Outcome | None = None

    @contextmanager
    def ready(self) -> Iterator[None]:
        outputs = [*outputs_in(self._folder), Output(self._folder / STATE, KIND)]
        with output_folder(self._folder, outputs, self._read, overwrite=self._overwrite):
            yield

    def result(self, outcome: Outcome) -> None:
        self._latest = outcome
        now_s = self._clock()
        if now_s - self._written_s >= EVERY_S:
            self._written_s = now_s
            self._write()

    def state(self, state: State) -> None:
        report = {"made": mark(KIND), **state_report(state)}
        write_atomically(self._folder / STATE, json_line(report).encode() + b"\n")

    def close(self) -> None:
        self._write()

    def _write(self) -> None:
        if self._latest is not None:
            write_outputs(self._latest.result, self._latest.stream, self._folder)
            self._latest = None

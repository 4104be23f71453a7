"""Results as ROS 2 messages in an MCAP file."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from reconstruction.base.files import Output, begun
from reconstruction.base.folders import output_files
from reconstruction.exports import Shot
from reconstruction.exports.export import KIND

from ..results import Outcome, State
from ..ros.mcap import EXPORT
from ..ros.mcap_file import McapFile
from ..ros.messages import state_message
from ..setups import StreamSetup
from .sink import Sink

MAX_STAMP_NS = 2**31 * 10**9
"""ROS stamps have 32-bit seconds: 2038."""


class McapRecord(Sink):
    """Logs by this machine's clock, with the sender's stamps if ROS can represent them."""

    def __init__(
        self,
        path: Path,
        read: Sequence[Path] = (),
        *,
        overwrite: bool = False,
        clock_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self._path = path
        self._read = read
        self._overwrite = overwrite
        self._clock_ns = clock_ns
        self._file: McapFile | None = None
        self._stream: StreamSetup | None = None
        self._before: Mapping[str, Any] | None = None
        self._last_ns = 0

    @contextmanager
    def ready(self) -> Iterator[None]:
        EXPORT.check()
        output = Output(self._path, KIND, (EXPORT.suffix,))
        with output_files([output], self._read, overwrite=self._overwrite):
            yield

    def result(self, outcome: Outcome) -> None:
        now_ns = self._now_ns()
        setup = outcome.stream.setup
        stamped = 0 < outcome.time_ns < MAX_STAMP_NS
        shot = Shot.of(outcome.result, setup, outcome.time_ns if stamped else now_ns)
        begins = outcome.stream is not self._stream
        self._stream = outcome.stream
        self._opened().write_frame(shot, now_ns, begins=begins)

    def state(self, state: State) -> None:
        now_ns = self._now_ns()
        self._opened().write([state_message(now_ns, state.numbers, self._before)], now_ns)
        self._before = state.numbers

    def close(self) -> None:
        if self._file is not None:
            self._file.close()

    def _opened(self) -> McapFile:
        if self._file is None:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            with begun(self._path) as name:
                self._file = McapFile(name)
        return self._file

    def _now_ns(self) -> int:
        """Current time, never before the last one, however the clock is set."""
        self._last_ns = max(self._clock_ns(), self._last_ns)
        return self._last_ns

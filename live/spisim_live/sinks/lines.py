"""A JSON object per result, and per state."""

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np

from reconstruction.base.files import Output, begun, mark
from reconstruction.base.folders import output_files
from reconstruction.base.text import json_line

from ..results import Outcome, State
from .sink import Sink

KIND = "results of a stream"


class JsonLines(Sink):
    """Lines of text with the numbers of a frame, without images."""

    def __init__(self, opened: Callable[[], IO[str]]) -> None:
        self._opened = opened
        self._file: IO[str] | None = None

    def result(self, outcome: Outcome) -> None:
        self._write(result_report(outcome))

    def state(self, state: State) -> None:
        self._write({"state": state_report(state)})

    def close(self) -> None:
        if self._file not in (None, sys.stdout):
            self._file.close()

    def _write(self, report: dict[str, Any]) -> None:
        if self._file is None:
            with self._begun() as file:
                file.write(json_line({"made": mark(KIND)}) + "\n")
                file.flush()
            self._file = file
        self._file.write(json_line(report) + "\n")
        self._file.flush()

    @contextmanager
    def _begun(self) -> Iterator[IO[str]]:
        yield self._opened()


class LinesFile(JsonLines):
    """The same in a file."""

    def __init__(self, path: Path, read: Sequence[Path] = (), *, overwrite: bool = False) -> None:
        self._path = path
        self._read = read
        self._overwrite = overwrite
        self._file = None

    @contextmanager
    def ready(self) -> Iterator[None]:
        with output_files([Output(self._path, KIND)], self._read, overwrite=self._overwrite):
            yield

    @contextmanager
    def _begun(self) -> Iterator[IO[str]]:
        with begun(self._path) as name:
            yield name.open("w", encoding="ascii")


def result_report(outcome: Outcome) -> dict[str, Any]:
    """Numbers of a result; null where there is none."""
    result = outcome.result
    report: dict[str, Any] = {
        "frame": result.frame,
        "time_ns": outcome.time_ns,
        "latency_s": outcome.latency_s,
    }
    if result.ranges is not None:
        report["range_m"] = [_number(value) for value in result.ranges.range_m]
        report["range_sigma_m"] = [_number(value) for value in result.ranges.sigma_m]
        report["range_status"] = list(result.ranges.status)
    if result.visibility is not None:
        report["visibility"] = result.visibility.numbers
    if result.obstacle_m is not None:
        report["obstacle_m"] = _number(result.obstacle_m)
    depth_m = result.depth_m
    if depth_m is not None and np.isfinite(depth_m).any():
        report["nearest_m"] = float(np.nanmin(depth_m))
        report["median_m"] = float(np.nanmedian(depth_m))
    return report


def state_report(state: State) -> dict[str, Any]:
    """Numbers of the state; null where unknown."""
    return {name: _number(value) for name, value in state.numbers.items()}


def _number(value: Any) -> Any:
    if isinstance(value, int | str):
        return value
    return float(value) if np.isfinite(value) else None

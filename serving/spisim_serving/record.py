"""Record of what is sent: captures with their truth and poses, and the flown path."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path

from reconstruction.base.files import Output, write_atomically
from reconstruction.base.folders import output_files
from reconstruction.capture import Provenance
from spisim.simulation.flight import FlightRecorder, Motion, Shot, flown
from spisim.simulation.flight.recording import FLOWN_PATH, SEGMENT
from spisim_live.sinks.records import BYTES_OF_A_PART, FRAMES_BETWEEN, FRAMES_OF_A_PART, part_of


class FlightRecord:
    """Captures of successive frames, each whole at any time, and beside each the path flown.

    The first has the given name, further ones add a number, as captures of `live`.

    Parameters
    ----------
    path
        First capture.
    recorder
        Returns the recorder of a capture.
    plans
        Number of pattern plans that take turns; each capture begins with the first.
    read, overwrite
        Files that are never replaced, and whether files of others may be.
    """

    def __init__(
        self,
        path: Path,
        recorder: Callable[[Path], FlightRecorder],
        plans: int,
        read: Sequence[Path] = (),
        *,
        overwrite: bool = False,
    ) -> None:
        self._path = path
        self._make = recorder
        self._plans = plans
        self._read = read
        self._overwrite = overwrite
        self._written: list[Path] = []
        self._locked = ExitStack()
        self._capture: Path
        self._flown: Path
        self._recorder: FlightRecorder
        self._motions: list[Motion]
        self._full: bool
        self._begin()

    def add(self, shot: Shot) -> None:
        """Record a frame."""
        if self._full and self._recorder.frames % self._plans == 0:
            self._finish()
            self._begin()
        self._motions.append(shot.motion)
        self._recorder.add([shot])
        frames = self._recorder.frames
        if frames % (SEGMENT if frames < FRAMES_BETWEEN else FRAMES_BETWEEN) == 0:
            self._recorder.join()
            self._write_path()
            size_bytes = self._capture.stat().st_size
            self._full = frames >= FRAMES_OF_A_PART or size_bytes >= BYTES_OF_A_PART

    def finish(self, provenance: Provenance) -> list[Path]:
        """Write the rest, and return the names of all files; none without a frame."""
        if self._motions:
            self._finish(provenance)
        self._locked.close()
        return self._written

    def _begin(self) -> None:
        """Begin the next capture."""
        outputs = record_outputs(part_of(self._path, len(self._written) // 2))
        self._motions = []
        self._full = False
        self._locked.enter_context(output_files(outputs, self._read, overwrite=self._overwrite))
        self._capture, self._flown = (output.path for output in outputs)
        self._recorder = self._make(self._capture)
        self._recorder.discard()

    def _finish(self, provenance: Provenance | None = None) -> None:
        self._recorder.finish(provenance)
        self._write_path()
        self._written += [self._capture, self._flown]
        self._motions = []
        self._locked.close()

    def _write_path(self) -> None:
        write_atomically(self._flown, flown(self._motions).encode())


def record_outputs(path: Path) -> list[Output]:
    """The capture, and the path beside it."""
    capture = Output(path, "simulated capture", (".h5", ".hdf5"))
    return [capture, Output(path.parent / f"{path.stem}.csv", FLOWN_PATH)]

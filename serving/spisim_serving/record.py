"""Record of what is sent: a capture with its truth and poses, and the flown path."""

from __future__ import annotations

from pathlib import Path

from reconstruction.base.files import Output, write_atomically
from reconstruction.capture import Provenance
from spisim.simulation.flight import FlightRecorder, Motion, Shot, flown
from spisim.simulation.flight.recording import FLOWN_PATH


class FlightRecord:
    """Passes frames to a recorder, and writes the flown path beside its file."""

    def __init__(self, path: Path, recorder: FlightRecorder) -> None:
        self._path = path
        self._recorder = recorder
        self._recorder.discard()
        self._motions: list[Motion] = []

    def add(self, shot: Shot) -> None:
        """Record a frame."""
        self._motions.append(shot.motion)
        self._recorder.add([shot])

    def write(self, provenance: Provenance) -> list[Path]:
        """Write capture and path, and return their names; none without a frame."""
        if not self._motions:
            return []
        capture, path = (output.path for output in record_outputs(self._path))
        self._recorder.finish(provenance)
        write_atomically(path, flown(self._motions).encode())
        return [capture, path]


def record_outputs(path: Path) -> list[Output]:
    """The capture, and the path beside it."""
    capture = Output(path, "simulated capture", (".h5", ".hdf5"))
    return [capture, Output(path.parent / f"{path.stem}.csv", FLOWN_PATH)]

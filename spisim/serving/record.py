"""Record of a flight: a capture with its truth, and the flown path."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from reconstruction import write_capture
from reconstruction.base.files import Output, mark, write_atomically
from reconstruction.capture import Capture, Frames, Provenance, Setup, Truth
from reconstruction.capture.schema import joined
from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.scene.trajectory import FRAMES, POSES
from spisim.serving.camera import Shot
from spisim.serving.motion import Motion
from spisim.simulation.measurement import frame_truth
from spisim.transport import ground_truth

#: A few minutes, and a few hundred megabytes.
MAX_FRAMES = 32_768
KIND = "flown path"


class FlightRecord:
    """Holds frames, and the truth of some, until they are written.

    It is `full` after `MAX_FRAMES`, and drops what follows.

    Parameters
    ----------
    path
        Capture file; the flown path goes beside it.
    scene, instrument
        What is recorded, and by what.
    truths
        The truth of every so many frames is held.
    """

    def __init__(self, path: Path, scene: Scene, instrument: Instrument, truths: int) -> None:
        self.full = False
        self._path = path
        self._scene = scene
        self._instrument = instrument
        self._every = truths
        self._frames: list[Frames] = []
        self._motions: list[Motion] = []
        self._with_truth: list[Shot] = []

    @property
    def outputs(self) -> list[Output]:
        """Files that `write` writes."""
        return record_outputs(self._path)

    def add(self, shot: Shot) -> None:
        """Hold a frame."""
        self.full = len(self._frames) >= MAX_FRAMES
        if self.full:
            return
        if len(self._frames) % self._every == 0:
            self._with_truth.append(shot)
        self._frames.append(shot.frame)
        self._motions.append(shot.motion)

    def write(self, setup: Setup, provenance: Provenance) -> list[Path]:
        """Write capture and path, and return their names; none without a frame."""
        if not self._frames:
            return []
        capture, path = (output.path for output in self.outputs)
        write_capture(self._capture(setup, provenance), capture)
        write_atomically(path, flown(self._motions).encode())
        return [capture, path]

    def _capture(self, setup: Setup, provenance: Provenance) -> Capture:
        first = self._frames[0].first
        plans = [setup.plan_of(first + turn) for turn in range(len(setup.plans))]
        parts: dict[str, Any] = {
            name: None
            if getattr(self._frames[0], name) is None
            else joined([getattr(frame, name) for frame in self._frames])
            for name in ("buckets", "spots", "pattern_taps")
        }
        truths = []
        for shot in self._with_truth:
            middle = shot.motion.scene(self._scene, 0.5)
            truth = ground_truth(middle, self._instrument, subpixels=1)
            truths.append(frame_truth(shot.image, shot.image_error, truth))
        numbers = np.array([shot.number - first for shot in self._with_truth], np.int64)
        return Capture(
            plan=plans[0],
            following_plans=tuple(plans[1 : len(self._frames)]),
            optics=setup.optics,
            provenance=provenance,
            truth=replace(Truth.of(truths), frame=numbers),
            **parts,
        )


def record_outputs(path: Path) -> list[Output]:
    """The capture, and the path beside it."""
    capture = Output(path, "simulated capture", (".h5", ".hdf5"))
    return [capture, Output(path.parent / f"{path.stem}.csv", KIND)]


def flown(motions: list[Motion]) -> str:
    """Poses at the start of every frame and the end of the last, in a file for `load_trajectory`.

    Quaternions turn the drone's body into the world.
    """
    last = motions[-1]
    times_s = [motion.time_s for motion in motions] + [last.time_s + last.duration_s]
    positions_m = [motion.start_m for motion in motions] + [last.stop_m]
    optical = Rotation.concatenate([motion.start for motion in motions] + [last.stop])
    turns = (optical * FRAMES["body"].inv()).as_quat()
    rows = np.column_stack([times_s, positions_m, turns])
    lines = [f"# {mark(KIND)}", ",".join(POSES)]
    lines += [",".join(f"{value:.9g}" for value in row) for row in rows]
    return "\n".join(lines) + "\n"

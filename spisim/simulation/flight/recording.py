"""Recordings of flights: frames in segments, written as they come and joined at the end."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from reconstruction.base.errors import InputError
from reconstruction.base.files import mark, remove_unfinished
from reconstruction.capture import (
    Capture,
    Frames,
    FrameTruth,
    Poses,
    Provenance,
    Setup,
    Truth,
    read_capture,
    write_capture,
)
from spisim.scene import Scene
from spisim.scene.trajectory import FRAMES, POSES
from spisim.simulation.flight.camera import Camera, Shot
from spisim.simulation.flight.joining import join_captures
from spisim.simulation.flight.motion import Motion
from spisim.simulation.measurement import Memory, frame_truth
from spisim.transport import ground_truths

#: Frames of a segment: what is lost if the process is killed.
SEGMENT = 64
FLOWN_PATH = "flown path"


class FlightRecorder:
    """Writes frames in segments next to the file that they become, and joins them.

    Equal flights give equal bytes, also if they were interrupted and resumed.

    Parameters
    ----------
    path
        Capture file to become.
    scene
        What is recorded.
    setup, provenance
        Of all frames. The provenance tells this flight's segments from those of another.
    truths
        The truth of every so many frames is recorded.
    stated
        Poses that the rig states during some motions, the first of which has this number; by
        default the true ones.
    """

    def __init__(
        self,
        path: Path,
        scene: Scene,
        setup: Setup,
        provenance: Provenance,
        *,
        truths: int = 1,
        stated: Callable[[Sequence[Motion], int], Poses] | None = None,
    ) -> None:
        self.frames = 0
        self._path = path
        self._folder = path.with_name(f".{path.name}.parts")
        self._scene = scene
        self._setup = setup
        self._provenance = replace(provenance, created="")
        self._every = truths
        self._stated = stated or (lambda motions, first: true_poses(motions))
        self._shots: list[Shot] = []
        self._truths: list[tuple[int, FrameTruth]] = []

    def resume(self, camera: Camera) -> None:
        """Keep the whole segments of an earlier run; the camera goes on after their last frame.

        `frames` is then their number. Raises InputError for segments of another flight.
        """
        remove_unfinished(self._segment(SEGMENT * n) for n in range(len(self._segments) + 1))
        for number, part in enumerate(self._segments):
            with np.load(self._memory(part)) as stored:
                camera.memory = Memory(float(stored["level"]), stored["light"])
            capture = read_capture(part)
            if part != self._segment(SEGMENT * number) or capture.provenance != self._provenance:
                raise InputError(
                    f"{self._folder} holds the begun recording of another flight; remove it, or "
                    "choose another output"
                )
            self.frames += capture.frames
            camera.last = replace(capture.frame(capture.frames - 1), first=self.frames - 1)

    def discard(self) -> None:
        """Remove the segments."""
        shutil.rmtree(self._folder, ignore_errors=True)

    def add(self, shots: Sequence[Shot]) -> None:
        """Record successive frames."""
        due = [shot for number, shot in enumerate(shots, self.frames) if number % self._every == 0]
        views = [(shot.motion.scene(self._scene, 0.5), shot.instrument) for shot in due]
        truths = dict(zip(map(id, due), ground_truths(views, subpixels=1), strict=True))
        for shot in shots:
            if truth := truths.get(id(shot)):
                known = frame_truth(shot.image, shot.image_error, truth)
                self._truths.append((len(self._shots), known))
            self._shots.append(shot)
            self.frames += 1
            if len(self._shots) == SEGMENT:
                self._write_segment()

    def finish(self, provenance: Provenance | None = None) -> None:
        """Join all segments to the file; a provenance replaces that of the segments."""
        if self._shots:
            self._write_segment()
        self.join(provenance)
        self.discard()

    def join(self, provenance: Provenance | None = None) -> None:
        """Join the segments so far to the file."""
        joined = self._folder / "joined.tmp"
        join_captures(self._segments, joined, self._setup, provenance or self._provenance)
        joined.replace(self._path)

    @property
    def _segments(self) -> list[Path]:
        """Whole segments on disk, in order."""
        return sorted(self._folder.glob("*.h5"))

    def _segment(self, first: int) -> Path:
        return self._folder / f"{first:09d}.h5"

    @staticmethod
    def _memory(segment: Path) -> Path:
        return segment.with_suffix(".npz")

    def _write_segment(self) -> None:
        """Write the frames since the last segment; the capture comes last and makes it whole."""
        first = self.frames - len(self._shots)
        path = self._segment(first)
        self._folder.mkdir(parents=True, exist_ok=True)
        state = self._shots[-1].after or Memory(0.0, np.zeros(0))
        np.savez(self._memory(path), level=state.level, light=state.light)
        frames = Frames.joined([shot.frame for shot in self._shots])
        plans = [self._setup.plan_of(first + turn) for turn in range(len(self._setup.plans))]
        truth = None
        if self._truths:
            numbers = np.array([number for number, _ in self._truths], np.int64)
            truth = replace(Truth.of([each for _, each in self._truths]), frame=numbers)
        capture = Capture(
            plan=plans[0],
            following_plans=tuple(plans[1 : len(frames)]),
            buckets=frames.buckets,
            spots=frames.spots,
            pattern_taps=frames.pattern_taps,
            poses=self._stated([shot.motion for shot in self._shots], first),
            optics=self._setup.optics,
            provenance=self._provenance,
            truth=truth,
        )
        write_capture(capture, path)
        self._shots, self._truths = [], []


def true_poses(motions: Sequence[Motion]) -> Poses:
    """Poses at the middles of motions, without errors."""
    middle = np.array([0.5])
    turns = Rotation.concatenate([motion.turns(middle) for motion in motions])
    return Poses(
        time_s=np.array([motion.time_s + 0.5 * motion.duration_s for motion in motions]),
        position_m=np.concatenate([motion.positions_m(middle) for motion in motions]),
        orientation=turns.as_quat(),
        covariance=np.zeros((len(motions), 6, 6)),
    )


def flown(motions: Sequence[Motion]) -> str:
    """Poses at the start of every frame and the end of the last, in a file for `load_trajectory`.

    Quaternions turn the drone's body into the world.
    """
    last = motions[-1]
    times_s = [motion.time_s for motion in motions] + [last.time_s + last.duration_s]
    positions_m = [motion.start_m for motion in motions] + [last.stop_m]
    optical = Rotation.concatenate([motion.start for motion in motions] + [last.stop])
    turns = (optical * FRAMES["body"].inv()).as_quat()
    rows = np.column_stack([times_s, positions_m, turns])
    lines = [f"# {mark(FLOWN_PATH)}", ",".join(POSES)]
    lines += [",".join(f"{value:.9g}" for value in row) for row in rows]
    return "\n".join(lines) + "\n"

"""A flight along a path, recorded at the instrument's own frame rate."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from reconstruction.base.errors import InputError
from spisim.base.config import LightSource
from spisim.instrument import Instrument
from spisim.scene import Scene, Trajectory, check_clear_path
from spisim.simulation.flight.camera import Camera, provenance, solver
from spisim.simulation.flight.keys import SPACING_M, PathKeys
from spisim.simulation.flight.motion import Motion
from spisim.simulation.flight.pose_error import EXACT, PoseError, StatedPoses
from spisim.simulation.flight.recording import SEGMENT, FlightRecorder

MAX_FRAMES = 1_000_000
#: Solved key poses that are cached; a frame needs a few neighbours.
CACHED = 8
#: Random stream of the pose errors of a seed.
STREAM = 4


def record_flight(
    file: Path,
    scene: Scene,
    path: Trajectory,
    instrument: Instrument,
    *,
    light: LightSource = "traced",
    seed: int = 0,
    truths: int = 1,
    pose_error: PoseError = EXACT,
    spacing_m: float = SPACING_M,
    progress: Callable[[float], None] = lambda fraction: None,
    **budget: Any,
) -> tuple[int, int]:
    """Record all whole frames of a flight; a flight that was interrupted is resumed.

    Parameters
    ----------
    file
        Capture file to write, once the flight is over.
    scene, path, instrument
        Where the drone flies, and what it carries.
    light
        "traced" or "surrogate".
    seed
        Of light, noise and pose errors.
    truths
        The truth of every so many frames is recorded.
    pose_error
        Of the recorded poses.
    spacing_m
        Maximum distance between the key poses at which light is solved.
    progress
        Called with the completed fraction.
    **budget
        `spp` or `transport_noise_share` of traced light, as of `spisim.simulation.light.solve`.

    Returns
    -------
    frames, kept : int
        Number of frames, and how many of them an earlier run had recorded.

    Raises
    ------
    InputError
        If the path leads through an object, holds no frame or too many, or an unfinished recording
        of another flight is in the way.
    """
    check_clear_path(scene, path)
    frame_s = instrument.frame_time_s
    frames = int(path.duration_s / frame_s * (1 + 1e-9))
    if not 1 <= frames <= MAX_FRAMES:
        raise InputError(
            f"a flight of {path.duration_s:.4g} s has {frames} frames of {frame_s:.4g} s; 1 to "
            f"{MAX_FRAMES:,} can be recorded"
        )
    solve = solver(instrument, light, seed=seed, **budget)
    camera = Camera(
        scene, instrument, PathKeys(scene, path, spacing_m), solve, seed=seed, cached=CACHED
    )
    times_s = frame_s * (np.arange(frames, dtype=np.float64) + 0.5)
    errors = np.random.SeedSequence(seed, spawn_key=(STREAM,))
    stated = StatedPoses.drawn(path, times_s, pose_error, errors)
    settings = {
        **(budget if light == "traced" else {}),
        "spacing_m": spacing_m,
        "frames": frames,
        "truths": truths,
        "path": path.digest,
        "pose_error": pose_error.model_dump(),
    }
    recorder = FlightRecorder(
        file,
        scene,
        camera.setup(Motion.at_rest(scene, frame_s)),
        provenance(scene, instrument, light, seed=seed, settings=settings),
        truths=truths,
        stated=lambda motions, first: stated.rows(first, first + len(motions)),
    )
    recorder.resume(camera)
    kept = recorder.frames
    for start in range(kept, frames, SEGMENT):
        progress(start / frames)
        numbers = range(start, min(start + SEGMENT, frames))
        motions = [Motion.along(path, number * frame_s, frame_s) for number in numbers]
        recorder.add(camera.shoot([each for each in motions if each is not None], start))
    recorder.finish()
    return frames, kept

"""Flights for benchmarks/flight.py: drawn worlds, three motions, clear air and fog, the surrogate.

The files hold exact poses; `with_error` gives a flight the poses that an autopilot would state.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np
from depth_sets import JUDGED_BY, LEARNED_FROM
from scipy.spatial.transform import Rotation

import spisim
from reconstruction import read_capture
from reconstruction.base.errors import InputError
from reconstruction.capture import Capture
from spisim.scene import Scene, Trajectory, check_clear_path, draw_scene
from spisim.simulation.flight import PoseError, StatedPoses, record_flight

DURATION_S = 1.7
TRUTH_EVERY = 25
SPACING_M = 0.1
MOTIONS = ("forward", "sideways", "hover")
WEATHERS = {"clear": None, "fog 100 m": 100.0, "fog 50 m": 50.0}
PRESETS = ("fog", "fog-steered", "paper")
FAMILIES = {
    "learned": LEARNED_FROM,
    "judged": tuple(each for each in JUDGED_BY if each != "targets"),
}
SEED = 20261126
POSE_ERRORS = {
    "exact": PoseError(),
    "correlated": PoseError(correlated_m=0.02, correlated_deg=0.3, correlation_s=0.3),
    "drifting": PoseError(drift_m_per_sqrt_s=0.02, drift_deg_per_sqrt_s=0.3),
    "white": PoseError(white_m=0.02, white_deg=0.3),
    "one frame late": PoseError(delay_s=0.00853),
}


@dataclass(frozen=True)
class Flight:
    """A flight's file, and the cell of the tables that it belongs to."""

    path: Path
    family: str
    seed: int
    motion: str
    weather: str
    preset: str

    @property
    def cell(self) -> tuple[str, str, str]:
        """Motion, weather and preset."""
        return self.motion, self.weather, self.preset


def flights(
    folder: Path,
    group: str,
    *,
    seeds: Sequence[int] = (0,),
    presets: Sequence[str] = PRESETS,
    weathers: Sequence[str] = tuple(WEATHERS),
    motions: Sequence[str] = MOTIONS,
    duration_s: float = DURATION_S,
    record: bool = True,
) -> Iterator[Flight]:
    """Flights of a group of families; those that `folder` lacks are recorded first, if asked.

    Families without a clear path for a motion are left out.
    """
    folder.mkdir(parents=True, exist_ok=True)
    every = product(seeds, presets, weathers, motions, FAMILIES[group])
    for seed, preset, weather, motion, family in every:
        name = f"{family} {seed} {motion} {weather} {preset}".replace(" ", "_")
        flight = Flight(folder / f"{name}.h5", family, seed, motion, weather, preset)
        if not flight.path.exists():
            if not record:
                continue
            try:
                _record(flight, duration_s)
            except InputError as error:
                print(f"{name}: left out, {error}")
                continue
        yield flight


def _record(flight: Flight, duration_s: float) -> None:
    visibility_m = WEATHERS[flight.weather]
    fog = visibility_m and {"kind": "moderate-radiation", "visibility_m": visibility_m}
    changes = {"fog": fog, "rain": None}
    scene = draw_scene(flight.family, SEED + flight.seed, changes=changes)
    speed_m_s = 1.0 + 2.0 * np.random.default_rng([SEED, flight.seed]).random()
    path = clear_path(scene, flight.motion, speed_m_s, duration_s + 0.01)
    record_flight(
        flight.path,
        scene,
        path,
        spisim.load_instrument(flight.preset),
        light="surrogate",
        seed=flight.seed,
        truths=TRUTH_EVERY,
        spacing_m=SPACING_M,
    )


def clear_path(
    scene: Scene, motion: str, speed_m_s: float, duration_s: float = DURATION_S + 0.01
) -> Trajectory:
    """A path that ends in the scene's pose; slower where something is in the way."""
    times_s = np.linspace(0, duration_s, round(20 * duration_s) + 1)
    ago_s, pose = times_s - times_s[-1], scene.drone_pose
    for slower in (1.0, 0.7, 0.4, 0.2, 0.0):
        way_m = {
            "forward": np.outer(speed_m_s * slower * ago_s, pose[:3, 2]),
            "sideways": np.outer(0.6 * slower * np.sin(2.6 * ago_s), pose[:3, 0]),
            "hover": np.outer(0.03 * slower * np.sin(4 * ago_s), pose[:3, 1]),
        }[motion]
        turn = np.zeros((len(times_s), 3))
        if motion == "hover":
            turn[:, 1] = np.radians(7) * np.sin(2 * np.pi / 2.4 * ago_s)
            turn[:, 0] = np.radians(2) * np.sin(2 * np.pi / 1.7 * ago_s)
        turns = Rotation.from_matrix(pose[:3, :3]) * Rotation.from_rotvec(turn)
        path = Trajectory.through(times_s, pose[:3, 3] + way_m, turns)
        try:
            check_clear_path(scene, path)
        except InputError:
            continue
        return path
    raise InputError(f"{scene.name}: no clear path")


def with_error(capture: Capture, error: PoseError, seed: int) -> Capture:
    """The flight with the poses that a rig with this error states."""
    poses = capture.poses
    assert poses is not None
    path = Trajectory.through(
        poses.time_s - poses.time_s[0], poses.position_m, Rotation.from_quat(poses.orientation)
    )
    drawn = StatedPoses.drawn(
        path, poses.time_s - poses.time_s[0], error, np.random.SeedSequence([SEED, seed])
    )
    stated = replace(drawn.rows(0, len(poses.time_s)), time_s=poses.time_s)
    return replace(capture, poses=stated)


def load(flight: Flight) -> Capture:
    """The recording in memory."""
    return read_capture(flight.path)

"""Flights at frame rate: time, memory, and the error of light between key poses.

A second of the shipped warehouse flight in fog. The light of every reading is compared with that of
a light that is solved twice in every frame, with the same random numbers, over the noise of the
detectors.
"""

import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import spisim
from reconstruction import read_capture
from reconstruction.base.arrays import Floats
from spisim.instrument import Instrument
from spisim.scene import Scene, Trajectory, load_trajectory
from spisim.simulation.flight import Camera, Motion, PathKeys, record_flight, solver
from spisim.simulation.flight.keys import Keys
from spisim.simulation.flight.motion import scene_at
from spisim.simulation.light.lattice import Node
from spisim.simulation.measurement import record_frames
from spisim_paper.checks import Check, Table

VISIBILITY_M, PRESET, NOISE_SHARE, SECOND_S = 50, "fog", 0.5, 1.0
FRAMES, LONG_FRAMES = 7, 2000
LIMITS_S = {"traced": 30.0, "surrogate": 4.0}
SPP = 128


def scene() -> Scene:
    """The warehouse in fog."""
    fog = {"kind": "moderate-radiation", "visibility_m": VISIBILITY_M}
    return spisim.load_scene("warehouse", {"fog": fog})


def second() -> Trajectory:
    """The first second of the shipped flight."""
    path = load_trajectory("warehouse-flight")
    times_s = np.linspace(0, SECOND_S + 0.01, 21)
    return Trajectory.through(
        times_s, np.asarray(path.positions_m(times_s)), path.orientations(times_s)
    )


def taken_s(light: str) -> float:
    """Wall-clock time of a recorded second; kernels are compiled by an earlier run."""
    budget: Any = {"transport_noise_share": NOISE_SHARE} if light == "traced" else {}
    instrument, where, path = spisim.load_instrument(PRESET), scene(), second()
    with tempfile.TemporaryDirectory() as folder:
        for number in range(2):
            began = time.perf_counter()
            file = Path(folder) / f"{number}.h5"
            record_flight(file, where, path, instrument, light=light, **budget)
            seconds = time.perf_counter() - began
    return seconds


@dataclass(frozen=True)
class EveryFrame:
    """Keys at the ends of every frame."""

    scene_: Scene
    path: Trajectory
    frame_s: float

    def positions(self, motion: Motion, fractions: Floats) -> Floats:
        """See `Keys`."""
        return np.asarray((motion.time_s / self.frame_s + fractions)[:, None])

    def scene(self, node: Node) -> Scene:
        """See `Keys`."""
        time_s = min(node[0] * self.frame_s, self.path.duration_s)
        return scene_at(self.scene_, time_s, self.path.pose(time_s))


def light_errors(frames: int = FRAMES, spp: int = SPP) -> Floats:
    """Errors of expected bucket readings between keys, over their noise, (frames, exposures)."""
    instrument, where, path = spisim.load_instrument(PRESET), scene(), second()
    frame_s = instrument.frame_time_s
    last = int(path.duration_s / frame_s) - 1
    numbers = np.linspace(1, last, frames).astype(int).tolist()
    fine, coarse = (
        _readings(instrument, where, path, keys, numbers, spp)
        for keys in (EveryFrame(where, path, frame_s), PathKeys(where, path))
    )
    return np.array([(b - a) / s for (a, s), (b, _) in zip(fine, coarse, strict=True)])


def _readings(
    instrument: Instrument, where: Scene, path: Trajectory, keys: Keys, numbers: list[int], spp: int
) -> list[tuple[Floats, Floats]]:
    """Expected electrons of the readings of frames, and their noise."""
    light = solver(instrument, "traced", seed=0, spp=spp)
    camera = Camera(where, instrument, keys, light, seed=0, cached=4)
    fractions = instrument.exposure_times_s(1)[0] / instrument.frame_time_s
    outcome = []
    for number in numbers:
        motion = Motion.along(path, number * instrument.frame_time_s, instrument.frame_time_s)
        assert motion is not None
        between = camera.lattice.light(keys.positions(motion, fractions))
        seed = np.random.SeedSequence(number)
        means, noisy = (
            record_frames(motion.scene(where), instrument, between, [], seed, noise=noise)[
                0
            ].buckets
            for noise in (False, True)
        )
        electrons = (means.counts[0] - means.offset_counts) * means.electrons_per_count
        noise = np.hypot(
            noisy.noise_electrons, np.sqrt(noisy.excess_noise_factor * np.maximum(electrons, 0))
        )
        outcome.append((electrons, noise))
    return outcome


def peak_memories_mb() -> tuple[float, float]:
    """Peak memory of processes that record a short flight, and one of LONG_FRAMES frames."""
    short, long = (
        float(subprocess.run([sys.executable, __file__, str(frames)], check=True, text=True,
                             capture_output=True).stdout)
        for frames in (LONG_FRAMES // 8, LONG_FRAMES)
    )  # fmt: skip
    return short, long


def _record(frames: int) -> None:
    """Record a slow flight of so many frames, and print the peak memory."""
    instrument, where = spisim.load_instrument(PRESET), scene()
    path = load_trajectory("warehouse-flight")
    part_s = frames * instrument.frame_time_s
    times_s = np.linspace(0, part_s, 41)
    way = Trajectory.through(
        times_s,
        np.asarray(path.positions_m(times_s / part_s)),
        path.orientations(times_s / part_s),
    )
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "flight.h5"
        record_flight(file, where, way, instrument, light="surrogate", truths=8)
        print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
        assert read_capture(file).frames >= frames - 1


def flight_benchmark(*, quick: bool) -> tuple[list[Table], list[Check]]:
    """Time, error and memory of recorded flights."""
    seconds = {light: taken_s(light) for light in LIMITS_S}
    errors = light_errors(*((3, 32) if quick else (FRAMES, SPP)))
    tables = [
        Table(
            f"A second of the warehouse flight in {VISIBILITY_M} m of fog, `{PRESET}`, 117 frames "
            f"with their truth; traced to a noise fraction of {NOISE_SHARE:g}.",
            ("light", "wall-clock time, s"),
            [(light, f"{value:.1f}") for light, value in seconds.items()],
        ),
        Table(
            "Error of the light between key poses over the detector's noise, of all readings of "
            f"{len(errors)} frames, paired with light solved at the ends of every frame.",
            ("rms", "95 %", "maximum"),
            [tuple(f"{each:.3f}" for each in (
                np.sqrt((errors**2).mean()), np.quantile(np.abs(errors), 0.95),
                np.abs(errors).max()))],
        ),
    ]  # fmt: skip
    checks = [Check(f"s of a {light} second", seconds[light], LIMITS_S[light]) for light in seconds]
    checks.append(Check("light between keys over noise, any reading", np.abs(errors).max(), 1 / 3))
    if not quick:
        short, long = peak_memories_mb()
        tables.append(Table(
            f"Peak memory of flights of {LONG_FRAMES // 8} and {LONG_FRAMES} frames.",
            ("frames", "MB"),
            [(f"{LONG_FRAMES // 8}", f"{short:.0f}"), (f"{LONG_FRAMES}", f"{long:.0f}")],
        ))  # fmt: skip
        checks.append(Check("peak memory of 2000 frames over that of 250", long / short, 1.1))
    return tables, checks


if __name__ == "__main__":
    _record(int(sys.argv[1]))

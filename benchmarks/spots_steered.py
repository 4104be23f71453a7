"""Steered spots: ranges along 64 directions in fog, and what a frame of them takes.

Panels of drawn distance and reflectance fill the image of `fog-steered`, in fog; each frame points
its four spots elsewhere. Light of all orders of scattering is traced for every frame, noise is
drawn repeatedly. Mirrors read their angles with errors, as the preset states.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from time import thread_time

import numpy as np
import trimesh
import yaml
from foglight import POSE, REFLECTANCES
from intervals import of_figure, of_size
from numpy.typing import NDArray

from reconstruction import Capture, Reconstructor
from reconstruction.base.arrays import Floats, Mask
from reconstruction.capture.schema import between
from reconstruction.ranging import RANGING_METHODS
from reconstruction.ranging.bound import Targets, make_bound
from spisim.atmosphere import fog
from spisim.base.config import parse_model
from spisim.instrument import Instrument, load_instrument
from spisim.instrument.steering import Pointing
from spisim.scene import Ambient, Material, Scene, SceneObject
from spisim.simulation.light import LightSequence, solve, solve_spots, steered_light
from spisim.simulation.measurement import record
from spisim.transport import ground_truth
from spisim_paper.checks import Check, Table

VISIBILITY_M, WALLS_M, SKY_KLX = 50.0, (4.0, 9.0), 20.0
PANELS, SEED, LONGEST_M = 5, 35, 10.0
FRAMES, DRAWS, SPP = 16, 40, 512
QUICK_DRAWS, QUICK_SPP = 10, 64
MAX_BIAS_M, MAX_RATIO, Z_RMS, MAX_SLOWER = 0.002, 1.1, (0.9, 1.1), 1.05
SPOTS, TIMED = (4, 16, 64), 8


@dataclass(frozen=True, eq=False)
class Judged:
    """All spots of all frames and draws, each (n,); `direction` is the number of each's."""

    direction: NDArray[np.intp]
    true_m: Floats
    range_m: Floats
    sigma_m: Floats
    valid: Mask
    bound_m: Floats

    @property
    def error_m(self) -> Floats:
        """Of valid spots."""
        return np.asarray((self.range_m - self.true_m)[self.valid])


def scene() -> tuple[Scene, Floats]:
    """Panels over the field in fog, and their distances and reflectances (PANELS, PANELS, 2)."""
    rng = np.random.default_rng(SEED)
    drawn = np.stack([rng.uniform(*limits, (PANELS, PANELS)) for limits in (WALLS_M, REFLECTANCES)])
    edges = np.linspace(-0.2, 0.2, PANELS + 1)
    panels = tuple(
        _panel(f"panel {row} {column}", edges[[column, column + 1]], edges[[row, row + 1]], *each)
        for (row, column), each in zip(
            np.ndindex(PANELS, PANELS), drawn.reshape(2, -1).T, strict=True
        )
    )
    medium = fog(VISIBILITY_M, "moderate-radiation")
    around = Ambient(sky_klx=SKY_KLX)
    return Scene("panels", panels, medium, around, drone_pose=POSE), np.moveaxis(drawn, 0, -1)


def _panel(name: str, across: Floats, down: Floats, z: float, reflectance: float) -> SceneObject:
    corners = [[x * z, y * z, z] for x, y in zip(across[[0, 1, 1, 0]], down[[0, 0, 1, 1]],
                                                 strict=True)]  # fmt: skip
    mesh = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]]).apply_transform(POSE)
    return SceneObject(name, mesh, Material(name, float(reflectance), "drawn"))


def captured(instrument: Instrument, draws: int, spp: int) -> tuple[list[Capture], Pointing]:
    """Captures of FRAMES frames that differ in their noise alone."""
    panels, _ = scene()
    base = LightSequence(np.zeros(1), (solve(panels, instrument, spp=4, seed=SEED),))
    steered = steered_light(
        panels,
        instrument,
        base,
        partial(solve_spots, spp=spp),
        frames=FRAMES,
        seed=SEED,
    )
    true = steered.pointing.true
    truths = [ground_truth(panels, instrument.aimed(each), subpixels=1) for each in true]
    every = [
        record(panels, instrument, base, truths, seed=draw, frames=FRAMES, steered=steered)
        for draw in range(draws)
    ]
    return every, steered.pointing


def judged(*, quick: bool) -> Judged:
    """Ranges in fog of `fog-steered`, without an image, beside their bounds."""
    instrument = load_instrument("fog-steered")
    draws, spp = (QUICK_DRAWS, QUICK_SPP) if quick else (DRAWS, SPP)
    captures, pointing = captured(instrument, draws, spp)
    first = captures[0]
    assert first.spots is not None
    assert first.truth is not None
    solve_ranges = RANGING_METHODS["fog"].compile(between(first.spots, 0, 0))
    bounds = [_bound(instrument, first, pointing, frame) for frame in range(FRAMES)]
    rows = []
    for capture in captures:
        assert capture.spots is not None
        for frame in range(FRAMES):
            ranges = solve_ranges(between(capture.spots, frame, frame + 1).aimed)
            true_m, spots = first.truth.spot_range_m[frame], len(ranges.status)
            direction = frame * spots + np.arange(spots)
            rows.append((direction, true_m, ranges.range_m, ranges.sigma_m, ranges.valid,
                         bounds[frame]))  # fmt: skip
    return Judged(*map(np.concatenate, zip(*rows, strict=True)))


def _bound(instrument: Instrument, capture: Capture, pointing: Pointing, frame: int) -> Floats:
    """Cramér–Rao bound of a frame's spots, compiled for its own directions."""
    assert capture.spots is not None
    assert capture.truth is not None
    panels, drawn = scene()
    at = pointing.true[frame]
    row, column = ((at[:, axis] / at[:, 2] + 0.2) / 0.4 * PANELS for axis in (1, 0))
    reflectance = drawn[row.astype(int), column.astype(int), 1]
    medium = panels.atmosphere
    targets = Targets(
        capture.truth.spot_range_m[frame],
        reflectance * at[:, 2],
        medium.extinction_per_m,
        medium.scattering_per_m * medium.backscatter_per_sr,
    )
    spots = replace(between(capture.spots, frame, frame + 1).aimed, pointing=None)
    return make_bound(between(spots, 0, 0), LONGEST_M)(targets, spots.readings[0])


def frame_times(spots: int) -> tuple[float, float]:
    """Median processor time of a frame, s: of fixed spots, and of steered ones."""
    steered = of_spots(spots)
    panels, _ = scene()
    fixed = steered.model_copy(
        update={"lasers": steered.ranging.lasers.model_copy(update={"steering": None})}
    )
    frames = [_frames(panels, each) for each in (fixed, steered)]
    times: list[list[float]] = [[], []]
    for number in range(5 * TIMED):
        for (reconstruct, capture), taken in zip(frames, times, strict=True):
            frame = capture.frame(number % TIMED)
            began = thread_time()
            reconstruct(frame)
            taken.append(thread_time() - began)
    return float(np.median(times[0])), float(np.median(times[1]))


def _frames(panels: Scene, instrument: Instrument) -> tuple[Callable[..., object], Capture]:
    from spisim import simulate

    capture = simulate(panels, instrument, light="surrogate", seed=SEED, frames=TIMED).capture
    reconstruct = Reconstructor(capture.setup)
    reconstruct(capture.frame(0))
    return reconstruct, capture


def of_spots(spots: int) -> Instrument:
    """`fog-steered` with a square grid of spots, each with a mirror and a detector."""
    fields = yaml.safe_load(load_instrument("fog-steered").text)
    side = round(np.sqrt(spots))
    half = 10 / side
    centres = half * (2 * np.arange(side) + 1) - 10
    grid = np.stack(np.meshgrid(centres, centres), axis=-1).reshape(-1, 2)
    around = 0.01 * np.sign(grid) / np.sqrt(2)
    fields["lasers"]["directions_deg"] = grid.tolist()
    fields["lasers"]["steering"]["half_range_deg"] = [half - 0.35] * 2
    fields["tof"]["detector"]["positions_m"] = [[x, -y, 0.0] for x, y in around.tolist()]
    return parse_model(yaml.safe_dump(fields), Instrument, f"{spots} steered spots")


def table(result: Judged, times: dict[int, tuple[float, float]]) -> list[Table]:
    """Errors, and times."""
    error_m, bound_m = result.error_m, result.bound_m[result.valid]
    z = error_m / result.sigma_m[result.valid]
    errors = Table(
        f"`fog-steered` in {VISIBILITY_M:g} m of fog, panels at {WALLS_M[0]:g} to {WALLS_M[1]:g} m "
        f"under a sky of {SKY_KLX:g} klx: {FRAMES} frames of four spots, each direction another, "
        f"{len(result.valid) // (4 * FRAMES)} draws of noise.",
        ("directions", "valid, %", "bias, cm", "RMSE, cm", "bound, cm", "RMSE / bound", "z rms"),
        [(
            f"{len(set(result.direction.tolist()))}", f"{100 * result.valid.mean():.1f}",
            f"{100 * error_m.mean():+.2f}", f"{100 * _rms(error_m):.2f}",
            f"{100 * _rms(bound_m):.2f}", f"{_rms(error_m) / _rms(bound_m):.2f}",
            f"{_rms(z):.2f}",
        )],
    )  # fmt: skip
    frames = Table(
        "Processor time of a frame with the default methods.",
        ("spots", "fixed, ms", "steered, ms", "ratio"),
        [
            (f"{spots}", f"{1e3 * fixed:.1f}", f"{1e3 * steered:.1f}", f"{steered / fixed:.3f}")
            for spots, (fixed, steered) in times.items()
        ],
    )
    return [errors, frames]


def promises(result: Judged, times: dict[int, tuple[float, float]]) -> list[Check]:
    """What steered spots are to reach."""
    error_m, bound_m = result.error_m, result.bound_m[result.valid]
    z, group = error_m / result.sigma_m[result.valid], result.direction[result.valid]
    bias = of_size(of_figure(lambda some: float(error_m[some].mean()), group))
    ratio = of_figure(lambda some: _rms(error_m[some]) / _rms(bound_m[some]), group, positive=True)
    rms_z = of_figure(lambda some: _rms(z[some]), group, positive=True)
    return [
        Check("fog-steered: absolute bias, m", abs(error_m.mean()), MAX_BIAS_M, interval=bias),
        Check("fog-steered: RMSE / bound", _rms(error_m) / _rms(bound_m), MAX_RATIO,
              interval=ratio),
        Check("fog-steered: z rms", _rms(z), Z_RMS[0], at_least=True, interval=rms_z),
        Check("fog-steered: z rms", _rms(z), Z_RMS[1], interval=rms_z),
        *(
            Check(f"{spots} steered spots: time over that of fixed ones", steered / fixed,
                  MAX_SLOWER)
            for spots, (fixed, steered) in times.items()
        ),
    ]  # fmt: skip


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else np.nan


if __name__ == "__main__":
    from pathlib import Path

    from options import benchmark_options, finish

    from spisim_paper.checks import surroundings

    PAGE = Path(__file__).parents[1] / "docs" / "results" / "ranging.md"
    OPTIONS = benchmark_options(__doc__, "fewer paths and draws", PAGE)
    RESULT = judged(quick=OPTIONS.quick)
    TIMES = {spots: frame_times(spots) for spots in SPOTS}
    AROUND = surroundings(("spisim", "mitsuba", "drjit", "numpy", "scipy"))
    raise SystemExit(finish(OPTIONS, PAGE, "steered", AROUND, table(RESULT, TIMES),
                            promises(RESULT, TIMES)))  # fmt: skip

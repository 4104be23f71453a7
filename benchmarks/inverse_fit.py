"""Fits of weather, surfaces and gain to simulated recordings: bias, coverage and error.

    python benchmarks/inverse_fit.py [--quick] [--json] [--markdown]

Three boards in fog, at drawn distances, with drawn reflectances, visibility (20 to 500 m) and gain
of the converter. Each is recorded once by the `paper` instrument with 16 × 16 pixels; all five are
fitted, from starts off by a factor of three either way; daylight is off by 30 % (rms) from what the
scene states. Light of recording and fit is traced with different random numbers. Errors are those
of logarithms.

A flat board in a dark room calibrates a rig whose offset of ranges, gain, dark level, laser power
and throughput of patterns are off; and a measured wall a TMF8820 (`inverse_wall`).
"""

import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from intervals import of_figure, of_fraction
from inverse_wall import wall_checks, wall_poses, wall_table
from measured_wall import SHIPPED
from options import benchmark_options, finish

import spisim
from reconstruction import Capture
from reconstruction.base.arrays import Floats
from spisim.base.config import dump_yaml, parse_model
from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.scene.load import make_scene
from spisim.simulation.light import LightSequence, solve
from spisim.simulation.measurement import record
from spisim.transport import ground_truth
from spisim.transport.backend import use_threads
from spisim_inverse.fit.covariance import STEADY_UNSURE
from spisim_inverse.fit.fitting import fit
from spisim_inverse.fit.parameters import THROUGHPUT
from spisim_inverse.fit.result import Fitted
from spisim_paper.checks import Check, Table, surroundings

PAGE = Path(__file__).parents[1] / "docs" / "results" / "inverse.md"
CAPTURES, QUICK_CAPTURES = 200, 4
RIGS, QUICK_RIGS = 10, 2
VISIBILITIES_M, REFLECTANCES, DISTANCES_M = (20.0, 500.0), (0.1, 0.8), (3.0, 5.0)
GAINS = 0.5, 2.0
"""Of the converter's electrons per count over the preset's."""
OFF = 3.0
"""Factor by which starts are off."""
SKY_KLX = 0.5
FRAMES, RECORDED_SPP, SPP = 4, 1024, 128
SHAPE, PATTERNS = [16, 16], 31
MIN_COVERED, MAX_COVERED, MAX_OVER_BOUND, MAX_BIAS = 0.60, 0.76, 1.3, 4.0
GAIN, OFFSET = "buckets.electrons_per_count", "spots.range_offset_m"
BOARDS = ("left", "right", "lower")
NAMES = ("scene.fog.visibility_m", *(f"materials.{each}" for each in BOARDS), GAIN)
"""Order of the parameters."""


@dataclass(frozen=True)
class Outcome:
    """Errors of a fit's parameters, their sigmas, and the bounds of the noise alone."""

    capture: int
    names: tuple[str, ...]
    error: Floats
    sigma: Floats
    bound: Floats
    probability: float
    seconds: float


def main() -> int:
    """Fit and print; the exit status is 1 if a promise is broken."""
    measured = {"type": Path, "default": SHIPPED, "help": "folder with the measured wall"}
    options = benchmark_options(__doc__, "a few captures", PAGE, others={"--measured": measured})
    use_threads(1)
    twins = [fitted_twin(k) for k in range(QUICK_CAPTURES if options.quick else CAPTURES)]
    rigs = [fitted_rig(k) for k in range(QUICK_RIGS if options.quick else RIGS)]
    wall = wall_poses(options.measured, options.quick)
    around = surroundings(("spisim", "mitsuba", "numpy", "scipy"))
    tables = [
        table("Fits of visibility, three reflectances and gain", twins),
        table("Calibration by a flat target", rigs),
        wall_table(wall),
    ]
    checks = [*checks_of("twin", twins), *checks_of("rig", rigs), *wall_checks(wall)]
    return finish(options, PAGE, "fit", around, tables, checks)


def instrument_of(gain: float = 1.0, **changes: Any) -> Instrument:
    """The `paper` instrument with few pixels and a converter of another gain."""
    fields = yaml.safe_load(spisim.load_instrument("paper").text)
    fields["projector"]["shape"] = SHAPE
    fields["plan"]["patterns"] = PATTERNS
    fields["detector"]["adc"]["full_scale_electrons"] *= gain
    fields.pop("eye_safety")
    for name, value in changes.items():
        part, _, field = name.partition("__")
        fields[part][field] = value
    return parse_model(dump_yaml(fields), Instrument, "instrument")


def boards(rng: np.random.Generator) -> tuple[Scene, Scene, dict[str, float]]:
    """Three boards in fog under a sky as it is, and as it is stated, and the parameters' truth."""
    low, high = np.log(VISIBILITIES_M)
    truth = {NAMES[0]: float(np.exp(rng.uniform(low, high)))}
    low, high = np.log(REFLECTANCES)
    truth |= {name: float(np.exp(rng.uniform(low, high))) for name in NAMES[1:4]}
    places = {"left": (-1.5, 1.5, 3, 3), "right": (1.5, 1.5, 3, 3), "lower": (0, -1.5, 6, 3)}
    objects = []
    for name, (x, z, width, height) in places.items():
        position = [x, float(rng.uniform(*DISTANCES_M)), z]
        objects.append(
            {
                "name": name,
                "shape": "box",
                "size_m": [width, 0.02, height],
                "translate_m": position,
                "material": name,
            }
        )
    fields = {
        "name": "boards",
        "drone": {"position_m": [0, 0, 0], "look_at_m": [0, 1, 0]},
        "objects": objects,
        "materials": {
            name: {"reflectance": truth[f"materials.{name}"], "source": "drawn"} for name in BOARDS
        },
        "fog": {"visibility_m": truth[NAMES[0]]},
        "ambient": {"sky_klx": SKY_KLX},
    }
    stated = make_scene(dump_yaml(fields), Path(), "boards")
    sky_klx = SKY_KLX * max(1 + STEADY_UNSURE * float(rng.standard_normal()), 0.0)
    fields["ambient"] = {"sky_klx": sky_klx}
    return make_scene(dump_yaml(fields), Path(), "boards"), stated, truth


def recorded(scene: Scene, instrument: Instrument, seed: int, offset_m: float = 0.0) -> Capture:
    """A recording, whose ranges are off."""
    light = solve(scene, instrument, spp=RECORDED_SPP, seed=seed)
    light = replace(light, path_length_m=light.path_length_m + 2 * offset_m)
    sequence = LightSequence(np.zeros(1), (light,))
    truths = [ground_truth(scene, instrument)]
    return record(scene, instrument, sequence, truths, seed=seed, frames=FRAMES)


def fitted_twin(number: int) -> Outcome:
    """Visibility, reflectances and gain of one recording."""
    rng = np.random.default_rng([0, number])
    scene, stated, truth = boards(rng)
    gain = float(np.exp(rng.uniform(*np.log(GAINS))))
    instrument = instrument_of(gain)
    capture = recorded(scene, instrument, number)
    truth[GAIN] = capture.buckets.electrons_per_count
    starts: dict[str, float | None] = {}
    for name, value in truth.items():
        start = value * OFF ** float(rng.choice((-1, 1)))
        starts[name] = value / OFF if name.startswith("materials.") and start > 0.9 else start
    begun_s = time.process_time()
    result = fit(capture, stated, instrument_of(), starts, spp=SPP, seed=1000 + number)
    return outcome(number, result, truth, time.process_time() - begun_s)


def fitted_rig(number: int) -> Outcome:
    """Offset, gain, dark level, laser power and throughput of one rig, by a flat board."""
    rng = np.random.default_rng([1, number])
    scene = spisim.load_scene("target-plane", changes={"ambient": None})
    throughput = np.exp(0.05 * rng.standard_normal(PATTERNS))
    throughput /= throughput.mean()
    own = instrument_of(float(np.exp(rng.uniform(*np.log(GAINS)))))
    fields = yaml.safe_load(own.text)
    laser_w = fields["lasers"]["power_w"] * float(np.exp(0.3 * rng.standard_normal()))
    fields["lasers"]["power_w"] = laser_w
    dark = int(rng.integers(100, 500))
    fields["detector"]["adc"]["offset_counts"] = dark
    fields["plan"]["throughput"] = {"factors": throughput.tolist()}
    rig = parse_model(dump_yaml(fields), Instrument, "rig")
    offset_m = float(rng.uniform(-0.3, 0.3))
    capture = recorded(scene, rig, 100 + number, offset_m)
    truth = {
        OFFSET: offset_m,
        GAIN: capture.buckets.electrons_per_count,
        "buckets.offset_counts": float(dark),
        "lasers.power_w": laser_w,
    }
    starts: dict[str, float | None] = dict.fromkeys([*truth, THROUGHPUT])
    truth |= {
        f"{THROUGHPUT}[{row}]": float(each)
        for row, each in zip(rig.pattern_plan.distinct.tolist(), throughput, strict=True)
    }
    nominal = instrument_of()
    adc = nominal.imaging.detector.adc
    assert adc is not None
    stated: dict[str, Any] = {
        "electrons_per_count": adc.electrons_per_count,
        "offset_counts": float(adc.offset_counts),
    }
    capture = replace(capture, buckets=replace(capture.buckets, **stated))
    begun_s = time.process_time()
    result = fit(capture, scene, nominal, starts, spp=SPP, seed=2000 + number)
    return outcome(number, result, truth, time.process_time() - begun_s)


def outcome(number: int, result: Fitted, truth: dict[str, float], seconds: float) -> Outcome:
    """Errors by the coordinates that the fit varies."""
    chosen = result.model.parameters
    true = np.array([each.coordinate(truth[each.name]) for each in chosen])
    sigma, bound = (np.sqrt(np.diag(each)) for each in (result.covariance, result.bound))
    names = tuple(each.name.partition("[")[0] for each in chosen)
    error = result.coordinates - true
    print(
        number, f"{seconds:.1f} s, p {result.probability:.2g}, z", (error / sigma).round(2)[:5],
        "sigma", sigma.round(5)[:5], "bound", bound.round(5)[:5],
        file=sys.stderr, flush=True,
    )  # fmt: skip
    return Outcome(number, names, error, sigma, bound, result.probability, seconds)


def table(title: str, outcomes: list[Outcome]) -> Table:
    """Bias, coverage and error of each kind of parameter."""
    rows = []
    for name in dict.fromkeys(outcomes[0].names):
        some = [np.array(each.names) == name for each in outcomes]
        z, sigma, over = (
            np.concatenate([values(each)[own] for each, own in zip(outcomes, some, strict=True)])
            for values in (
                lambda each: each.error / each.sigma,
                lambda each: each.sigma,
                lambda each: each.error / each.bound,
            )
        )
        rows.append(
            (
                name,
                f"{np.median(sigma):.2g}",
                f"{z.mean():+.2f} ± {1 / np.sqrt(z.size):.2f}",
                f"{100 * np.mean(np.abs(z) < 1):.0f}",
                f"{np.sqrt(np.mean(over**2)):.2f}",
            )
        )
    seconds = np.median([each.seconds for each in outcomes])
    heads = ("parameter", "median sigma", "mean z", "within 1 σ, %", "rms error / bound")
    return Table(f"{title}: {len(outcomes)} recordings, {seconds:.0f} s a fit.", heads, rows)


def checks_of(what: str, outcomes: list[Outcome]) -> list[Check]:
    """Promises: no bias, calibrated sigmas, and errors near the bound."""
    groups = np.repeat([each.capture for each in outcomes], [each.error.size for each in outcomes])
    z = np.concatenate([each.error / each.sigma for each in outcomes])
    over = np.concatenate([each.error / each.bound for each in outcomes])
    covered = np.abs(z) < 1
    interval = of_fraction(covered, groups)
    names = np.concatenate([each.names for each in outcomes])
    bias = max(
        abs(float(z[names == name].mean()) * np.sqrt(np.count_nonzero(names == name)))
        for name in set(names.tolist())
    )

    def ratio(some: Any) -> float:
        return float(np.sqrt(np.mean(over[some] ** 2)))

    return [
        Check(f"{what}: largest |mean z| √n", bias, MAX_BIAS),
        Check(f"{what}: within 1 σ", float(covered.mean()), MIN_COVERED, True, interval),
        Check(f"{what}: within 1 σ, at most", float(covered.mean()), MAX_COVERED, False, interval),
        Check(
            f"{what}: rms error over the bound",
            ratio(slice(None)),
            MAX_OVER_BOUND,
            interval=of_figure(ratio, groups, positive=True),
        ),
    ]


if __name__ == "__main__":
    sys.exit(main())

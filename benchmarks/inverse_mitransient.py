"""Derivatives of the light of laser spots, against mitransient's differentiable path tracer.

    python benchmarks/inverse_mitransient.py [--quick] [--json] [--markdown]

mitransient's `transient_prbvolpath` replays each path backwards (path replay backpropagation:
D. Vicini, S. Speierer & W. Jakob, ACM Trans. Graph. 40(4), 108 (2021)). It renders each spot dual,
from the laser with a lamp in the detector's place. Ours are central differences of passes with the
same random numbers. The scene is a closed room in clear air, by the reflectance of its walls, and
with a bank of homogeneous fog, by its extinction.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from alternatives import TransientGradients
from efficiency import Method, Series, measure, ratio, z_score
from error_coverage import HALF_ANGLE_RAD
from options import benchmark_options, finish
from room import air, box_pose, room

import spisim
from reconstruction.base.arrays import Floats
from spisim.atmosphere import CLEAR
from spisim.scene import Scene, Volume
from spisim.transport.backend import use_threads
from spisim.transport.engine.estimator import spot_histogram
from spisim.transport.engine.sampling import PathBudget
from spisim.transport.engine.tally import PathLengthBins
from spisim.transport.views import InstrumentView
from spisim.transport.world import build_world
from spisim_paper.checks import Check, Table, surroundings

PAGE = Path(__file__).parents[1] / "docs" / "results" / "inverse.md"
INSTRUMENT = spisim.load_instrument("paper")
PLACED = InstrumentView.of(INSTRUMENT, np.eye(4))
#: mitransient's lamp is a point, so the apertures have to be small too.
DETECTORS = replace(
    PLACED.tof, area_m2=replace(PLACED.bucket, half_angle_rad=HALF_ANGLE_RAD).area_m2
)
BINS = PathLengthBins(41, 2.0)
#: Step of the logarithm of a parameter, either way.
STEP = 0.02
MAX_Z, MIN_GAIN = 4.0, 20.0


@dataclass(frozen=True)
class Case:
    """A scene at some factor on one of its parameters."""

    name: str
    derivative: str
    scene: Callable[[float], Scene]
    theirs: str  # the parameter's name in Mitsuba's scene
    value: float
    paths: int  # ours, per spot and end


def walls(factor: float) -> Scene:
    """The room with walls of another reflectance."""
    scene = room(CLEAR)
    first, *rest = scene.objects
    material = replace(first.material, reflectance=factor * REFLECTANCE)
    return replace(scene, objects=(replace(first, material=material), *rest))


def bank(factor: float) -> Scene:
    """The room with a bank of fog of another extinction; it begins 2 m ahead."""
    fog = air(20)
    medium = replace(fog, extinction_per_m=factor * fog.extinction_per_m)
    volume = Volume("bank", medium, box_pose((5.8, 5.8, 5.5), (0, 0, 5)))
    return replace(room(CLEAR), volumes=(volume,))


REFLECTANCE = 0.5
CASES = (
    Case(
        "room",
        "∂/∂ ln reflectance of the walls",
        walls,
        WALLS := "mesh_0.bsdf.brdf_0.reflectance.value",
        REFLECTANCE,
        2**12,
    ),
    Case(
        "fog bank",
        "∂/∂ ln extinction",
        bank,
        "volume_0.interior_medium.sigma_t.value.value",
        air(20).extinction_per_m,
        2**16,
    ),
)


def main() -> int:
    """Compare and print; the exit status is 1 if a promise is broken."""
    options = benchmark_options(__doc__, "fewer runs", PAGE)
    use_threads(1)
    around = surroundings(("spisim", "mitsuba", "drjit", "mitransient"))
    columns = (
        "scene",
        "derivative",
        "method",
        "error",
        "time, s",
        "1 / (error² · time), 1/s",
        "gain",
        "z",
    )
    title = (
        "Derivatives of the power of four spots by one parameter; error relative to their "
        "norm. Gain: of 1 / (error² · time)."
    )
    rows, checks = [], []
    for case in CASES:
        try:
            ours, theirs = measure(methods(case), 6 if options.quick else 20)
        except ImportError as error:
            table = Table(f"Not compared: {error} (`pip install mitransient`).")
            return finish(options, PAGE, "mitransient", around, [table], [])
        gain, error = ratio(ours, theirs, np.mean)
        z = z_score(ours.readings, theirs.readings)
        rows.append((case.name, case.derivative, "differences", *described(ours), "", ""))
        rows.append(
            (
                case.name,
                case.derivative,
                "mitransient",
                *described(theirs),
                f"{gain:.3g} × (± {error:.0%})",
                f"{z:.1f}",
            )
        )
        checks += [
            Check(f"z, {case.name}", z, MAX_Z),
            Check(f"gain, {case.name}", gain, MIN_GAIN, at_least=True),
        ]
    return finish(options, PAGE, "mitransient", around, [Table(title, columns, rows)], checks)


def described(series: Series) -> tuple[str, ...]:
    """Error, time and efficiency."""
    return (
        f"{series.error(np.mean):.2%}",
        f"{series.time_s:.2f}",
        f"{series.efficiency(np.mean):.2g}",
    )


def methods(case: Case) -> tuple[Method, Method]:
    """Ours and mitransient's; raises ImportError where there is no mitransient."""
    theirs = TransientGradients(case.scene(1.0), PLACED.beams, DETECTORS, case.theirs)
    low, high = (build_world(case.scene(np.exp(step))) for step in (-STEP, STEP))

    def power(world: Any, seed: int) -> Floats:
        entropy = np.random.SeedSequence(seed)
        budget = PathBudget(case.paths)
        estimate = spot_histogram(world, PLACED.beams, DETECTORS, BINS, budget, seed=entropy)
        return np.asarray(estimate.mean["histogram"].sum(axis=1))

    def differences(seed: int) -> Floats:
        return (power(high, seed) - power(low, seed)) / (2 * STEP)

    return (
        Method("differences", f"4 × {case.paths} per spot", differences),
        Method(
            "mitransient",
            f"{PATHS} per spot",
            lambda seed: case.value * theirs.readings(PATHS, seed),
        ),
    )


PATHS = 2**17

if __name__ == "__main__":
    sys.exit(main())

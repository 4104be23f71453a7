"""Derivatives of the light of laser spots, against mitransient's differentiable path tracer.

    python benchmarks/inverse_mitransient.py [--quick] [--json] [--markdown]

mitransient's `transient_prbvolpath` replays each path backwards (path replay backpropagation:
D. Vicini, S. Speierer & W. Jakob, ACM Trans. Graph. 40(4), 108 (2021)). It renders each spot dual,
from the laser with a lamp in the detector's place. Ours are sums of light weighted by scores. The
scene is a closed room, whose walls' reflectance is the parameter: in clear air, and with a bank of
homogeneous fog, whose extinction is one, too.
"""

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from alternatives import TransientGradients
from efficiency import Method, Series, measure, ratio, z_score
from error_coverage import HALF_ANGLE_RAD
from options import benchmark_options, finish
from room import air, box_pose, room

import spisim
from reconstruction.base.arrays import Floats
from spisim.atmosphere import CLEAR
from spisim.scene import Volume
from spisim.transport.backend import use_threads
from spisim.transport.engine.estimator import spot_histogram
from spisim.transport.engine.path_weights import Score, tracked_by
from spisim.transport.engine.sampling import PathBudget
from spisim.transport.engine.tally import PathLengthBins
from spisim.transport.scores import Extinction, Parameter, Reflectance
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
MAX_Z, MIN_GAIN = 4.0, 20.0
#: mitransient's paths per spot.
PATHS = 2**17
WALLS = room(CLEAR).objects[0].material
FOG = air(20)
#: It begins 2 m ahead: mitransient starts every path in clear air.
BANK = Volume("bank", FOG, box_pose((5.8, 5.8, 5.5), (0, 0, 5)))


@dataclass(frozen=True)
class Case:
    """A scene and one of its parameters, for us and by its name and value in Mitsuba's scene."""

    scene: str
    derivative: str
    volumes: tuple[Volume, ...]
    parameter: Parameter
    theirs: str
    value: float
    paths: int  # ours, per spot and end


CASES = (
    Case(
        "room",
        "∂/∂ ln reflectance of the walls",
        (),
        Reflectance(WALLS.name),
        "mesh_0.bsdf.brdf_0.reflectance.value",
        WALLS.reflectance,
        2**14,
    ),
    Case(
        "fog bank",
        "∂/∂ ln extinction",
        (BANK,),
        Extinction(0),
        "volume_0.interior_medium.sigma_t.value.value",
        FOG.extinction_per_m,
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
            ours, theirs = measure(methods(case), 6 if options.quick else 12)
        except ImportError as missing:
            table = Table(f"Not compared: {missing} (`pip install mitransient`).")
            return finish(options, PAGE, "mitransient", around, [table], [])
        gain, error = ratio(ours, theirs, np.mean)
        z = z_score(ours.readings, theirs.readings)
        rows.append((case.scene, case.derivative, "scores", *described(ours), "", ""))
        rows.append(
            (
                case.scene,
                case.derivative,
                "mitransient",
                *described(theirs),
                f"{gain:.3g} × (± {error:.0%})",
                f"{z:.1f}",
            )
        )
        checks += [
            Check(f"z, {case.scene}", z, MAX_Z),
            Check(f"gain, {case.scene}", gain, MIN_GAIN, at_least=True),
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
    scene = replace(room(CLEAR), volumes=case.volumes)
    theirs = TransientGradients(scene, PLACED.beams, DETECTORS, case.theirs)
    score = Score("it", case.parameter)
    world = build_world(scene, tracked_by([score]))

    def scores(seed: int) -> Floats:
        estimate = spot_histogram(
            world,
            PLACED.beams,
            DETECTORS,
            BINS,
            PathBudget(case.paths),
            seed=np.random.SeedSequence(seed),
            path_weights=[score],
        )
        return np.asarray(estimate.mean["histogram_it"].sum(axis=1))

    def replayed(seed: int) -> Floats:
        return case.value * theirs.readings(PATHS, seed)

    return (
        Method("scores", f"2 × {case.paths} per spot", scores),
        Method("mitransient", f"{PATHS} per spot", replayed),
    )


if __name__ == "__main__":
    sys.exit(main())

"""How far the echo of fog pulls the range of a laser spot, against visibility.

    python benchmarks/weather.py [--quick] [--json] [--markdown]

One laser at 15 MHz and a wall of reflectance 0.5 across its beam, in heavy advection fog; the
detector looks the same way from beside it, 0.57° around its axis, so that beam and field overlap
from 100 baselines on. `--markdown` pastes the tables into docs/results/weather.md and draws
docs/images/weather-bias.png.
"""

import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import trimesh
from numpy.typing import NDArray
from options import benchmark_options, finish
from scipy.constants import c

from spisim.atmosphere import Atmosphere, Tabulated, fog
from spisim.instrument.views import BeamView, DetectorView
from spisim.scene import Ambient, Material, Scene, SceneObject
from spisim.transport.engine.estimator import spot_histogram
from spisim.transport.engine.sampling import PathBudget
from spisim.transport.engine.tally import PathLengthBins
from spisim.transport.engine.walk import MAX_VERTICES
from spisim.transport.world import build_world
from spisim_paper.checks import Check, Table, surroundings

DOCS = Path(__file__).parents[1] / "docs"
PAGE = DOCS / "results" / "weather.md"
KIND = "heavy-advection"
REFLECTANCE = 0.5
FREQUENCY_HZ = 15e6
WAVE_NUMBER = 2 * np.pi * FREQUENCY_HZ / c  # per metre of path
AMBIGUITY_M = c / (2 * FREQUENCY_HZ)
#: Beginning of the overlap, for the two baselines.
OVERLAPS_M = (0.3, 1.0)
TAN_HALF_FIELD = 0.01
AREA_M2 = 1e-12  # a larger aperture would blur where the overlap begins
RANGES_M = (2.0, 5.0, 8.0)
VISIBILITIES_M = (200.0, 100.0, 50.0, 20.0, 10.0)
#: Phase function near 180° without the structure of the glory: its mean beyond 175°, over angles.
BACKSCATTER_PER_SR = 0.0245
GLORY_DEG = 175.0
BINS = PathLengthBins(4001, 0.02)
REPETITIONS = 10
MULTIPLES = {"single scattering": 1, "all orders": MAX_VERTICES}


@dataclass(frozen=True)
class Spot:
    """What a phase measurement reads of one spot, and its standard error by Monte Carlo."""

    bias_m: float
    error_m: float


def main() -> int:
    """Measure and print; the exit status is 1 if a promise is broken."""
    options = benchmark_options(__doc__, "rougher, in half a minute", PAGE)
    paths, visibilities_m = (2**12, (50.0,)) if options.quick else (2**15, VISIBILITIES_M)

    around = surroundings(("spisim", "mitsuba", "drjit", "numpy"))
    spots = {
        (visibility_m, range_m): measured(visibility_m, range_m, paths)
        for visibility_m in visibilities_m
        for range_m in RANGES_M
    }
    if options.markdown:
        draw(spots, DOCS / "images" / "weather-bias.png")
    page, tables = PAGE, [bias_table(spots)]
    return finish(options, page, "benchmark", around, tables, promises(spots))


Measured = dict[tuple[str, str], tuple[Spot, ...]]  # (phase function, orders): per overlap


def measured(visibility_m: float, range_m: float, paths: int) -> Measured:
    """Every way to trace the two spots on a wall at this range."""
    mie = fog(visibility_m, KIND)
    print(f"visibility {visibility_m:g} m, wall at {range_m:g} m", file=sys.stderr)
    return {
        (name, orders): traced(medium, range_m, paths, vertices)
        for name, medium in (("mean", without_glory(mie)), ("mie", mie))
        for orders, vertices in MULTIPLES.items()
    }


def without_glory(medium: Atmosphere) -> Atmosphere:
    """The same medium with the mean of its phase function near 180°."""
    assert isinstance(medium.phase, Tabulated)
    values = medium.phase.values.copy()
    cos = np.linspace(-1, 1, values.size)
    near = cos < np.cos(np.radians(GLORY_DEG))
    values[near] *= BACKSCATTER_PER_SR / medium.phase.density(cos[near])
    return replace(medium, phase=Tabulated(values))


def traced(medium: Atmosphere, range_m: float, paths: int, max_vertices: int) -> tuple[Spot, ...]:
    """One spot per overlap, by light transport."""
    side = 60.0
    corners = [[-side, -side, range_m], [side, -side, range_m], [side, side, range_m]]
    mesh = trimesh.Trimesh([*corners, [-side, side, range_m]], [[0, 1, 2], [0, 2, 3]])
    wall = SceneObject("wall", mesh, Material("wall", REFLECTANCE, "chosen"))
    count = len(OVERLAPS_M)
    ahead = np.tile([0.0, 0.0, 1.0], (count, 1))
    positions = np.array([[TAN_HALF_FIELD * overlap, 0.0, 0.0] for overlap in OVERLAPS_M])
    world = build_world(Scene("wall", (wall,), medium, Ambient(), np.eye(4)))
    estimates = [
        spot_histogram(
            world,
            BeamView(np.zeros((count, 3)), ahead),
            DetectorView(positions, ahead, AREA_M2, float(np.arctan(TAN_HALF_FIELD))),
            BINS,
            PathBudget(paths),
            seed=np.random.SeedSequence(repetition),
            max_vertices=max_vertices,
        )
        for repetition in range(REPETITIONS)
    ]
    histograms = np.array([estimate.mean["histogram"] for estimate in estimates])
    phasors = histograms @ np.exp(1j * WAVE_NUMBER * BINS.centres_m)
    return tuple(_spot(phasors[:, number], range_m) for number in range(count))


def _spot(phasors: NDArray[np.complex128], range_m: float) -> Spot:
    mean = phasors.mean()
    turned = np.imag(phasors / mean)  # small angles
    error = turned.std(ddof=1) / np.sqrt(len(phasors))
    return Spot(
        bias_m=reading_m(mean) - range_m,
        error_m=float(error / (2 * WAVE_NUMBER)),
    )


def reading_m(phasor: complex) -> float:
    """Range within the first interval of ambiguity."""
    return float(np.angle(phasor) / (2 * WAVE_NUMBER) % AMBIGUITY_M)


def closed_form(visibility_m: float, range_m: float, overlap_m: float) -> tuple[float, float]:
    """Bias in metres and the fog's light over the wall's, of single scattering.

    The phase function is constant near 180°.

    With d from a point at r on the beam back to the detector, whose axis is parallel to it:
    Z = ρ r² / (π d⁴) e^{(ik - σ)(r + d)} at the wall
    + ∫ σs p r / d³ e^{(ik - σ)(r + d)} dr from the overlap to there.
    """
    medium = fog(visibility_m, KIND)
    r = np.geomspace(overlap_m, range_m, 4001)
    d = np.hypot(r, TAN_HALF_FIELD * overlap_m)
    through = np.exp(-medium.extinction_per_m * (r + d)) * r / d**3
    wall = REFLECTANCE / np.pi * (r / d * through)[-1]
    echo = medium.scattering_per_m * BACKSCATTER_PER_SR * through
    turns = np.exp(1j * WAVE_NUMBER * (r + d))
    phasor = wall * turns[-1] + np.trapezoid(echo * turns, r)
    return reading_m(phasor) - range_m, float(np.trapezoid(echo, r) / wall)


def bias_table(spots: dict[tuple[float, float], Measured]) -> Table:
    """Biases in metres, with standard errors."""
    rows = []
    for number, overlap_m in enumerate(OVERLAPS_M):
        for (visibility_m, range_m), ways in spots.items():
            bias_m, echo = closed_form(visibility_m, range_m, overlap_m)
            rows.append(
                (
                    f"{overlap_m:g}",
                    f"{visibility_m:g}",
                    f"{range_m:g}",
                    f"{float(f'{echo:.2g}'):g}",
                    f"{bias_m:+.2f}",
                    *(_reported(way[number]) for way in ways.values()),
                )
            )
    title = (
        f"Reading less range of a wall (reflectance {REFLECTANCE:g}) in {KIND} fog at "
        f"{FREQUENCY_HZ / 1e6:g} MHz, m, ± standard error where it is 5 mm or more. Mean: the "
        f"phase function beyond {GLORY_DEG:g}° is {BACKSCATTER_PER_SR:g} per sr; Mie: it is the "
        "table. Echo: light of the fog over light of the wall, single scattering, mean."
    )
    columns = ("overlap from, m", "visibility, m", "range, m", "echo", "closed form, mean")
    ways = ("single, mean", "all orders, mean", "single, Mie", "all orders, Mie")
    return Table(title, (*columns, *ways), rows)


def _reported(spot: Spot) -> str:
    error = f" ± {spot.error_m:.2f}" if spot.error_m >= 0.005 else ""
    return f"{spot.bias_m:+.2f}{error}"


def promises(spots: dict[tuple[float, float], Measured]) -> list[Check]:
    """That single scattering is the closed form."""
    z = [
        (spot.bias_m - closed_form(visibility_m, range_m, overlap_m)[0])
        / np.hypot(spot.error_m, 1e-5)  # 10 µm: single precision of path lengths
        for (visibility_m, range_m), ways in spots.items()
        for spot, overlap_m in zip(ways["mean", "single scattering"], OVERLAPS_M, strict=True)
    ]
    return [Check("largest_z_single_scattering", float(np.abs(z).max()), 4)]


def draw(spots: dict[tuple[float, float], Measured], path: Path) -> None:
    """Bias against visibility; a panel per overlap."""
    figure, axes = plt.subplots(1, 2, figsize=(10, 4.6), layout="constrained", sharey=True)
    fine = np.geomspace(min(VISIBILITIES_M) * 0.9, max(VISIBILITIES_M) * 1.1, 300)
    for number, (axis, overlap_m) in enumerate(zip(axes, OVERLAPS_M, strict=True)):
        for range_m, colour in zip(RANGES_M, ("tab:blue", "tab:orange", "tab:green"), strict=True):
            bias = np.array([closed_form(v, range_m, overlap_m)[0] for v in fine])
            jumps = np.flatnonzero(np.abs(np.diff(bias)) > AMBIGUITY_M / 2)
            axis.plot(fine, np.where(np.isin(np.arange(fine.size), jumps), np.nan, bias), c=colour)
            _marks(axis, spots, number, range_m, colour)
        axis.set(xscale="log", xlabel="visibility, m", title=f"overlap from {overlap_m:g} m")
        axis.set_xticks(VISIBILITIES_M, [f"{v:g}" for v in VISIBILITIES_M])
        axis.minorticks_off()
        axis.axhline(0, color="0.8", zorder=0)
    axes[0].set_ylabel("reading less range, m")
    for label, style in (
        ("single scattering, closed form", {"ls": "-"}),
        ("single scattering, traced", {"marker": "o", "mfc": "none", "ls": ""}),
        ("all orders, traced", {"marker": "x", "ls": ""}),
        ("all orders, with glory, traced", {"marker": "+", "ls": "", "ms": 9}),
    ):
        axes[1].plot([], [], color="0.3", label=label, **style)
    for range_m, colour in zip(RANGES_M, ("tab:blue", "tab:orange", "tab:green"), strict=True):
        axes[1].plot([], [], color=colour, label=f"wall at {range_m:g} m")
    figure.legend(fontsize=8, loc="outside lower center", ncols=4)
    figure.savefig(path, dpi=110, metadata={"Software": None})


def _marks(
    axis: Any, spots: dict[tuple[float, float], Measured], number: int, range_m: float, colour: str
) -> None:
    styles = {
        ("mean", "single scattering"): {"marker": "o", "mfc": "none"},
        ("mean", "all orders"): {"marker": "x"},
        ("mie", "all orders"): {"marker": "+", "ms": 9},
    }
    for way, style in styles.items():
        chosen = {v: ways[way][number].bias_m for (v, r), ways in spots.items() if r == range_m}
        axis.plot(list(chosen), list(chosen.values()), ls="", color=colour, **style)


if __name__ == "__main__":
    sys.exit(main())

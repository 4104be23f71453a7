"""Visibility that ranging in fog states: bias, scatter and honesty, by visibility and kind of fog.

    python benchmarks/visibility.py [--quick] [--json] [--markdown]

Preset `fog` before four boards at 4 to 9 m (`foglight`) and two shipped scenes, in Mie fog of four
kinds; light of all orders of scattering is traced. Visibilities are by a contrast of 2 %. Frames
of a scene differ in their noise alone. The bound is that of Cramér and Rao of the boards, for even
fog whose kind is known as far as the method knows it. `--markdown` pastes the table into
docs/results/ranging.md.
"""

import sys
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from foglight import NATURAL, Cell, draw, light_of
from intervals import of_figure, of_fraction
from numpy.typing import NDArray
from options import benchmark_options, finish

import spisim
from reconstruction.base.arrays import Floats
from reconstruction.capture import Spots
from reconstruction.capture.schema import between
from reconstruction.ranging import Visibility, pooled, ranging_method
from reconstruction.ranging.bound import PRIOR, Targets, make_bounds
from reconstruction.ranging.visibility import BACKSCATTER_LOG_SIGMA, RATIO_LOG_SIGMA
from spisim.instrument import Instrument
from spisim_paper.checks import Check, Table, surroundings

PAGE = Path(__file__).parents[1] / "docs" / "results" / "ranging.md"
VISIBILITIES_M = (20, 35, 50, 70, 100, 140, 200)
THIN_M = (500, 1000, None)
SHIPPED = ("warehouse", "target-tilted-plane")
NEAREST_M, FARTHEST_M = 4.0, 9.0
BOARDS, PATHS, FRAMES = 8, 2**14, 8
QUICK_BOARDS, QUICK_PATHS = 1, 2**12
DAYLIGHT_KLX = 10.0
MAX_BIAS, MAX_RMSE, WITHIN, MIN_BOUNDED = 0.05, 0.10, (0.60, 0.76), 0.95


@dataclass(frozen=True, eq=False)
class Stated:
    """Visibilities of scenes (n,): errors of ln V and sigmas, nan where only a bound is stated.

    ``bounded`` says whether the truth is beyond the lower bound, and ``possible`` is the bound of
    Cramér and Rao of the error, nan where it is not known.
    """

    kind: NDArray[np.str_]
    error: Floats
    sigma: Floats
    bounded: NDArray[np.bool_]
    possible: Floats

    @property
    def valid(self) -> NDArray[np.intp]:
        """Indices of scenes with a visibility."""
        return np.flatnonzero(np.isfinite(self.error))

    def joined(self, other: "Stated") -> "Stated":
        """Scenes of both."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Stated(*(np.concatenate(pair) for pair in pairs))


@dataclass(frozen=True, eq=False)
class Recorded:
    """Readings of `FRAMES` frames in a kind of fog, and the bound of one frame and of all."""

    kind: str
    spots: Spots
    possible: tuple[float, float] = (np.nan, np.nan)


def main() -> int:
    """Measure and print; the exit status is 1 if a promise is broken."""
    options = benchmark_options(__doc__, "a scene of boards per cell, of fewer paths", PAGE)
    boards, paths = (QUICK_BOARDS, QUICK_PATHS) if options.quick else (BOARDS, PATHS)
    around = surroundings(("spisim", "mitsuba", "drjit", "numpy"))
    instrument = spisim.load_instrument("fog")
    single, together = {}, {}
    for visibility_m in (*VISIBILITIES_M, *THIN_M):
        scenes = [*recorded(visibility_m, instrument, boards, paths, shipped=not options.quick)]
        kinds = [each.kind for each in scenes]
        frames = [stated(each.spots) for each in scenes]
        of_one, of_all = np.array([each.possible for each in scenes]).T
        single[visibility_m] = judged(kinds, [each[0] for each in frames], visibility_m, of_one)
        pools = [pooled(each) for each in frames]
        together[visibility_m] = judged(kinds, pools, visibility_m, of_all)
    checks = promises("one frame", single) + promises(f"{FRAMES} frames", together)
    return finish(options, PAGE, "visibility", around, [table(single, together)], checks)


def recorded(
    visibility_m: float | None, instrument: Instrument, boards: int, paths: int, *, shipped: bool
) -> Iterator[Recorded]:
    """All scenes in all kinds of fog."""
    optics = instrument.spot_optics
    for number, kind in enumerate(NATURAL):
        seed = 1000 + 10 * (visibility_m or 0) + number
        name = f"{kind}, {visibility_m} m"
        cell = Cell(name, visibility_m, NEAREST_M, FARTHEST_M, kind, seed)
        light = light_of(cell, boards, instrument, paths).at(instrument, DAYLIGHT_KLX)
        for scene in range(boards):
            rng = np.random.default_rng([seed, scene])
            one = replace(
                light,
                echo_per_s=np.repeat(light.echo_per_s[scene, None], FRAMES, axis=0),
                steady_per_s=np.repeat(light.steady_per_s[scene, None], FRAMES, axis=0),
            )
            spots = instrument.tof.record(one, optics, rng)
            mean = instrument.tof.record(one, optics, None).readings[0]
            yield Recorded(kind, spots, _possible(cell, scene, instrument, spots, mean))
        for name in SHIPPED if shipped else ():
            yield Recorded(kind, _simulated(name, visibility_m, kind, instrument, seed))


def _possible(
    cell: Cell, number: int, instrument: Instrument, spots: Spots, mean: NDArray[Any]
) -> tuple[float, float]:
    """Bound of ln V from one frame and from all, of boards, with the prior of droplets."""
    if cell.visibility_m is None:
        return np.nan, np.nan
    directions = instrument.lasers.directions
    drawn = draw(cell, number, directions)
    fog = drawn.medium
    targets = Targets(
        drawn.range_m,
        drawn.reflectance * directions[:, 2],
        fog.extinction_per_m,
        fog.scattering_per_m * fog.backscatter_per_sr,
    )
    prior = PRIOR[0], BACKSCATTER_LOG_SIGMA
    empty = between(spots, 0, 0)
    one, together = (
        make_bounds(empty, 2 * FARTHEST_M, prior, frames)(targets, mean).log_extinction
        for frames in (1, FRAMES)
    )
    return float(np.hypot(one, RATIO_LOG_SIGMA)), float(np.hypot(together, RATIO_LOG_SIGMA))


def _simulated(
    name: str, visibility_m: float | None, kind: str, instrument: Instrument, seed: int
) -> Spots:
    fog = visibility_m and {"visibility_m": visibility_m, "kind": kind}
    with warnings.catch_warnings(action="ignore"):  # such fog holds more water than natural one
        scene = spisim.load_scene(name, {"fog": fog, "rain": None, "snow": None})
    share = {"transport_noise_share": 1.0}
    spots = spisim.simulate(scene, instrument, frames=FRAMES, seed=seed, **share).capture.spots
    assert spots is not None
    return spots


def stated(spots: Spots) -> list[Visibility]:
    """Visibility of each frame."""
    solve = ranging_method("fog", spots).compile(between(spots, 0, 0))
    each = [solve(between(spots, k, k + 1)).visibility for k in range(len(spots.readings))]
    return [visibility for visibility in each if visibility is not None]


def judged(
    kinds: list[str],
    estimates: list[Visibility | None],
    visibility_m: float | None,
    possible: Floats,
) -> Stated:
    """Estimates of scenes beside the truth, None in clear air."""
    median_m, sigma, at_least_m = np.array(estimates, dtype=np.float64).T
    true_m = visibility_m or np.inf
    error = np.log(median_m / true_m)
    return Stated(np.array(kinds), error, sigma, at_least_m < true_m, possible)


def table(single: dict[float | None, Stated], together: dict[float | None, Stated]) -> Table:
    """A row for each visibility."""
    columns = (
        "visibility, m", "scenes", "stated, %", "bias, %", *(f"{kind}, %" for kind in NATURAL),
        "RMSE, %", "Cramér–Rao, %", "median σ, %", "within 1 σ, %", "beyond the bound, %",
        f"{FRAMES} frames: RMSE, %", "Cramér–Rao, %", "median σ, %", "within 1 σ, %",
    )  # fmt: skip
    rows = [
        (f"{visibility_m or 'clear'}", *_row(each), *_scatter(together[visibility_m]))
        for visibility_m, each in single.items()
    ]
    title = (
        "`fog`: visibility (2 % contrast) from one frame, and from "
        f"{FRAMES} frames of the same scene together. Errors are of ln V where V is stated, the "
        "bias by kind of fog, too; beyond the bound is the truth above the lower bound of 95 %. "
        "Cramér–Rao is the least RMSE of the boards' readings in even fog."
    )
    return Table(title, columns, rows)


def _row(each: Stated) -> tuple[str, ...]:
    by_kind = (_mean(each.error[each.kind == kind]) for kind in NATURAL)
    stated_part = f"{100 * each.valid.size / each.error.size:.0f}"
    means = (_mean(each.error), *by_kind)
    bounded = f"{100 * each.bounded.mean():.0f}"
    return (f"{each.error.size}", stated_part, *means, *_scatter(each), bounded)


def _mean(values: Floats) -> str:
    finite = values[np.isfinite(values)]
    return f"{100 * finite.mean():+.0f}" if finite.size else "–"


def _scatter(each: Stated) -> tuple[str, str, str, str]:
    error, sigma = each.error[each.valid], each.sigma[each.valid]
    known = each.possible[np.isfinite(each.possible)]
    if not error.size or not known.size:
        return "–", "–", "–", "–"
    within = 100 * (np.abs(error) < sigma).mean()
    figures = 100 * _rms(error), 100 * _rms(known), 100 * np.median(sigma), within
    return tuple(f"{figure:.0f}" for figure in figures)  # type: ignore[return-value]


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def promises(name: str, stated: dict[float | None, Stated]) -> list[Check]:
    """What is promised of visibilities from 20 to 200 m, and of the bound in any air."""
    fog = stated[VISIBILITIES_M[0]]
    for visibility_m in VISIBILITIES_M[1:]:
        fog = fog.joined(stated[visibility_m])
    error, sigma = fog.error[fog.valid], fog.sigma[fog.valid]
    scene = np.arange(error.size)
    within = np.abs(error) < sigma
    part, interval = float(within.mean()), of_fraction(within, scene)
    bias = of_figure(lambda some: float(error[some].mean()), scene)
    rmse = of_figure(lambda some: _rms(error[some]), scene, positive=True)
    bounded = np.concatenate([each.bounded for each in stated.values()])
    return [
        Check(f"{name}: bias of ln V", float(error.mean()), MAX_BIAS, interval=bias),
        Check(f"{name}: bias of ln V, least", float(error.mean()), -MAX_BIAS, True, bias),
        Check(f"{name}: RMSE of ln V", _rms(error), MAX_RMSE, interval=rmse),
        Check(f"{name}: within 1 sigma", part, WITHIN[0], True, interval),
        Check(f"{name}: within 1 sigma, most", part, WITHIN[1], False, interval),
        Check(
            f"{name}: truth beyond the lower bound",
            float(bounded.mean()),
            MIN_BOUNDED,
            True,
            of_fraction(bounded, np.arange(bounded.size)),
        ),
    ]


if __name__ == "__main__":
    sys.exit(main())

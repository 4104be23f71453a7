"""Ranges of four spots in fog: bias, scatter and honesty, of every method and instrument.

    python benchmarks/ranging.py [--quick] [--json] [--markdown]

Each scene has four boards, one for each laser, of drawn ranges and reflectances, in Mie fog of a
drawn kind; light of all orders of scattering is traced once per scene and kept under out/ranging,
so that methods can be compared again within a minute. Noise is drawn from other seeds than scenes.
`--markdown` pastes the tables into docs/results/ranging.md.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import thread_time
from typing import Any

import numpy as np
import unseen_fogs
import yaml
from foglight import Cell, draw, light_of
from intervals import of_figure, of_fraction, of_minimum, of_size
from numpy.typing import NDArray
from options import benchmark_options, finish
from scipy.stats import binomtest
from yardstick import Yardstick, processor

from reconstruction.base.arrays import Floats, Mask
from reconstruction.capture import Spots
from reconstruction.capture.schema import between
from reconstruction.ranging import RANGING_METHODS
from reconstruction.ranging.bound import Bound, Targets, make_bound
from spisim.base.config import parse_model
from spisim.instrument import Instrument, load_instrument
from spisim_paper.checks import Check, Table, surroundings

DOCS = Path(__file__).parents[1] / "docs" / "results" / "ranging.md"
CELLS = (
    Cell("50 m, 4–6 m", 50, 4, 6, seed=1),
    Cell("50 m, 7–9 m", 50, 7, 9, seed=2),
    Cell("100 m, 7–9 m", 100, 7, 9, seed=3),
    Cell("20 m, 2–4 m", 20, 2, 4, seed=4),
    Cell("clear, 2–9 m", None, 2, 9, seed=5),
    Cell("unseen, 50 m, 4–9 m", 50, 4, 9, "unseen", seed=6),
    Cell("patchy, 50 m, 4–9 m", 50, 4, 9, "patchy", seed=7),
)
SCENES, PATHS = 50, 2**15
QUICK_SCENES, QUICK_PATHS = 4, 2**12
DAYLIGHT_KLX = (10.0, 100.0)
CLEAR_DRAWS = 5  # of noise for each scene in clear air, where light is the same at every seed
LONGEST_M = 10.0
WRONG_M = 0.3
#: Most of |bias| and RMSE in m, least share that is valid, and shares within one sigma.
PROMISED = {
    "50 m, 4–6 m": (0.005, 0.01, 0.97, (0.60, 0.76)),
    "50 m, 7–9 m": (0.005, 0.015, 0.92, (0.60, 0.76)),
    "100 m, 7–9 m": (0.005, 0.01, 0.98, (0.60, 0.76)),
    "20 m, 2–4 m": (0.01, 0.02, 0.95, (0.60, 0.76)),
    "clear, 2–9 m": (0.002, np.inf, 1.0, (0.64, 0.72)),
}
CLEAR = "clear, 2–9 m"


@dataclass(frozen=True)
class Way:
    """An instrument, and the methods that read it: the plain one first."""

    title: str
    instrument: Instrument
    methods: tuple[str, str]


@dataclass(frozen=True, eq=False)
class Estimate:
    """Results of a method for all spots of a cell, each (trials,), beside the truth.

    ``scene`` is the number of each spot's scene, among those of all cells, ``bound_m`` the
    Cramér-Rao bound, ``frame_s`` the processor time per frame (frames,).
    """

    scene: NDArray[np.intp]

    true_m: Floats
    range_m: Floats
    sigma_m: Floats
    valid: Mask
    bound_m: Floats
    frame_s: Floats

    @property
    def valid_scene(self) -> NDArray[np.intp]:
        """Scenes of the valid spots."""
        return self.scene[self.valid]

    @property
    def error_m(self) -> Floats:
        """Of valid spots."""
        return np.asarray((self.range_m - self.true_m)[self.valid])

    @property
    def rmse_m(self) -> float:
        """Of valid spots; nan where there is none."""
        return _rms(self.error_m)

    @property
    def ratio(self) -> float:
        """Error over the bound of the same spots."""
        return self.rmse_m / _rms(self.bound_m[self.valid])

    @property
    def within(self) -> NDArray[np.bool_]:
        """Which valid spots have the truth within one sigma."""
        return np.asarray(np.abs(self.error_m) < self.sigma_m[self.valid])

    @property
    def wrong(self) -> NDArray[np.bool_]:
        """Which spots are valid and off by more than WRONG_M."""
        return np.asarray(np.abs(self.range_m - self.true_m) > WRONG_M) & self.valid


Results = dict[tuple[str, str, str, float], Estimate]  # by way, method, cell, klx


def main() -> int:
    """Measure and print; the exit status is 1 if a promise is broken."""
    options = benchmark_options(__doc__, "four scenes a cell, of fewer paths", DOCS)
    scenes, paths = (QUICK_SCENES, QUICK_PATHS) if options.quick else (SCENES, PATHS)
    around = surroundings(("spisim", "mitsuba", "drjit", "numpy", "scipy"))
    ways, result, yardstick = instruments(), Results(), processor()
    for way in ways:
        for cell in CELLS:
            result |= measured(way, cell, scenes, paths)
            yardstick.look()
    unseen = unseen_fogs.judged(quick=options.quick)
    tables = [unseen_fogs.table(unseen), *(table(way, result, scenes) for way in ways)]
    checks = unseen_fogs.promises(unseen) + promises(ways, result, yardstick)
    return finish(options, DOCS, "benchmark", around, tables, checks)


def instruments() -> list[Way]:
    """Presets, and one with pulses in many windows."""
    fog = load_instrument("fog")
    return [
        Way("fog", fog, ("cw", "fog")),
        Way("paper", load_instrument("paper"), ("cw", "fog")),
        Way("fog-spad", load_instrument("fog-spad"), ("dtof", "fog")),
        Way("fog, with pulses in 14 windows of 5 ns", _pulsed(fog), ("pulsed", "fog")),
    ]


def _pulsed(instrument: Instrument) -> Instrument:
    """The same optics, mean power and amplifier with pulses of 5 ns up to 10 m."""
    fields = yaml.safe_load(instrument.text)
    repetition_rate_hz, pulse_s = 10e6, 5e-9
    fields["lasers"]["power_w"] /= repetition_rate_hz * pulse_s
    fields["tof"] = {
        "method": "pulsed",
        "pulse_width_s": pulse_s,
        "windows": 14,
        "pulses": 85_200,
        "repetition_rate_hz": repetition_rate_hz,
        "detector": fields["tof"]["detector"],
    }
    return parse_model(yaml.safe_dump(fields), Instrument, "pulses in windows")


def measured(way: Way, cell: Cell, scenes: int, paths: int) -> Results:
    """All methods of an instrument on a cell's scenes."""
    instrument = way.instrument
    light = light_of(cell, scenes, instrument, paths)
    optics, directions = instrument.spot_optics, instrument.lasers.directions
    drawn = [draw(cell, number, directions) for number in range(scenes)]
    targets = [
        Targets(
            each.range_m,
            each.reflectance * directions[:, 2],
            each.medium.extinction_per_m,
            each.medium.scattering_per_m * each.medium.backscatter_per_sr,
        )
        for each in drawn
    ]
    results = Results()
    scene = np.repeat(1000 * cell.seed + np.arange(scenes), len(directions))
    for klx in DAYLIGHT_KLX:
        received = light.at(instrument, klx)
        mean = instrument.tof.record(received, optics, None).readings
        draws = CLEAR_DRAWS if cell.visibility_m is None else 1
        again = replace(
            received,
            echo_per_s=np.tile(received.echo_per_s, (draws, 1, 1)),
            steady_per_s=np.tile(received.steady_per_s, (draws, 1)),
        )
        spots = instrument.tof.record(
            again, optics, np.random.default_rng([cell.seed, int(klx), 1])
        )
        bound_m = _bounds(make_bound(between(spots, 0, 0), LONGEST_M), targets, mean)
        for method in way.methods:
            range_m, sigma_m, valid, frame_s = _reported(method, spots)
            results[way.title, method, cell.name, klx] = Estimate(
                scene=np.tile(scene, draws),
                true_m=np.tile(np.concatenate([each.range_m for each in targets]), draws),
                range_m=range_m,
                sigma_m=sigma_m,
                valid=valid,
                bound_m=np.tile(bound_m, draws),
                frame_s=frame_s,
            )
    return results


def _bounds(bound: Bound, targets: Sequence[Targets], mean: NDArray[Any]) -> Floats:
    return np.concatenate(
        [bound(each, readings) for each, readings in zip(targets, mean, strict=True)]
    )


def _reported(method: str, spots: Spots) -> tuple[Floats, Floats, Mask, Floats]:
    """Ranges, their standard deviations, and which are valid, (spots,); seconds (frames,)."""
    solve = RANGING_METHODS[method].compile(between(spots, 0, 0))
    solve(between(spots, 0, 1))
    ranges, seconds = [], []
    for frame in range(len(spots.readings)):
        readings = between(spots, frame, frame + 1)
        began = thread_time()
        ranges.append(solve(readings))
        seconds.append(thread_time() - began)
    return (
        np.concatenate([each.range_m for each in ranges]),
        np.concatenate([each.sigma_m for each in ranges]),
        np.concatenate([each.valid for each in ranges]),
        np.array(seconds),
    )


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else np.nan


def table(way: Way, result: Results, scenes: int) -> Table:
    """All cells of an instrument."""
    rows = [
        (cell.name, f"{klx:g}", method, *_row(result[way.title, method, cell.name, klx]))
        for cell in CELLS
        for klx in DAYLIGHT_KLX
        for method in way.methods
    ]
    columns = (
        "visibility, ranges", "klx", "method", "bias, cm", "RMSE, cm", "valid, %",
        "within 1 σ, %", "wrong, %", "bound, cm", "RMSE / bound", "worst, m", "ms",
    )  # fmt: skip
    title = (
        f"`{way.title}`: {scenes} scenes of four spots a cell, in clear air with {CLEAR_DRAWS} "
        "draws of noise each. Errors are those of valid spots; within one σ with the 95 % interval "
        f"of Wilson; wrong is valid and off by more than {WRONG_M:g} m, of all spots. "
        "These are ranged without an image. The bound is "
        "that of Cramér and Rao for even fog of unknown coefficients, rms over the valid spots. "
        "Time is of a frame on one core."
    )
    return Table(title, columns, rows)


def _row(result: Estimate) -> tuple[str, ...]:
    error_m, valid = result.error_m, result.valid
    time = f"{1e3 * np.median(result.frame_s):.1f}"
    if not valid.any():
        return ("–", "–", "0", "–", "0", "–", "–", "–", time)
    return (
        f"{100 * error_m.mean():+.2f}",
        f"{100 * result.rmse_m:.2f}",
        f"{100 * valid.mean():.1f}",
        _percent(result.within),
        f"{100 * result.wrong.mean():.1f}",
        f"{100 * _rms(result.bound_m[valid]):.2f}",
        f"{result.ratio:.2f}",
        f"{np.abs(error_m).max():.2f}",
        time,
    )


def _percent(hits: NDArray[np.bool_]) -> str:
    """Per cent, and the 95 % interval of the fraction."""
    interval = binomtest(int(hits.sum()), hits.size).proportion_ci(method="wilson")
    return f"{100 * hits.mean():.0f} ({100 * interval.low:.0f}–{100 * interval.high:.0f})"


def promises(ways: Sequence[Way], result: Results, yardstick: Yardstick) -> list[Check]:
    """What ranging in fog is to reach."""
    checks: list[Check] = []
    for cell, limits in PROMISED.items():
        for klx in DAYLIGHT_KLX:
            where = f"fog, {cell}, {klx:g} klx"
            checks += _cell_checks(where, result["fog", "fog", cell, klx], limits)
    for klx in DAYLIGHT_KLX:
        plain, fitted = (result["fog", method, CLEAR, klx] for method in ("cw", "fog"))
        checks += _clear_checks(f"fog, {CLEAR}, {klx:g} klx", plain, fitted)
    for way in ways:
        reported = [each for key, each in result.items() if key[:2] == (way.title, "fog")]
        wrong, scene = (
            np.concatenate([getattr(each, name) for each in reported])
            for name in ("wrong", "scene")
        )
        name = f"{way.title}: wrong by {WRONG_M:g} m"
        checks.append(_fraction(name, wrong, scene, 0.005))
    single = result["fog-spad", "fog", "50 m, 7–9 m", DAYLIGHT_KLX[0]]
    frames = [each.frame_s for key, each in result.items() if key[:2] == ("fog", "fog")]
    frame_ms, interval_ms = yardstick.on_reference(1e3 * float(np.median(np.concatenate(frames))))
    return [
        *checks,
        _least_honest([each for key, each in result.items() if key[:2] == ("paper", "fog")]),
        _rmse("fog-spad, 50 m, 7–9 m, 10 klx: RMSE, m", single, 0.03),
        _fraction(
            "fog-spad, 50 m, 7–9 m, 10 klx: valid", single.valid, single.scene, 0.95, at_least=True
        ),
        Check("fog: ms per frame on the reference", frame_ms, 8.0, interval=interval_ms),
    ]


def _cell_checks(
    where: str, result: Estimate, limits: tuple[float, float, float, tuple[float, float]]
) -> list[Check]:
    bias_m, rmse_m, valid, (minimum, maximum) = limits
    error_m, scene = result.error_m, result.valid_scene
    bias = of_size(of_figure(lambda some: float(error_m[some].mean()), scene))
    checks = [
        Check(f"{where}: absolute bias, m", abs(float(error_m.mean())), bias_m, interval=bias)
    ]
    if np.isfinite(rmse_m):
        checks.append(_rmse(f"{where}: RMSE, m", result, rmse_m))
    return [
        *checks,
        _fraction(f"{where}: valid", result.valid, result.scene, valid, at_least=True),
        _fraction(f"{where}: within 1 sigma", result.within, scene, minimum, at_least=True),
        _fraction(f"{where}: within 1 sigma, most", result.within, scene, maximum),
    ]


def _clear_checks(where: str, plain: Estimate, fitted: Estimate) -> list[Check]:
    both = plain.valid & fitted.valid
    apart = (fitted.range_m - plain.range_m)[both] / plain.sigma_m[both]
    width = np.abs(np.log(fitted.sigma_m[both] / plain.sigma_m[both]))
    error_m, bound_m = fitted.error_m, fitted.bound_m[fitted.valid]
    over_bound = of_figure(
        lambda some: _rms(error_m[some]) / _rms(bound_m[some]), fitted.valid_scene, positive=True
    )
    different = of_figure(lambda some: _rms(apart[some]), fitted.scene[both], positive=True)
    wider = of_figure(lambda some: float(width[some].mean()), fitted.scene[both], positive=True)
    return [
        Check(f"{where}: RMSE / bound", fitted.ratio, 1.1, interval=over_bound),
        Check(f"{where}: rms difference from plain, sigmas", _rms(apart), 0.1, interval=different),
        Check(
            f"{where}: log of sigma over plain sigma, mean absolute",
            float(width.mean()),
            0.05,
            interval=wider,
        ),
    ]


def _fraction(
    name: str,
    hits: NDArray[np.bool_],
    scene: NDArray[np.intp],
    limit: float,
    *,
    at_least: bool = False,
) -> Check:
    """What is promised of all is judged by those that were drawn: no sample shows the others."""
    interval = of_fraction(hits, scene) if limit < 1 else None
    return Check(name, float(hits.mean()), limit, at_least, interval)


def _rmse(name: str, result: Estimate, limit_m: float) -> Check:
    error_m = result.error_m
    interval = of_figure(lambda some: _rms(error_m[some]), result.valid_scene, positive=True)
    return Check(name, result.rmse_m, limit_m, interval=interval)


def _least_honest(result: Sequence[Estimate]) -> Check:
    """The smallest of several fractions."""
    reported = [each for each in result if each.valid.any()]
    minimum = min((float(each.within.mean()) for each in reported), default=1.0)
    interval = of_minimum([of_fraction(each.within, each.valid_scene) for each in reported])
    return Check("paper: minimum fraction within 1 sigma", minimum, 0.6, True, interval)


if __name__ == "__main__":
    sys.exit(main())

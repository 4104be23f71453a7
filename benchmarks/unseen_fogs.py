"""Default ranges of the paper's single frequency, in worlds that no constant was chosen by.

Families, seeds and hazes are others than those that the physical constants of the ranging were
chosen by; natural fogs are of the same kinds, other draws. How finely fogs and ranges are searched
was settled with these figures in sight. Light is traced once and kept under out/ranging. What is
judged is what `reconstruct` gives first.
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from depth_sets import JUDGED_BY
from intervals import of_figure, of_fraction
from numpy.typing import NDArray
from scipy.stats import binomtest

import spisim
from reconstruction import Capture, Reconstructor, read_capture, write_capture
from reconstruction.base.arrays import Floats, Mask
from reconstruction.ranging import measure_ranges
from spisim.scene import draw_scene
from spisim_paper.checks import Check, Table

CACHE = Path(__file__).parents[1] / "out" / "ranging" / "unseen"
SEED = 991
WEATHERS = {"25–120 m": (25.0, 120.0), "200–500 m": (200.0, 500.0), "clear": None}
CAPTURES, QUICK_CAPTURES = (50, 25, 25), (2, 1, 1)
KINDS = (
    *("moderate-radiation", "heavy-radiation", "moderate-advection", "heavy-advection"),
    *("haze-l", "haze-m"),
)
WITHIN = {1: (0.64, 0.80), 2: (0.92, 0.98)}
"""Shares within so many sigmas that are promised, where the weather is not stated."""
MAX_WRONG, MAX_ERROR_M, MAX_WIDER = 0.01, 0.30, 3.0


@dataclass(frozen=True, eq=False)
class Judged:
    """Spots of all captures of a weather, each (n,): default and plain ranges, and the truth.

    ``capture`` is the number of each spot's capture; ``likeliest_m`` is there where the default
    gives no range, too; ``apart_m`` is by how much the ranges of the same readings stated clear
    differ from the plain ones, at most.
    """

    capture: NDArray[np.intp]

    true_m: Floats
    range_m: Floats
    sigma_m: Floats
    likeliest_m: Floats
    plain_m: Floats
    plain_sigma_m: Floats
    apart_m: float

    @property
    def reported(self) -> Mask:
        """Spots that have a range."""
        return np.isfinite(self.range_m)

    @property
    def sigmas(self) -> Floats:
        """Of spots that have a range, from the truth, in sigmas; infinite where nothing is."""
        away = np.abs(self.range_m - self.true_m) / self.sigma_m
        return np.where(np.isfinite(self.true_m), away, np.inf)[self.reported]

    @property
    def error_m(self) -> Floats:
        """Of spots that have a range and meet something."""
        away = (self.range_m - self.true_m)[self.reported]
        return away[np.isfinite(away)]


def judged(*, quick: bool) -> dict[str, Judged]:
    """All weathers; captures that are not kept from before are made first."""
    results = {weather: [] for weather in WEATHERS}
    for weather, capture in _captures(QUICK_CAPTURES if quick else CAPTURES):
        results[weather].append(_spots(capture))
    return {
        weather: Judged(
            np.repeat(np.arange(len(spots)), [each[0].shape[1] for each in spots]),
            *np.concatenate([each[0] for each in spots], axis=1),
            max(each[1] for each in spots),
        )
        for weather, spots in results.items()
    }


def _spots(capture: Capture) -> tuple[Floats, float]:
    assert capture.spots is not None
    assert capture.truth is not None
    default = _first(capture, None)
    stated = _first(capture, "clear")
    plain = measure_ranges(capture.spots)
    apart_m = np.nan_to_num(np.abs(stated.range_m - plain.range_m)).max()
    rows = (
        *(capture.truth.spot_range_m[0], default.range_m, default.sigma_m, default.likeliest[0]),
        *(plain.range_m, plain.sigma_m),
    )
    return np.array(rows), float(apart_m)


def _first(capture: Capture, weather: str | None):
    reconstruct = Reconstructor(capture.setup, image="edge-preserving", depth=(), weather=weather)
    return reconstruct(capture.frame()).ranges


def _captures(counts: tuple[int, ...]) -> Iterator[tuple[str, Capture]]:
    weathers = [name for name, count in zip(WEATHERS, counts, strict=True) for _ in range(count)]
    np.random.default_rng(SEED).shuffle(weathers)
    CACHE.mkdir(parents=True, exist_ok=True)
    for number, weather in enumerate(weathers):
        path = CACHE / f"{'-'.join(map(str, counts))}-{number:04d}.h5"
        if not path.exists():
            print(f"simulating {path.stem}: {weather}", file=sys.stderr, flush=True)
            write_capture(_simulated(number, weather), path)
        yield weather, read_capture(path)


def _simulated(number: int, weather: str) -> Capture:
    rng = np.random.default_rng([SEED, number])
    family, seed = JUDGED_BY[rng.integers(len(JUDGED_BY))], int(rng.integers(1000, 100_000))
    limits = WEATHERS[weather]
    low, high = limits or WEATHERS["200–500 m"]
    visibility_m = float(np.exp(rng.uniform(np.log(low), np.log(high))))
    kind = str(rng.choice(KINDS))
    rng.random()
    fog = None if limits is None else {"visibility_m": visibility_m, "kind": kind}
    changes = {"rain": None, "snow": None, "fog": fog}
    scene = draw_scene(family, seed, changes=changes)
    return spisim.simulate(
        scene,
        spisim.load_instrument("paper"),
        transport_noise_share=0.5,
        seed=int(rng.integers(2**31)),
    ).capture


def table(results: dict[str, Judged]) -> Table:
    """A row for each weather."""
    columns = (
        "weather", "spots", "with a range, %", "median error, cm", "of all likeliest, cm",
        "bias, cm", "median σ, cm", "over plain σ", "within 1 σ, %", "within 2 σ, %",
        "beyond 3 σ, %", "worst, σ", "plain: median error, cm", "within 1 σ, %",
    )  # fmt: skip
    title = (
        "`paper` at its defaults, the weather not stated: captures of drawn scenes whose families, "
        "seeds and hazes no physical constant was chosen by; natural fogs are of the same kinds, "
        "other draws. Shares with the 95 % interval of Wilson."
    )
    return Table(title, columns, [(weather, *_row(each)) for weather, each in results.items()])


def _row(each: Judged) -> tuple[str, ...]:
    away = each.sigmas
    likeliest = np.abs(each.likeliest_m - each.true_m)
    plain = np.abs(each.plain_m - each.true_m)
    plain_within = (plain < each.plain_sigma_m)[np.isfinite(each.plain_m)]
    return (
        f"{each.reported.size}",
        f"{100 * each.reported.mean():.0f}",
        f"{100 * np.median(np.abs(each.error_m)):.1f}",
        f"{100 * np.nanmedian(likeliest[each.true_m < MAX_RANGE_M]):.1f}",
        f"{100 * np.median(each.error_m):+.1f}",
        f"{100 * np.median(each.sigma_m[each.reported]):.1f}",
        f"{_wider(each):.2f}",
        _fraction(away < 1),
        _fraction(away < 2),
        _fraction(away > 3),
        f"{away.max():.1f}",
        f"{100 * np.nanmedian(plain):.1f}",
        _fraction(plain_within),
    )


MAX_RANGE_M = 10.0
"""Where the paper's single frequency repeats."""


def _wider(each: Judged) -> float:
    return _median_wider(*_sigmas(each)[:2])


def _sigmas(each: Judged) -> tuple[Floats, Floats, NDArray[np.intp]]:
    """Those of default and plain ranges where there are both, and their captures."""
    both = each.reported & np.isfinite(each.plain_sigma_m)
    return each.sigma_m[both], each.plain_sigma_m[both], each.capture[both]


def _median_wider(sigma_m: Floats, plain_sigma_m: Floats) -> float:
    return float(np.median(sigma_m) / np.median(plain_sigma_m))


def _fraction(hits: Mask) -> str:
    interval = binomtest(int(hits.sum()), hits.size).proportion_ci(method="wilson")
    return f"{100 * hits.mean():.0f} ({100 * interval.low:.0f}–{100 * interval.high:.0f})"


def promises(results: dict[str, Judged]) -> list[Check]:
    """What default ranges are to reach where nobody states the weather, and where it is stated."""
    checks = []
    for weather, each in results.items():
        where = f"paper, {weather}, weather unknown"
        away, capture = each.sigmas, each.capture[each.reported]
        for sigmas, (minimum, maximum) in WITHIN.items():
            within = away < sigmas
            fraction, interval = float(within.mean()), of_fraction(within, capture)
            checks += [
                Check(f"{where}: within {sigmas} sigma", fraction, minimum, True, interval),
                Check(f"{where}: within {sigmas} sigma, most", fraction, maximum, False, interval),
            ]
        beyond = away > 3
        checks += [
            Check(
                f"{where}: beyond 3 sigma",
                float(beyond.mean()),
                MAX_WRONG,
                interval=of_fraction(beyond, capture),
            ),
            _median_error(where, each),
            Check(f"paper, {weather}, stated clear: off the plain range, m", each.apart_m, 0.0),
        ]
        if weather != next(iter(WEATHERS)):
            checks.append(_median_sigma(where, each))
    return checks


def _median_error(where: str, each: Judged) -> Check:
    finite = np.isfinite(each.true_m[each.reported])
    error_m, capture = np.abs(each.error_m), each.capture[each.reported][finite]
    interval = of_figure(lambda some: float(np.median(error_m[some])), capture, positive=True)
    return Check(
        f"{where}: median error, m", float(np.median(error_m)), MAX_ERROR_M, interval=interval
    )


def _median_sigma(where: str, each: Judged) -> Check:
    sigma_m, plain_sigma_m, capture = _sigmas(each)
    interval = of_figure(
        lambda some: _median_wider(sigma_m[some], plain_sigma_m[some]), capture, positive=True
    )
    name = f"{where}: median sigma over the plain"
    return Check(name, _median_wider(sigma_m, plain_sigma_m), MAX_WIDER, interval=interval)

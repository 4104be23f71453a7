"""Ranges of four spots in even and in uneven fog: how many are `ok`, and how many of these wrong.

    python benchmarks/corner_ranges.py [--quick] [--json]

Fog is even, or a bank before two of four spots or before all, or patches; its light is scattered
once, so that hundreds of fogs take a minute. `benchmarks/ranging.py` has all orders.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from intervals import of_fraction
from options import benchmark_options, finish

from reconstruction.base.arrays import Floats, Mask
from reconstruction.capture.schema import between
from reconstruction.ranging import ranging_method
from reconstruction.ranging.fog.overlap import overlap, path_lengths
from spisim.instrument import Instrument, SpotLight, load_instrument
from spisim_paper.checks import Check, Table, surroundings

DOCS = Path(__file__).parents[1] / "docs" / "results" / "ranging.md"
PRESETS = "fog", "paper"
KINDS = "even", "bank before two", "bank before all", "patches"
FRAMES, QUICK_FRAMES = 400, 20
WRONG_M = 0.3
EVEN, UNEVEN = 0.005, 0.01
"""Maximum fraction of the ok ranges that are off by more than WRONG_M."""
STEP_M = 0.005
RANGE_M = np.arange(0.05, 12.0, STEP_M) + STEP_M / 2
PATH_M = np.arange(2400) * 0.0125
STEADY_PER_S = 1e10
"""Of a sky of some 5 klx."""
KOSCHMIEDER = 3.912


@dataclass(frozen=True, eq=False)
class Record:
    """Spots of a preset in a kind of fog, (frames * 4,): true and reported ranges, and statuses."""

    preset: str
    kind: str
    frame: Floats
    true_m: Floats
    range_m: Floats
    ok: Mask
    valid: Mask

    @property
    def wrong(self) -> Mask:
        """Which spots are off by more than WRONG_M; not those without a range."""
        return np.asarray(np.abs(self.range_m - self.true_m) > WRONG_M)


def even_and_uneven(quick: bool) -> list[Record]:
    """Records of all presets and kinds of fog."""
    frames = QUICK_FRAMES if quick else FRAMES
    return [_measured(preset, kind, frames) for preset in PRESETS for kind in KINDS]


def range_checks(records: Sequence[Record]) -> Iterator[Check]:
    """What is promised of ok ranges."""
    for preset in PRESETS:
        for name, limit, kinds in (("even", EVEN, KINDS[:1]), ("uneven", UNEVEN, KINDS[1:])):
            some = [each for each in records if each.preset == preset and each.kind in kinds]
            wrong = np.concatenate([each.wrong[each.ok] for each in some])
            scene = np.concatenate([each.frame[each.ok] for each in some])
            yield Check(
                f"{preset}, {name} fog: ok ranges off by {WRONG_M:g} m",
                float(wrong.mean()) if wrong.size else 0.0,
                limit,
                interval=of_fraction(wrong, scene) if wrong.size else None,
            )


def table(records: Sequence[Record]) -> Table:
    """Counts of all records."""
    rows = [
        (
            each.preset,
            each.kind,
            str(each.ok.size),
            *(f"{some.sum()} / {(some & each.wrong).sum()}" for some in (each.ok, each.valid)),
        )
        for each in records
    ]
    return Table(
        f"Spots that are ok, and with any range, and those of them off by more than {WRONG_M:g} m.",
        ("preset", "fog", "spots", "ok / wrong", "ranged / wrong"),
        rows,
    )


def _measured(preset: str, kind: str, frames: int) -> Record:
    instrument = load_instrument(preset)
    optics = instrument.spot_optics
    geometry = overlap(optics, RANGE_M)[0], path_lengths(optics, RANGE_M)
    given = [_drawn(instrument, geometry, kind, number) for number in range(frames)]
    light = SpotLight(
        PATH_M,
        np.array([echo for _, echo in given]),
        np.full((frames, 4), STEADY_PER_S),
        instrument.lasers.power_w,
    )
    seed = [PRESETS.index(preset), KINDS.index(kind)]
    spots = instrument.tof.record(light, optics, np.random.default_rng(seed))
    solve = ranging_method("fog", spots).compile(between(spots, 0, 0))
    result = [solve(between(spots, number, number + 1)) for number in range(frames)]
    return Record(
        preset=preset,
        kind=kind,
        frame=np.repeat(np.arange(float(frames)) + 1e4 * KINDS.index(kind), 4),
        true_m=np.concatenate([true_m for true_m, _ in given]),
        range_m=np.concatenate([each.range_m for each in result]),
        ok=np.array([status == "ok" for each in result for status in each.status]),
        valid=np.concatenate([each.valid for each in result]),
    )


def _drawn(
    instrument: Instrument, geometry: tuple[Floats, Floats], kind: str, number: int
) -> tuple[Floats, Floats]:
    """Ranges (4,), and electrons per second by path (4, paths), of a drawn scene."""
    rng = np.random.default_rng([KINDS.index(kind), number, 2026])
    density_per_m = _densities(kind, rng)
    backscatter_per_sr = 0.035 * np.exp(0.4 * rng.standard_normal())
    reflectance = rng.uniform(0.05, 0.8, 4)
    range_m = rng.uniform(0.5, 9.0) * (1 + 0.02 * rng.standard_normal(4))
    if rng.random() < 0.5:
        range_m = rng.uniform(0.5, 9.0, 4)
    weight, path_m = geometry
    left = np.exp(-2 * STEP_M * np.cumsum(density_per_m, axis=1))
    fog = density_per_m * backscatter_per_sr * STEP_M * (range_m[:, None] > RANGE_M)
    amounts = fog * weight * left
    ends = np.searchsorted(RANGE_M, range_m)
    echo = np.zeros((4, PATH_M.size))
    electrons = instrument.electrons_per_joule(instrument.tof.detector, "laser")
    for spot in range(4):
        _deposit(echo[spot], path_m[spot], amounts[spot])
        seen, path = (np.interp(range_m[spot], RANGE_M, each[spot]) for each in geometry)
        target = reflectance[spot] / np.pi * seen * left[spot, ends[spot]]
        _deposit(echo[spot], np.array([path]), np.array([target]))
    return range_m, electrons * instrument.lasers.power_w * echo


def _densities(kind: str, rng: np.random.Generator) -> Floats:
    """Extinctions (4, ranges)."""
    extinction_per_m = KOSCHMIEDER / np.exp(rng.uniform(np.log(8), np.log(40)))
    if kind == "even":
        return np.full((4, RANGE_M.size), KOSCHMIEDER / np.exp(rng.uniform(*np.log([10, 150]))))
    if kind == "patches":
        return extinction_per_m / 2 * _patches(rng, rng.uniform(0.5, 1.5), rng.uniform(0.5, 3))
    first_m = rng.uniform(0, 3)
    bank = (first_m < RANGE_M) & (first_m + rng.uniform(1, 8) > RANGE_M)
    spots = rng.permutation(4) < (2 if kind == "bank before two" else 4)
    return np.asarray(extinction_per_m * bank * spots[:, None])


def _patches(rng: np.random.Generator, contrast: float, length_m: float) -> Floats:
    """Log-normal densities (4, ranges) of mean 1; farther off the beams have less in common."""
    log_variance = np.log1p(contrast**2)
    every_m = np.arange(0, RANGE_M[-1] + 0.1, 0.1)
    apart_m = np.abs(every_m[:, None] - every_m)
    root = np.linalg.cholesky(np.exp(-apart_m / length_m) + 1e-9 * np.eye(every_m.size))
    fields = root @ rng.standard_normal((every_m.size, 5))
    common = np.exp(-0.2 * every_m / length_m)[:, None]
    field = np.sqrt(common) * fields[:, :1] + np.sqrt(1 - common) * fields[:, 1:]
    log = np.sqrt(log_variance) * field - log_variance / 2
    return np.exp([np.interp(RANGE_M, every_m, each) for each in log.T])


def _deposit(bins: Floats, path_m: Floats, amount: Floats) -> None:
    """Share amounts between the two nearest bins, so that the mean path stays."""
    position = path_m / (PATH_M[1] - PATH_M[0])
    low = position.astype(int)
    np.add.at(bins, low, amount * (low + 1 - position))
    np.add.at(bins, low + 1, amount * (position - low))


def main() -> int:
    """Measure and print; the exit status is 1 if a promise is broken."""
    options = benchmark_options(__doc__, f"{QUICK_FRAMES} frames of each kind", DOCS)
    around = surroundings(("spisim", "numpy"))
    records = even_and_uneven(options.quick)
    return finish(options, DOCS, "uneven", around, [table(records)], list(range_checks(records)))


if __name__ == "__main__":
    raise SystemExit(main())

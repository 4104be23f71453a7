"""Wrongly calibrated paths in fog: how often they are reported, and right ones by mistake.

    python benchmarks/path_offsets.py [--quick] [--json] [--markdown]

Preset `fog` and the light of `benchmarks/ranging.py`, with the path of one spot taken for longer or
not. Recordings are drawn from frames of all scenes of a cell, each with its own noise, none twice.
`--markdown` pastes the table into docs/results/ranging.md.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from foglight import Cell, light_of
from options import benchmark_options, finish

from reconstruction.capture.schema import between
from reconstruction.ranging.fog.offsets import OffsetEvidence, PathOffsets, path_check, path_offsets
from spisim.instrument import Instrument, load_instrument
from spisim_paper.checks import Check, Table, surroundings

DOCS = Path(__file__).parents[1] / "docs" / "results" / "ranging.md"
CELLS = (
    Cell("20 m, 2–4 m", 20, 2, 4, seed=4),
    Cell("50 m, 4–6 m", 50, 4, 6, seed=1),
    Cell("100 m, 7–9 m", 100, 7, 9, seed=3),
    Cell("unseen, 50 m, 4–9 m", 50, 4, 9, "unseen", seed=6),
    Cell("patchy, 50 m, 4–9 m", 50, 4, 9, "patchy", seed=7),
)
SCENES, PATHS = 50, 2**15
QUICK_SCENES, QUICK_PATHS = 4, 2**12
DRAWS, QUICK_DRAWS = 8, 2  # of noise for each scene
KLX = 10.0
SPOT, SPOTS, OFFSETS_M = 2, 4, (0.0, 0.05, 0.1, 0.2)
RECORDINGS = 300
Told = list[list[OffsetEvidence | None]]  # by draw of noise and scene


def main() -> int:
    """Measure and print; the exit status is 1 if a promise is broken."""
    options = benchmark_options(__doc__, "four scenes a cell, of fewer paths", DOCS)
    scenes, paths, draws = (
        (QUICK_SCENES, QUICK_PATHS, QUICK_DRAWS) if options.quick else (SCENES, PATHS, DRAWS)
    )
    instrument = load_instrument("fog")
    rows: list[tuple[str, ...]] = []
    alarms: list[float] = []
    for cell in CELLS:
        for offset_m in OFFSETS_M:
            reported = evidence(instrument, cell, offset_m, (scenes, paths, draws))
            for frames in (scenes // 2, scenes):
                result = recordings(reported, frames, np.random.default_rng([cell.seed, frames]))
                hits = np.array([each.significant for each in result])
                others = np.delete(hits, SPOT, axis=1).any(axis=1).mean()
                if not offset_m:
                    alarms.append(float(hits.any(axis=1).mean()))
                rows.append(_row(cell, offset_m, frames, result, float(others)))
    table = Table(
        f"One spot's path taken for longer, by so many frames: {RECORDINGS} recordings each.",
        ("visibility, ranges", "longer by, cm", "frames", "estimate, cm", "σ, cm",
         "that spot reported, %", "another reported, %"),
        rows,
    )  # fmt: skip
    checks = [
        Check("right paths reported as wrong, fraction of recordings", float(np.mean(alarms)), 0.01)
    ]
    around = surroundings(("spisim", "mitsuba", "drjit", "numpy", "scipy"))
    return finish(options, DOCS, "offsets", around, [table], checks)


def evidence(
    instrument: Instrument, cell: Cell, offset_m: float, size: tuple[int, int, int]
) -> Told:
    """Of every scene with several draws of noise."""
    scenes, paths, draws = size
    given = light_of(cell, scenes, instrument, paths).at(instrument, KLX)
    longer = replace(given, path_length_m=given.path_length_m + offset_m)
    tof, optics = instrument.tof, instrument.spot_optics
    reported: Told = []
    for draw in range(draws):
        rng = np.random.default_rng([cell.seed, draw, 2])
        spots = tof.record(given, optics, rng)
        spots.readings[:, SPOT] = tof.record(longer, optics, rng).readings[:, SPOT]
        find = path_check(between(spots, 0, 0))
        reported.append([find(between(spots, number, number + 1)) for number in range(scenes)])
    return reported


def recordings(reported: Told, frames: int, rng: np.random.Generator) -> list[PathOffsets]:
    """Of so many different scenes, in any order, each with one of its draws of noise."""
    draws, scenes = len(reported), len(reported[0])
    return [
        path_offsets(
            [reported[rng.integers(draws)][scene] for scene in rng.permutation(scenes)[:frames]],
            SPOTS,
        )
        for _ in range(RECORDINGS)
    ]


def _row(
    cell: Cell, offset_m: float, frames: int, result: list[PathOffsets], others: float
) -> tuple[str, ...]:
    return (
        cell.name,
        f"{100 * offset_m:g}",
        str(frames),
        f"{100 * np.mean([each.offset_m[SPOT] for each in result]):+.1f}",
        f"{100 * np.median([each.sigma_m[SPOT] for each in result]):.1f}",
        f"{100 * np.mean([each.significant[SPOT] for each in result]):.1f}",
        f"{100 * others:.1f}",
    )


if __name__ == "__main__":
    sys.exit(main())

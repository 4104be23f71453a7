"""How good pursuits are, by dictionary, one by one and averaged.

    pip install 'spisim[benchmarks,wavelets]'
    python benchmarks/pursuits.py [--quick] [--json] [--markdown]

On the recordings of image_quality.py, with which the dictionary `learned` shares no family of
scenes. `--markdown` pastes the tables into docs/results/images.md.
"""

import sys
from collections import defaultdict
from dataclasses import dataclass, field
from time import process_time

import numpy as np
from image_quality import (
    PACKAGES,
    PAGE,
    Case,
    Image,
    cases,
    interval,
    level_of,
    metrics,
    squared_error,
)
from options import benchmark_options, finish

from reconstruction import Reconstructor
from reconstruction.capture import first_patterns
from spisim_paper.checks import Check, Table, surroundings

FRACTIONS = (0.03125, 0.125)
REFERENCE, EDGES = "least-squares", "edge-preserving"
DICTIONARIES = ("dct", "haar", "db4", "learned")
PURSUIT, AVERAGED = (
    tuple(f"{method}:{name}" for name in DICTIONARIES) for method in ("pursuit", "random-pursuit")
)
METHODS = (REFERENCE, EDGES, *PURSUIT, *AVERAGED)


@dataclass
class Quality:
    """Of one method: correlation and PSNR of every image, and processor time."""

    correlation: list[float] = field(default_factory=list)
    psnr_db: list[float] = field(default_factory=list)
    cost_ms: list[float] = field(default_factory=list)
    error_over_sigma: list[float] = field(default_factory=list)


Estimate = dict[tuple[str, float], dict[str, Quality]]


def main() -> int:
    """Quality by row, sampling ratio and method."""
    options = benchmark_options(__doc__, "every fourth image, at the lowest sampling ratio", PAGE)
    result: Estimate = defaultdict(lambda: defaultdict(Quality))
    for fraction in FRACTIONS[: 1 if options.quick else None]:
        compiled: dict[bytes, dict[str, Reconstructor]] = {}
        for number, case in enumerate(cases()):
            if not (options.quick and number % 4):
                measure(case, fraction, compiled, result[case.row, fraction])
    tables = [
        table(result, "correlation", "Correlation with the true image, by dictionary", 3),
        table(result, "psnr_db", "PSNR, dB, by dictionary", 2),
        costs(result),
    ]
    return finish(options, PAGE, "pursuits", surroundings(PACKAGES), tables, checks(result))


def measure(
    case: Case,
    fraction: float,
    compiled: dict[bytes, dict[str, Reconstructor]],
    outcome: dict[str, Quality],
) -> None:
    """Add one recording to what is ``outcome``; what is ``compiled`` serves all of its patterns."""
    plan = case.capture.plan
    capture = first_patterns(case.capture, min(round(fraction * plan.pixels), plan.sampled))
    digest = capture.setup.digest(0)
    if digest not in compiled:
        compiled[digest] = {
            name: Reconstructor(capture.setup, image=name, ranging=(), depth=()) for name in METHODS
        }
        for each in compiled[digest].values():
            each(capture.frame())
    flat = squared_error(np.full_like(case.truth, case.truth.mean()), case.truth)
    without_dc = capture.plan.patterns.dc_row not in capture.plan.index
    for name, reconstruct in compiled[digest].items():
        started = process_time()
        result = reconstruct(capture.frame())
        took = process_time() - started
        image = result.images[name].astype(np.float64)
        if without_dc or case.row == "measured car":
            image = level_of(image, case.truth)
        quality = metrics(image, case.truth, flat)
        outcome[name].correlation.append(quality["correlation"])
        outcome[name].psnr_db.append(quality["psnr_db"])
        outcome[name].cost_ms.append(1e3 * took)
        if name in result.sigmas:
            variance = float(np.mean(result.sigmas[name].astype(np.float64) ** 2))
            outcome[name].error_over_sigma.append(squared_error(image, case.truth) / variance)


def table(result: Estimate, metric: str, title: str, digits: int) -> Table:
    """Means by row and method."""
    rows = [
        (
            row,
            f"{100 * fraction:.3g}",
            *(f"{np.mean(getattr(each[name], metric)):.{digits}f}" for name in METHODS),
        )
        for (row, fraction), each in result.items()
    ]
    return Table(title, ("recordings", "patterns, %", *METHODS), rows)


def costs(result: Estimate) -> Table:
    """Of each method over all recordings: what it gains on least squares, and what it costs."""
    rows = []
    for name in METHODS:
        gain = gains(result, name)
        ratio = [each for row in result.values() for each in row[name].error_over_sigma]
        rows.append(
            (
                name,
                "{:+.4f} ({:+.4f} to {:+.4f})".format(gain.mean(), *interval(gain)),
                f"{gain.min():+.3f}",
                f"{np.sqrt(np.median(ratio)):.2f}" if ratio else "–",
                *(
                    f"{np.median(cost_ms(result, name, fraction)):.1f}"
                    for fraction in sorted({fraction for _, fraction in result})
                ),
            )
        )
    columns = (
        "method",
        "correlation over least squares, all recordings",
        "worst",
        "error over its sigma, median",
        *(
            f"ms a frame, {100 * fraction:.3g} %"
            for fraction in sorted({fraction for _, fraction in result})
        ),
    )
    return Table("Gain and cost", columns, rows)


def gains(result: Estimate, name: str) -> Image:
    """Correlation over that of least squares, of every recording at every share."""
    return np.concatenate(
        [
            np.subtract(each[name].correlation, each[REFERENCE].correlation)
            for each in result.values()
        ]
    )


def cost_ms(result: Estimate, name: str, fraction: float) -> list[float]:
    """Processor time of every frame at a sampling ratio."""
    return [ms for (_, of), each in result.items() if of == fraction for ms in each[name].cost_ms]


def checks(result: Estimate) -> list[Check]:
    """What is promised: that the mean of pursuits is worth more than one of them."""
    single, averaged = (
        gains(result, name) for name in ("pursuit:learned", "random-pursuit:learned")
    )
    return [
        Check(
            "correlation of averaged pursuits over a single one, learned dictionary",
            float((averaged - single).mean()),
            0.0,
            True,
        )
    ]


if __name__ == "__main__":
    sys.exit(main())

"""Batch-OMP, one frame and many, against SPAMS and scikit-learn; images per second from counts.

    python benchmarks/omp.py [--quick] [--json] [--markdown]

The sizes of the paper's Table 2: as many readings as patterns, 1024 random atoms of unit length, a
quarter as many of them taken as there are readings. All libraries get the same readings in double
precision on one thread, and take turns, so that a busy machine slows all alike. What depends on the
dictionary alone is computed beforehand where a library has a place for it: here, and in
scikit-learn's `orthogonal_mp_gram`. SPAMS chooses by what an atom explains together with those
before it, so its atoms may be others; scikit-learn's must be the same.

Images are made from counts with all that a frame needs, decoding and noise included, by processor
time. Needs `pip install 'spisim[benchmarks]'`.
"""

# ruff: noqa: E402
import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import sys
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import spams
from options import benchmark_options, finish
from reconstructor import in_turns, quotient
from sklearn.linear_model import orthogonal_mp, orthogonal_mp_gram
from yardstick import REFERENCE_S
from yardstick import work as yardstick_work

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from reconstruction.image import (
    DICTIONARIES,
    IMAGE_METHODS,
    Coefficients,
    Imaging,
    StrongestAtoms,
    UsableReadings,
    batch_omp,
)
from spisim_paper.checks import Check, Table, surroundings
from spisim_paper.table2 import PAPER, Row, readings

DOCS = Path(__file__).parents[1] / "docs" / "results" / "reconstruction.md"
ATOMS = 1024
FRAMES = 64
LIBRARIES = ("here", "SPAMS", "scikit-learn", "scikit-learn, Gram")
BATCH_OMP = "Batch-OMP alone"
PROMISED = {BATCH_OMP, "least-squares"}
"""What makes 1,000 images per second."""


def main() -> int:
    """Measure and print; the exit status is 1 if a promise is broken."""
    options = benchmark_options(__doc__, "fewer calls of each", DOCS)
    calls = 10 if options.quick else 100
    dictionary, measured, atoms = problem(PAPER[0])
    contenders(dictionary, measured, atoms)[0]()  # many frames: the pursuit is compiled
    around = surroundings(("numpy", "scipy", "numba", "spams-bin", "scikit-learn"))
    tables, checks = pursuits(calls)
    for name, put in devices().items():
        tables.append(on_a_device(name, put, max(calls // 10, 3)))
    more_tables, more_checks = images(calls)
    return finish(
        options, DOCS, "benchmark omp", around, tables + more_tables, checks + more_checks
    )


def pursuits(calls: int) -> tuple[list[Table], list[Check]]:
    """Time per frame, alone and of a batch, by library."""
    rows, checks = [], []
    for size in PAPER:
        dictionary, measured, atoms = problem(size)
        turns = {}
        for frames, repeated in ((1, calls), (FRAMES, max(calls // 10, 3))):
            work = contenders(dictionary, measured[:frames], atoms)
            turns[frames] = in_turns(work, repeated).T
            times = [f"{1e3 * each:.3f}" for each in np.median(turns[frames], axis=1) / frames]
            rows.append((size.name, f"{atoms} of {ATOMS}", f"{frames}", *times))
        here, theirs, sklearn, _ = turns[1]
        name = f"{size.name}, {size.patterns} readings"
        checks += [
            _ratio(f"{name}: one frame, time over SPAMS", here, theirs, 1.0),
            _ratio(f"{name}: one frame, scikit-learn over it", sklearn, here, 3.0, at_least=True),
            _ratio(
                f"{name}: {FRAMES} frames, SPAMS over it",
                turns[FRAMES][1],
                turns[FRAMES][0],
                2.0,
                at_least=True,
            ),
            Check(f"{name}: frames with other atoms", others(dictionary, measured, atoms), 0),
        ]
    columns = ("size", "atoms", "frames at once", *(f"{name}, ms" for name in LIBRARIES))
    return [Table("Time per frame of a pursuit:", columns, rows)], checks


def _ratio(
    name: str, above: Floats, below: Floats, limit: float, *, at_least: bool = False
) -> Check:
    value, interval = quotient(above, below)
    return Check(name, value, limit, at_least, interval)


def problem(size: Row) -> tuple[Floats, Floats, int]:
    """Dictionary (M, n) of random atoms, random readings (F, M), and how many atoms to take."""
    rng = np.random.default_rng(0)
    dictionary = rng.standard_normal((size.patterns, ATOMS))
    dictionary /= np.linalg.norm(dictionary, axis=0)
    return dictionary, rng.standard_normal((FRAMES, size.patterns)), size.patterns // 4


def contenders(dictionary: Floats, measured: Floats, atoms: int) -> list[Callable[[], Any]]:
    """The pursuit of frames (F, M) by each of the `LIBRARIES`, arrays laid out as it likes them."""
    gram = dictionary.T @ dictionary
    frames, columns = np.asfortranarray(measured.T), np.asfortranarray(dictionary)

    def here() -> Floats:
        energy = (measured**2).sum(axis=1)
        return batch_omp(gram, measured @ dictionary, energy, max_atoms=atoms)

    return [
        here,
        lambda: spams.omp(frames, columns, L=atoms, eps=0.0, numThreads=1),
        lambda: orthogonal_mp(columns, frames, n_nonzero_coefs=atoms),
        lambda: orthogonal_mp_gram(gram, dictionary.T @ frames, n_nonzero_coefs=atoms),
    ]


def others(dictionary: Floats, measured: Floats, atoms: int) -> int:
    """Number of frames for which scikit-learn takes other atoms."""
    here, _, sklearn, _ = (each() for each in contenders(dictionary, measured, atoms))
    return int(((here != 0) != (sklearn.T != 0)).any(axis=1).sum())


def devices() -> dict[str, Callable[[Floats], Any]]:
    """What puts an array on the graphics processor, by library; empty where there is none."""
    result: dict[str, Callable[[Floats], Any]] = {}
    if find_spec("torch") is not None:
        import torch

        if torch.cuda.is_available():
            result["PyTorch"] = lambda values: torch.asarray(values, device="cuda")
    if find_spec("cupy") is not None:
        import cupy

        result["CuPy"] = cupy.asarray
    return result


def on_a_device(name: str, put: Callable[[Floats], Any], calls: int) -> Table:
    """Time on the clock per frame of batches there, from readings to coefficients, and here."""
    rows = []
    for size in PAPER:
        dictionary, _, atoms = problem(size)
        gram = dictionary.T @ dictionary
        backends = [(dictionary, gram, np.asarray), (put(dictionary), put(gram), put)]
        for frames in (FRAMES, 16 * FRAMES):
            measured = np.random.default_rng(1).standard_normal((frames, size.patterns))
            took = [
                on_the_clock(partial(pursued, *backend, measured, atoms), calls)
                for backend in backends
            ]
            rows.append((size.name, f"{frames}", *(f"{1e3 * each / frames:.4f}" for each in took)))
    columns = ("size", "frames at once", "here, ms", f"GPU by {name}, ms")
    return Table("Time on the clock per frame of a pursuit:", columns, rows)


def pursued(
    columns: Any, gram: Any, put: Callable[[Floats], Any], measured: Floats, atoms: int
) -> Any:
    """Coefficients of readings that are in memory here, on the device of the columns."""
    given = put(measured)
    energy = (given**2).sum(axis=1)
    return batch_omp(gram, given @ columns, energy, max_atoms=atoms)


def on_the_clock(work: Callable[[], Any], calls: int) -> float:
    """Median time until the first number of the result is here."""
    seconds = []
    for _ in range(calls + 1):
        began = perf_counter()
        float(work()[0, 0])
        seconds.append(perf_counter() - began)
    return float(np.median(seconds[1:]))


def images(calls: int) -> tuple[list[Table], list[Check]]:
    """Images per second from counts, by method."""
    rows: dict[str, list[str]] = {}
    checks = []
    for size in PAPER:
        plan, counts = readings(size)
        usable = Imaging(plan).of(np.ones(plan.exposures, dtype=bool))
        solvers = methods(usable, size.patterns // 4)
        work = [from_counts(usable, counts, solve) for solve in solvers.values()]
        *turns, yardstick = in_turns([*work, yardstick_work], calls).T
        for name, seconds in zip(solvers, turns, strict=True):
            rows.setdefault(name, []).append(f"{1 / np.median(seconds):,.0f}")
            if name in PROMISED:
                check = f"{size.name}: ms per image from counts on the reference, {name}"
                checks.append(_ratio(check, 1e3 * REFERENCE_S * seconds, yardstick, 1.0))
    table = Table(
        "Images per second from counts on one core:",
        ("method", *(size.name for size in PAPER)),
        [(name, *rates) for name, rates in rows.items()],
    )
    return [table], checks


def methods(usable: UsableReadings, atoms: int) -> dict[str, Callable[[Coefficients], Any]]:
    """Every method that suits, and Batch-OMP without anything around it."""
    solvers: dict[str, Callable[[Coefficients], Any]] = {BATCH_OMP: alone(usable, atoms)}
    for name in IMAGE_METHODS:
        try:
            solvers[name] = usable.solver(name)
        except InputError:
            continue
    return solvers


def alone(usable: UsableReadings, atoms: int) -> Callable[[Coefficients], Floats]:
    """Batch-OMP with the strongest cosines, each as strong as in natural images."""
    operator = usable.decoder.operator
    strongest = StrongestAtoms(operator, DICTIONARIES["dct"], ATOMS)
    columns = strongest.columns
    gram = columns.T @ columns

    def solve(coefficients: Coefficients) -> Floats:
        measured = coefficients.values[operator.varying] / operator.row_length
        values = batch_omp(gram, measured @ columns, measured @ measured, max_atoms=atoms)
        return strongest.image(values)

    return solve


def from_counts(
    usable: UsableReadings, counts: Floats, solve: Callable[[Coefficients], Any]
) -> Callable[[], Any]:
    """All that a frame takes; the variance of the counts is the counts."""
    return lambda: solve(usable.decode(counts, counts))


if __name__ == "__main__":
    sys.exit(main())

"""Samples a second of a data set read for training: packed, not packed, and by plain h5py."""

import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from options import benchmark_options, finish

import spisim
from reconstruction import InputError
from reconstruction.base.arrays import Floats
from spisim.dataset import DataSet, pack_dataset
from spisim_paper.checks import Check, Table, surroundings

PAGE = Path(__file__).parents[1] / "docs" / "results" / "datasets.md"
NAMES = ("buckets", "true_depth_m")
SIZE = 64
PATTERNS = 128
#: Promised of a pack, by one core.
PACKED_PER_S = 5000.0


@dataclass(frozen=True)
class Reader:
    """A way to read the arrays of a sample, how often it is asked."""

    read: Callable[[int], Any]
    times: int


def plan(samples: int) -> dict[str, Any]:
    """Boards in clear air and fog, by surrogate light: the files are those of traced light."""
    return {
        "name": "reading",
        "samples": samples,
        "light": "surrogate",
        "scenes": [{"family": "targets"}],
        "vary": {
            "scene.fog": {"choice": [None, {"kind": "moderate-radiation", "visibility_m": 50}]},
            "instrument.projector.shape": [SIZE, SIZE],
            "instrument.plan.patterns": PATTERNS,
        },
    }


def readers(data: DataSet, packed: DataSet, quick: bool) -> dict[str, Reader]:
    """All ways, each of which copies the arrays."""
    paths = [sample.path for sample in data]
    captures, rows = data.rows(*NAMES), packed.rows(*NAMES)
    often = 1 if quick else 5
    ways = {
        "a pack": Reader(lambda k: _copied(rows[k]), 1000 * often),
        "plain h5py, not checked": Reader(lambda k: by_h5py(paths[k]), 20 * often),
        "captures, checked": Reader(lambda k: _copied(captures[k]), 2 * often),
    }
    try:
        tensors = packed.torch(*NAMES)
    except InputError:  # without PyTorch
        return ways
    return {"a pack, as tensors": Reader(tensors.__getitem__, 1000 * often)} | ways


def _copied(row: dict[str, Any]) -> dict[str, Any]:
    return {name: np.array(values) for name, values in row.items()}


def by_h5py(path: Path) -> tuple[Floats, Floats]:
    """What stands in the file, the counts without their scale."""
    with h5py.File(path) as file:
        return file["buckets/counts"][()], file["truth/depth_m"][()]


def per_second(reader: Reader, samples: int) -> float:
    """Samples a second of processor time, in an order as a shuffle has it."""
    order = np.random.default_rng(0).integers(samples, size=reader.times).tolist()
    for position in range(samples):
        reader.read(position)
    began = time.process_time()
    for position in order:
        reader.read(position)
    return reader.times / (time.process_time() - began)


def main() -> int:
    """Exit status 0 if a pack is read as fast as promised."""
    options = benchmark_options(__doc__, "fewer samples", PAGE)
    samples = 6 if options.quick else 60
    with tempfile.TemporaryDirectory() as folder:
        data = spisim.make_dataset(plan(samples), Path(folder) / "set")
        began = time.process_time()
        packed = pack_dataset(data, Path(folder) / "pack", NAMES)
        pack_ms = 1e3 * (time.process_time() - began) / samples
        rates = {
            name: per_second(reader, samples)
            for name, reader in readers(data, packed, options.quick).items()
        }
    table = Table(
        f"Samples of {SIZE} × {SIZE} pixels, buckets and depth, read by one core",
        ("read from", "samples per second", "ms a sample"),
        [(name, f"{rate:,.0f}", f"{1e3 / rate:.3g}") for name, rate in rates.items()],
    )
    around = surroundings(("spisim", "numpy", "h5py", "torch"))
    cost = Table(f"Packing took {pack_ms:.0f} ms of processor time a sample.")
    checks = [Check("samples per second of a pack", rates["a pack"], PACKED_PER_S, at_least=True)]
    return finish(options, PAGE, "reading", around, [table, cost], checks)


if __name__ == "__main__":
    sys.exit(main())

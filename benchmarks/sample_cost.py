"""What samples cost by scene and weather, and how far the slowest is from the median.

    python benchmarks/sample_cost.py [--quick] [--json] [--markdown]

Clear air and fog of 40 m, 64 × 64 pixels, a transport noise share of 0.3; seconds of one core.
Every sample is made twice, and the second counts: kernels are compiled by then. Shelves in fog are
left out: glints of their jars and tins in fog take up to hours (docs/theory/transport.md).
`--markdown` pastes the tables into docs/results/datasets.md.
"""

import sys
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from options import benchmark_options, finish

from spisim.dataset.planned import load_plan
from spisim.dataset.sample import Maker
from spisim_paper.checks import Check, Table, surroundings

DOCS = Path(__file__).parents[1] / "docs" / "results" / "datasets.md"
PLAN = """
name: cost
samples: 1000
seed: 3
scenes:
  - {family: targets}
  - {family: targets, parameters: {distance_m: 3, bright: paint-white, setting: range}}
  - {family: person}
  - {family: warehouse}
  - {family: street-canyon}
  - {family: forest-trail}
  - {family: reflective-shelf}
every_scene: true
vary:
  weather:
    grid:
      - {scene.fog: null}
      - {scene.fog: {kind: moderate-radiation, visibility_m: 40}}
transport_noise_share: 0.3
"""
NAMES = (
    "targets",
    "white boards, 3 m, outdoors",
    "person",
    "warehouse",
    "street-canyon",
    "forest-trail",
    "reflective-shelf",
)
ROUNDS, QUICK_ROUNDS = 4, 1
LIMIT = 10.0


def main() -> int:
    """Measure and print; the exit status is 1 if the promise is broken."""
    options = benchmark_options(__doc__, "one sample of each kind", DOCS)
    around = surroundings(("spisim", "mitsuba", "drjit", "numpy"))
    kinds = [(scene, weather) for scene in NAMES for weather in ("clear", "fog, 40 m")]
    left_out = kinds.index(("reflective-shelf", "fog, 40 m"))
    rounds = range(QUICK_ROUNDS if options.quick else ROUNDS)
    chosen = [len(kinds) * each + kind for each in rounds for kind in range(len(kinds))]
    seconds = np.array(measure([k for k in chosen if k % len(kinds) != left_out]))
    del kinds[left_out]
    by_kind = seconds.reshape(-1, len(kinds)).T
    rows = [
        (*kind, f"{np.median(each):.2f}", f"{np.quantile(each, 0.9):.2f}", f"{each.max():.2f}")
        for kind, each in zip(kinds, by_kind, strict=True)
    ]
    every = (f"{np.median(seconds):.2f}", f"{np.quantile(seconds, 0.9):.2f}")
    rows.append(("all", "", *every, f"{seconds.max():.2f}"))
    table = Table(
        f"Seconds of one core, {by_kind.shape[1]} samples each:",
        ("scene", "weather", "median", "90 %", "max"),
        rows,
    )
    check = Check(
        "slowest sample over the median", float(seconds.max() / np.median(seconds)), LIMIT
    )
    return finish(options, DOCS, "cost", around, [table], [check])


def measure(indices: Iterable[int]) -> list[float]:
    """Processor seconds of samples of the plan."""
    seconds = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plan.yaml"
        path.write_text(PLAN)
        make = Maker(load_plan(path), Path(folder) / "set")
        for index in indices:
            make(index)
            began = time.process_time()
            outcome = make(index)
            seconds.append(time.process_time() - began)
            if not outcome.done:
                raise RuntimeError(f"sample {index} failed: {outcome.error}")
            print(f"sample {index}: {seconds[-1]:.2f} s", file=sys.stderr)
    return seconds


if __name__ == "__main__":
    sys.exit(main())

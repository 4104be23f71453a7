"""Scenes of a million triangles, and the ground truth of the shipped ones against trimesh.

    python benchmarks/scenes.py [--quick] [--json] [--markdown]

`--quick` looks at the truth of three scenes only. `--markdown` pastes the tables into
docs/results/scenes.md.
"""

import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from large import in_a_process, write_scenes
from options import benchmark_options, finish
from raycast import compare

import spisim
from spisim.scene import list_scenes
from spisim_paper.checks import Check, Table, surroundings

DOCS = Path(__file__).parents[1] / "docs" / "results" / "scenes.md"
SPP = 64

Section = tuple[Table, list[Check]]


def main() -> int:
    """Measure and print; the exit status is 1 if a promise is broken."""
    options = benchmark_options(__doc__, "truth of three scenes only", DOCS)
    around = surroundings(("spisim", "mitsuba", "drjit", "trimesh", "embreex", "numpy"))
    # Memory comes first: a process starts with the peak of the one that starts it.
    names = list_scenes()
    sections = (large(), truths(names[:: max(1, len(names) // 3)] if options.quick else names))
    tables = [table for table, _ in sections]
    checks = [check for _, promises in sections for check in promises]
    return finish(options, DOCS, "benchmark", around, tables, checks)


def large() -> Section:
    """Time and memory of a million triangles."""
    rows: list[tuple[str, ...]] = []
    checks: list[Check] = []
    spawn = multiprocessing.get_context("spawn")
    with TemporaryDirectory() as name:
        with ProcessPoolExecutor(1, mp_context=spawn) as pool:
            files = pool.submit(write_scenes, Path(name)).result()
        for kind, path in files.items():
            result = in_a_process(path, SPP)
            together = result.load_s + result.simulate_s
            rows.append(
                (
                    kind,
                    f"{result.triangles:,}",
                    f"{result.load_s:.1f}",
                    f"{result.simulate_s:.1f}",
                    f"{result.processor_s:.1f}",
                    f"{result.peak_gb:.2f}",
                )
            )
            word = kind.replace(" ", "_")
            checks.append(Check(f"seconds_{word}", together, 30))
            checks.append(Check(f"peak_gb_{word}", result.peak_gb, 3))
    title = (
        f"Loading, and simulating a capture of the paper's instrument with {SPP} paths per pixel, "
        "in a process of its own, in fog of 100 m."
    )
    columns = (
        "triangles as",
        "triangles",
        "load (s)",
        "simulate (s)",
        "all cores (s)",
        "peak (GB)",
    )
    return Table(title, columns, rows), checks


def truths(names: list[str]) -> Section:
    """Range of every pixel's centre, ours and trimesh's."""
    instrument = spisim.load_instrument("paper")
    rows: list[tuple[str, ...]] = []
    median, inside = 0.0, 0.0
    for name in names:
        result = compare(spisim.load_scene(name), instrument)
        difference = result.difference_m
        median = max(median, float(np.median(difference)))
        inside = max(inside, float(np.max(result.inside_m, initial=0)))
        rows.append(
            (
                name,
                f"{difference.size:,}",
                f"{1e6 * np.median(difference):.2g}",
                f"{1e6 * np.max(result.inside_m, initial=0):.2g}",
                f"{1e3 * difference.max():.2g}",
                str(int((difference > 1e-3).sum())),
                f"{1e6 * np.abs(result.spots_m).max():.2g}",
            )
        )
    title = (
        "Range of the truth against trimesh's ray casting, along the rays through the pixels' "
        "centres; moving scenes in the middle of the first frame. Pixels beside which the range "
        "steps by more than 2 % are edges: there, rays of single and double precision may pass on "
        "either side of a thing."
    )
    columns = (
        "scene",
        "pixels",
        "median (µm)",
        "largest inside (µm)",
        "largest (mm)",
        "off by 1 mm",
        "spots (µm)",
    )
    checks = [Check("median_m", median, 1e-3), Check("largest_inside_m", inside, 1e-3)]
    return Table(title, columns, rows), checks


if __name__ == "__main__":
    raise SystemExit(main())

"""The preset `fog` against an instrument that `spisim design` chooses, on scenes of other families.

    python benchmarks/inverse_design.py [--quick] [--json] [--markdown]

The search divides the time of the ranges among three frequencies and chooses the middle one, at the
power, frame time, optics and highest frequency of the preset, for small errors and few spots
without a range. Base and chosen instrument are compared in
the same scenes with the same noise; intervals are over scenes. Light and evaluations are kept in
the folder: an interrupted run goes on.
"""

import sys
from functools import partial
from pathlib import Path

from options import benchmark_options, finish

from reconstruction.base.files import write_atomically
from spisim.base.config import dump_yaml
from spisim.transport.backend import use_threads
from spisim_inverse.design.bench import TIMES
from spisim_inverse.design.judgement import BOUND, BY_BOTH, WITH_A_RANGE, WRONG, Compared
from spisim_inverse.design.objectives import OBJECTIVES
from spisim_inverse.design.page import write_design
from spisim_inverse.design.plan import load_design
from spisim_inverse.design.run import PAGE, Design, run_design
from spisim_paper.checks import Check, Interval, Table, surroundings

DOCS = Path(__file__).parents[1] / "docs" / "results" / "inverse.md"
FOLDER = Path(__file__).parents[1] / "out" / "design"
SEARCH = ("warehouse", "rubble", "tunnel", "scaffold", "forest-trail", "street-canyon")
JUDGEMENT = ("shipyard", "stairwell", "landing-pad", "reflective-shelf", "forest-edge", "bridge")
SEEN, UNSEEN, EVALUATIONS = 2, 3, 42
VISIBILITIES_M = (20, 50, 100)
CLEAR = "clear air"
GAIN = 0.85
"""Largest ratio of range errors in fog of 50 m that counts as better."""
LOST = 1.0
"""Per cent of the spots that may lose their range anywhere."""


def main() -> int:
    """Search, compare and print; the exit status is 1 if a promise is broken."""
    options = benchmark_options(
        __doc__, "times alone, two families, one weather", DOCS, folder=FOLDER
    )
    use_threads(1)
    design = searched(options.folder / ("quick" if options.quick else "full"), options.quick)
    tables = [chosen_table(design), compared_table(design)]
    around = surroundings(("spisim", "mitsuba", "numpy", "scipy"))
    return finish(options, DOCS, "design", around, tables, promises(design))


def searched(folder: Path, quick: bool) -> Design:
    """The finished design, with its page in the folder."""
    write_atomically(folder / "given.yaml", dump_yaml(plan(quick)).encode())
    design = run_design(load_design(folder / "given.yaml"), folder)
    write_design(folder / PAGE, design)
    return design


def plan(quick: bool) -> dict[str, object]:
    """The plan of the search."""
    foggy = {f"fog of {each} m": {"fog": {"visibility_m": each}} for each in VISIBILITIES_M}
    times = {"tof.times": {"low": [0.3, 0.3, 1.0], "high": [1.0, 1.0, 2.5]}}
    middles = [[15e6, each, 240e6] for each in (45e6, 60e6, 75e6)]
    frequencies = {"tof.modulation.frequencies_hz": {"values": middles}}
    whole = {
        "name": "ranging in fog",
        "instrument": "fog",
        "search": [{"family": name, "count": SEEN} for name in SEARCH],
        "judgement": [{"family": name, "count": UNSEEN} for name in JUDGEMENT],
        "weathers": {**foggy, CLEAR: {}},
        "choose": frequencies | times,
        "objectives": ["range_error_m", "range_missing"],
        "at_most": {"range_missing": 1.0},
        "evaluations": EVALUATIONS,
        "draws": 4,
    }
    if not quick:
        return whole
    return (
        whole
        | {
            "search": whole["search"][:2],  # type: ignore[index]
            "judgement": whole["judgement"][:2],  # type: ignore[index]
            "weathers": {"fog of 50 m": foggy["fog of 50 m"]},
            "choose": times,
            "evaluations": 20,
            "spp": 4,
        }
    )


def chosen_table(design: Design) -> Table:
    """What was chosen, and its figures on the scenes of the search."""
    assert design.base.figures is not None
    assert design.chosen.figures is not None
    ratio = design.chosen.figures["range_error_m"] / design.base.figures["range_error_m"]
    rows = [
        (name, _plain(name, old), _plain(name, new)) for name, (old, new) in design.changed.items()
    ]
    title = (
        f"Chosen among {len(design.evaluations)} instruments; the typical error of ranges on the "
        f"scenes of the search, in all weathers, is {ratio:.2f} of the preset's."
    )
    return Table(title, ("parameter", "`fog`", "chosen"), rows)


def compared_table(design: Design) -> Table:
    """Preset and chosen instrument on unseen scenes."""
    missing = OBJECTIVES["range_missing"].title  # the rest of those with a range
    rows = [
        (each.weather, each.name, *_values(each), _change(each))
        for each in design.judged
        if each.name != missing
    ]
    title = (
        "Both on scenes of families that the search has not seen: ratios of chosen to preset, or "
        "differences of per cent, with their 95 % intervals over scenes."
    )
    return Table(title, ("weather", "figure", "`fog`", "chosen", "change"), rows)


def promises(design: Design) -> list[Check]:
    """Better by 15 % in fog of 50 m, and nothing lost elsewhere."""
    rows = {(each.weather, each.name): each for each in design.judged}
    at = "fog of 50 m"
    rmse, bound = rows[at, BY_BOTH], rows.get((at, BOUND))
    checks = [
        Check(f"{at}: RMSE over that of the preset", rmse.change, GAIN, interval=rmse.interval)
    ]
    if bound is not None:
        over = rmse.chosen / bound.chosen
        checks.append(Check(f"{at}: RMSE of the chosen over its bound", over, 1.3))
    for (weather, name), each in rows.items():
        if name == BY_BOTH and weather != at:
            checks.append(
                Check(
                    f"{weather}: RMSE over that of the preset",
                    each.change,
                    1.0,
                    interval=each.interval,
                )
            )
        if name == WITH_A_RANGE:
            name, lost = f"{weather}: spots that lose their range, %", each.interval
            ends = partial(_reversed, lost)
            checks.append(Check(name, 0.0 - each.change, LOST, interval=ends))
        if name == WRONG:
            checks.append(Check(f"{weather}: more wrong ranges, %", each.change, LOST))
    return checks


def _reversed(interval: Interval, confidence: float) -> tuple[float, float]:
    low, high = interval(confidence)
    return 0.0 - high, 0.0 - low


def _plain(name: str, value: object) -> str:
    """Numbers of a parameter: frequencies in MHz, times as fractions of their sum."""
    if not isinstance(value, list):
        return str(value)
    unit = sum(value) if name == TIMES else 1e6
    text = ", ".join(f"{part / unit:.3g}" for part in value)
    return text if name == TIMES else f"{text} MHz"


def _values(each: Compared) -> tuple[str, str]:
    if each.is_fraction:
        return f"{each.base:.1f} %", f"{each.chosen:.1f} %"
    return f"{1e3 * each.base:.2f} mm", f"{1e3 * each.chosen:.2f} mm"


def _change(each: Compared) -> str:
    (low, high), digits = each.interval(), "+.1f" if each.is_fraction else ".2f"
    return f"{each.change:{digits}} ({low:{digits}} to {high:{digits}})"


if __name__ == "__main__":
    sys.exit(main())

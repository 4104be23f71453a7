"""The simulator and the reconstruction held against measurements of real sensors, rain and smoke.

    python benchmarks/measured.py [--data FOLDER] [--only SET] [--output FOLDER] [--quick] [--json]

FOLDER holds a folder for each set (`measured.sha256` lists their files); without it,
`SPISIM_MEASURED` names one. A missing set is reported, one of another hash is reported and compared
all the same, and the others go on. `--output` writes a page with pictures, `--markdown` that of
the docs.
"""

import importlib
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from measured_figures import Comparison, MeasuredSet
from measured_folder import Found, find
from options import benchmark_options, finish

from reconstruction.base.errors import InputError, nearest
from spisim_paper.checks import VERDICTS, Check, Table, surroundings, surroundings_line

DOCS = Path(__file__).parents[1] / "docs"
PAGE = DOCS / "results" / "measured.md"
DATA = "SPISIM_MEASURED"


@dataclass(frozen=True, eq=False)
class Outcome:
    """A set, where it was found, and what came of the comparison, or why nothing did."""

    of: MeasuredSet
    found: Found
    comparison: Comparison = field(default_factory=lambda: Comparison("", ()))
    error: str = ""

    @property
    def verdict(self) -> str:
        """Of all its checks together."""
        if self.error or self.found.folder is None:
            return "not compared"
        each = [check.holds for check in self.comparison.checks]
        return VERDICTS[False if False in each else None if None in each else True]

    @property
    def checks(self) -> list[Check]:
        """The promised figures, named with the set."""
        named = ((check, f"{self.of.folder}: {check.name}") for check in self.comparison.checks)
        return [
            Check(name, check.value, check.limit, check.at_least, check.interval)
            for check, name in named
        ]


def main() -> int:
    """Compare and print; the exit status is 1 if a promise is broken or nothing was compared."""
    options = benchmark_options(
        __doc__,
        "fewer samples",
        PAGE,
        others={
            "--data": {"type": Path, "default": _usual_data(), "help": "folder of the sets"},
            "--only": {"action": "append", "help": "a set to compare, instead of all"},
            "--output": {"type": Path, "help": "folder for a page with pictures"},
        },
    )
    try:
        outcomes = compared(options.data, options.only, quick=options.quick)
    except InputError as error:
        print(f"Error: {error}", file=sys.stderr)
        return 1
    around = surroundings(("spisim", "numpy", "scipy", "miepython"))
    checks = [check for outcome in outcomes for check in outcome.checks]
    if options.output is not None:
        options.output.mkdir(parents=True, exist_ok=True)
        tables = tables_of(outcomes, options.output, "")
        body = [surroundings_line(around), "", *(table.markdown() for table in tables)]
        text = "\n".join(["# Held against measurements", "", *body])
        (options.output / "index.md").write_text(text, encoding="utf-8")
    whole = all(outcome.found.state == "as published" for outcome in outcomes)
    if options.markdown and not (whole and options.only is None):
        print(f"{PAGE.name} stays as it is: it needs all sets as published", file=sys.stderr)
        options.markdown = False
    pictures = DOCS / "images" if options.markdown else None
    tables = tables_of(outcomes, pictures, "../images/")
    status = finish(options, PAGE, "measured", around, tables, checks)
    return status if checks else 1


def _usual_data() -> Path | None:
    named = os.environ.get(DATA)
    return Path(named) if named else None


def all_sets() -> list[MeasuredSet]:
    """The sets of every module `measured_NAME` beside this one."""
    names = sorted(path.stem for path in Path(__file__).parent.glob("measured_*.py"))
    modules = [importlib.import_module(name) for name in names]
    return [each for module in modules for each in getattr(module, "SETS", ())]


def compared(
    data: Path | None, only: Sequence[str] | None = None, *, quick: bool = False
) -> list[Outcome]:
    """Every set's outcome; one that is missing or fails to read does not stop the others.

    InputError for a folder of data that is not there, and unknown names in `only`.
    """
    if data is not None and not data.is_dir():
        raise InputError(f"--data: no folder {data}")
    sets = {each.folder: each for each in all_sets()}
    for name in only or ():
        if name not in sets:
            raise InputError(f"--only {name!r}: {nearest(name, sets)}")
    return [_outcome(sets[name], data, quick) for name in (only or sets)]


def _outcome(measured: MeasuredSet, data: Path | None, quick: bool) -> Outcome:
    found = find(measured, data)
    if not found.state.startswith("as "):
        print(f"{measured.folder}: {found.state}", file=sys.stderr)
    if found.folder is None:
        return Outcome(measured, found)
    try:
        return Outcome(measured, found, measured.compare(found.folder, quick))
    except InputError as error:
        print(f"{measured.folder}: {error}", file=sys.stderr)
        return Outcome(measured, found, error=str(error))


def tables_of(outcomes: Sequence[Outcome], pictures: Path | None, at: str) -> list[Table]:
    """What was found of every set, then each set's own tables, with its picture if it is saved."""
    rows = [
        (
            outcome.of.folder,
            outcome.of.source,
            f"{outcome.found.state}: {outcome.error}" if outcome.error else outcome.found.state,
            outcome.comparison.compared,
            outcome.verdict,
        )
        for outcome in outcomes
    ]
    tables = [Table("Sets:", ("set", "source", "data", "compared", ""), rows)]
    for outcome in outcomes:
        tables += outcome.comparison.tables
        if pictures is not None and outcome.comparison.picture is not None:
            name = f"measured-{outcome.of.folder}.png"
            outcome.comparison.picture.savefig(
                pictures / name, dpi=110, metadata={"Software": None}
            )
            tables.append(Table(f"![{outcome.of.folder}]({at}{name})"))
    return tables


if __name__ == "__main__":
    sys.exit(main())

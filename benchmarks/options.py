"""Command line of the benchmarks."""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from spisim_paper.checks import Check, Table, checks_table, paste, report


def benchmark_options(
    doc: str | None,
    quick: str,
    page: Path,
    *,
    folder: Path | None = None,
    others: Mapping[str, Mapping[str, Any]] | None = None,
) -> argparse.Namespace:
    """Options of a benchmark: `quick`, `json`, `markdown`, and `folder` if there is a usual one.

    The first line of `doc` says what it measures, `quick` what is left out, `page` where its tables
    go; in the folder stays what is worth keeping for another run. `others` are further options, as
    `add_argument` of a parser takes them.
    """
    parser = argparse.ArgumentParser(description=(doc or "").partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help=quick)
    parser.add_argument("--json", action="store_true", help="end with one JSON object")
    parser.add_argument("--markdown", action="store_true", help=f"paste into {page.name}")
    if folder is not None:
        parser.add_argument("--folder", type=Path, default=folder, help="where captures are kept")
    for name, details in (others or {}).items():
        parser.add_argument(name, **details)
    return parser.parse_args()


def finish(
    options: argparse.Namespace,
    page: Path,
    mark: str,
    around: dict[str, Any],
    tables: Sequence[Table],
    checks: Sequence[Check],
) -> int:
    """Print, paste at a mark of the page if asked; 0 where every promise is kept, else 1.

    Too few samples to tell count as kept in a quick run alone.
    """
    tables = [*tables, checks_table(checks)]
    report(around, tables, checks, as_json=options.json)
    if options.markdown:
        paste(page, mark, around, tables)
    enough = (True, None) if options.quick else (True,)
    return 0 if all(check.holds in enough for check in checks) else 1

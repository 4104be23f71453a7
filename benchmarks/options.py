"""Command line of the benchmarks."""

import argparse
from pathlib import Path


def benchmark_options(doc: str | None, quick: str, page: Path) -> argparse.Namespace:
    """Options of a benchmark: `quick`, `json`, `markdown`.

    The first line of `doc` says what it measures, `quick` what is left out, `page` where its tables
    go.
    """
    parser = argparse.ArgumentParser(description=(doc or "").partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help=quick)
    parser.add_argument("--json", action="store_true", help="end with one JSON object")
    parser.add_argument("--markdown", action="store_true", help=f"paste into docs/{page.name}")
    return parser.parse_args()

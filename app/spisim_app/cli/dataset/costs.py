"""Tables of the cost of samples, and of their differing parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ..console import results, say
from ..tables import print_table, word_table
from .progress import short_time

if TYPE_CHECKING:
    from spisim.dataset.cost import Cost
    from spisim.dataset.preview import Preview
    from spisim.dataset.records import Record

#: Minimum compile time to report.
MIN_COMPILING_S = 1.0


def print_preview(preview: Preview) -> None:
    """Print the first samples of a plan, and the estimated cost of all."""
    _print_samples(preview)
    results.print()
    table = word_table("scene", "weather", "of all", "made", "median, s", "90 %, s", "max, s")
    for each in preview.costs:
        cells = _seconds(each.cost) if each.cost else ("0", "", "", "")
        table.add_row(each.group.scene, each.group.weather, f"{each.fraction:.0%}", *cells)
    table.add_row("all", "", "100%", *_seconds(preview.cost))
    print_table(table)
    for index, reason in preview.failures.items():
        say(f"sample {index} failed: {reason}")
    results.print(
        f"{preview.samples} samples, {preview.bytes / 1e6:.3g} MB, about "
        f"{short_time(preview.seconds)} with {preview.workers} workers "
        f"(on average {preview.cost.mean_s:.2g} s and {preview.bytes_per_sample / 1e3:.3g} kB)",
        soft_wrap=True,
    )
    if preview.compiling_s >= MIN_COMPILING_S:
        results.print(
            f"The pilot also compiled kernels for {short_time(preview.compiling_s)}; later samples "
            "load these from disk",
            soft_wrap=True,
        )


def print_slowest(records: Sequence[Record], common: Mapping[str, Any]) -> None:
    """Print the slowest samples, with those parameters that differ."""
    table = word_table("slowest, s", "compiling, s", "sample", "parameters")
    for record in records:
        own = {name: value for name, value in record.parameters.items() if name not in common}
        making_s = (record.seconds or 0.0) - record.compiling_s
        seconds = (f"{making_s:.2f}", f"{record.compiling_s:.2f}")
        table.add_row(*seconds, str(record.index), listed(own))
    print_table(table)


def listed(parameters: Mapping[str, Any]) -> str:
    """Return names and values in one line."""
    return ", ".join(f"{name}: {_brief(value)}" for name, value in parameters.items())


def _print_samples(preview: Preview) -> None:
    from spisim.dataset.records import flat

    rows = [dict(flat(sample.parameters)) for sample in preview.first]
    common = {k: v for k, v in rows[0].items() if all(k in row and row[k] == v for row in rows)}
    if common:
        results.print(f"   all  {listed(common)}", soft_wrap=True)
    for sample, row in zip(preview.first, rows, strict=True):
        own = {name: value for name, value in row.items() if name not in common}
        line = f"{sample.index:6}  {sample.scene_name}  {listed(own)}"
        results.print(line.rstrip(), soft_wrap=True)
    if preview.samples > len(rows):
        results.print(f"   …  and {preview.samples - len(rows)} more")


def _seconds(cost: Cost) -> tuple[str, ...]:
    return (
        str(cost.samples),
        *(f"{seconds:.2f}" for seconds in (cost.median_s, cost.p90_s, cost.max_s)),
    )


def _brief(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)

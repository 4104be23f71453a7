"""`spisim dataset status`: progress of a data set."""

from ..console import print_json, results
from ..options import Json
from ..tables import plain_table, print_table
from .costs import print_slowest
from .running import Folder

EXAMPLE = "spisim dataset status out/fog"


def command(folder: Folder, json: Json = False) -> None:
    """Report how many samples are done, failed and missing, the rate, and the reasons of failures.

    It can be run at any time, also during a run.
    """
    from dataclasses import asdict

    from spisim.dataset.status import status_of

    status = status_of(folder)
    if json:
        print_json(asdict(status) | {"missing": status.missing})
        return
    rate = status.samples_per_minute
    left = f", {_duration(status.missing / rate)} left" if rate and status.runner else ""
    results.print(f"{status.name}: {status.planned} samples planned", soft_wrap=True)
    results.print(f"  done     {status.done}")
    results.print(f"  failed   {status.failed}")
    results.print(f"  missing  {status.missing}")
    results.print(f"  rate     {f'{rate:.3g} samples per minute{left}' if rate else 'unknown'}")
    results.print(f"  disk     {status.disk_bytes / 1e6:.1f} MB")
    results.print(f"  run      {f'process {status.runner}' if status.runner else 'none'}")
    if cost := status.cost:
        results.print(
            f"  cost     median {cost.median_s:.2f} s, 90 % within {cost.p90_s:.2f} s, "
            f"at most {cost.max_s:.2f} s, without compiling",
            soft_wrap=True,
        )
        results.print()
        print_slowest(status.slowest, status.common)
    if status.failures:
        table = plain_table("failed because (# are numbers)", "samples", "such as")
        for reason, indices in status.failures.items():
            table.add_row(reason, str(len(indices)), str(indices[0]))
        results.print()
        print_table(table)


def _duration(minutes: float) -> str:
    return f"{minutes / 60:.1f} h" if minutes >= 90 else f"{max(1, round(minutes))} min"

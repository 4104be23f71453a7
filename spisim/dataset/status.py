"""Progress of a data set, during a run or afterwards."""

import re
import stat
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

from reconstruction.base.folders import holder
from spisim.dataset.cost import Cost, cost_of, slowest
from spisim.dataset.folder import Layout, everything
from spisim.dataset.manifest import read_manifest
from spisim.dataset.parameters import common_parameters
from spisim.dataset.records import Record

#: Period over which the rate is measured.
RECENT = timedelta(minutes=10)


@dataclass(frozen=True)
class Status:
    """Counts of samples, and why some failed.

    `samples_per_minute` is the recent rate, None if unknown. `failures` maps each reason, with # in
    place of numbers, to indices, most frequent first. `runner` is the process that makes samples
    and its machine, or None. `cost` and `slowest` are of finished samples, and `common` are the
    parameters equal in all of them.
    """

    name: str
    planned: int
    done: int
    failed: int
    failures: dict[str, list[int]]
    samples_per_minute: float | None
    disk_bytes: int
    runner: str | None
    cost: Cost | None
    slowest: list[Record]
    common: dict[str, Any]

    @property
    def missing(self) -> int:
        """Number of samples not attempted yet."""
        return self.planned - self.done - self.failed


def status_of(folder: Path) -> Status:
    """Return the status of a data set. Raises InputError as `read_manifest`."""
    meta, records = read_manifest(folder)
    done = [record for record in records if record.done]
    failed = [record for record in records if not record.done]
    return Status(
        name=meta.get("name", ""),
        planned=max(int(meta.get("samples", 0)), len(records)),
        done=len(done),
        failed=len(failed),
        failures=_by_reason(failed),
        samples_per_minute=_rate([r.finished for r in records if r.finished]),
        disk_bytes=_size(folder),
        runner=holder(Layout(folder).lock),
        cost=cost_of(done),
        slowest=slowest(done),
        common=common_parameters(done),
    )


def _size(folder: Path) -> int:
    """Return the size of all files in bytes, ignoring files that vanish meanwhile."""
    total = 0
    for path in everything(folder):
        with suppress(FileNotFoundError):
            info = path.lstat()
            total += info.st_size if stat.S_ISREG(info.st_mode) else 0
    return total


def _by_reason(failed: Iterable[Record]) -> dict[str, list[int]]:
    reasons: dict[str, list[int]] = {}
    for record in failed:
        reason = re.sub(r"-?\d+(\.\d+)?(e[+-]?\d+)?", "#", record.error or "unknown")
        reasons.setdefault(reason, []).append(record.index)
    return dict(sorted(reasons.items(), key=lambda item: -len(item[1])))


def _rate(finished: Sequence[str]) -> float | None:
    """Return the recent number of samples per minute."""
    times = sorted(datetime.fromisoformat(time) for time in finished)
    recent = [time for time in times if time >= times[-1] - RECENT]
    if len(recent) < 2 or recent[0] == recent[-1]:
        return None
    return (len(recent) - 1) / ((recent[-1] - recent[0]) / timedelta(minutes=1))

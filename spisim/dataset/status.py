"""How far a data set is, while it is made or afterwards."""

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

#: The rate is that of the last samples, over this time.
RECENT = timedelta(minutes=10)


@dataclass(frozen=True)
class Status:
    """Numbers of samples, and why some failed.

    `samples_per_minute` is the recent rate, None where too little is known of it; `failures` are
    indices by reason, the most frequent first, with # in place of numbers; `runner` is the process
    that is making samples, and its machine, None where none is. `cost` is of the samples that are
    done, of which `slowest` are the slowest; `common` are the parameters that all have in common.
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
        """Samples that have not been tried."""
        return self.planned - self.done - self.failed


def status_of(folder: Path) -> Status:
    """Status of a data set. Raises InputError as `read_manifest`."""
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
    """Bytes of all files; some of them may go while they are counted."""
    total = 0
    for path in everything(folder):
        with suppress(FileNotFoundError):
            reported = path.lstat()
            total += reported.st_size if stat.S_ISREG(reported.st_mode) else 0
    return total


def _by_reason(failed: Iterable[Record]) -> dict[str, list[int]]:
    reasons: dict[str, list[int]] = {}
    for record in failed:
        reason = re.sub(r"-?\d+(\.\d+)?(e[+-]?\d+)?", "#", record.error or "unknown")
        reasons.setdefault(reason, []).append(record.index)
    return dict(sorted(reasons.items(), key=lambda item: -len(item[1])))


def _rate(finished: Sequence[str]) -> float | None:
    """Samples per minute over the last ones."""
    times = sorted(datetime.fromisoformat(time) for time in finished)
    recent = [time for time in times if time >= times[-1] - RECENT]
    if len(recent) < 2 or recent[0] == recent[-1]:
        return None
    return (len(recent) - 1) / ((recent[-1] - recent[0]) / timedelta(minutes=1))

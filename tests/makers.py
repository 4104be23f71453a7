"""Stand-ins for the making of samples: fast, and bad on demand. Processes import them by name."""

from __future__ import annotations

import errno
import os
import signal
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Self

from spisim.dataset.folder import Layout, fingerprint
from spisim.dataset.records import NO_SPACE, Outcome, failure

if TYPE_CHECKING:
    from spisim.dataset.fogs import FogSeries
    from spisim.dataset.planned import PlannedSet


@dataclass(frozen=True)
class Fake:
    """Writes a file that is no capture. `bad` tells what happens to some samples instead.

    "kill", "exit" and "hang" end or stall the process, "fail" is an ordinary failure; "kill once"
    and "no space once" are bad the first time only. The processes that made samples leave their
    numbers in `pids`.
    """

    folder: Path
    bad: Mapping[int, str] = field(default_factory=dict)
    seconds: float = 0.0

    def __call__(self, index: int) -> Outcome:
        (self.folder / "pids").mkdir(parents=True, exist_ok=True)
        (self.folder / "pids" / f"{index}-{os.getpid()}").touch()
        time.sleep(self.seconds)
        trouble = self.bad.get(index, "")
        if trouble.endswith(" once"):
            mark = self.folder / "pids" / f"{index} was bad"
            trouble = "" if mark.exists() else trouble.removesuffix(" once")
            mark.touch()
        if trouble == "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        if trouble == "exit":
            os._exit(7)
        if trouble == "hang":
            time.sleep(86_400)
        if trouble == "fail":
            return failure(index, "no luck")
        if trouble == "no space":
            return Outcome(index, NO_SPACE, error=os.strerror(errno.ENOSPC))
        return self._written(index)

    def _written(self, index: int) -> Outcome:
        layout = Layout(self.folder)
        path = layout.capture(index)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"sample {index}")
        return Outcome(
            index,
            "done",
            scene=f"scene {index % 3}",
            parameters={"x": index},
            file=layout.relative(path),
            **fingerprint(path),
        )

    def pids(self) -> list[int]:
        """Processes that made samples, once each."""
        names = [path.name for path in (self.folder / "pids").glob("*-*")]
        return sorted({int(name.partition("-")[2]) for name in names})


@dataclass(frozen=True)
class OfPlan(Fake):
    """For samples of a plan, which the processes are not given: it takes long to load."""

    planned: PlannedSet | None = None

    @property
    def series(self) -> FogSeries:
        from spisim.dataset.fogs import FogSeries  # processes without a plan need not load it

        assert self.planned is not None
        return FogSeries(self.planned)

    def __reduce__(self) -> tuple[object, ...]:
        return Fake, (self.folder, self.bad, self.seconds)


@dataclass(frozen=True)
class Hoarder(Fake):
    """Keeps more memory with every sample."""

    def __call__(self, index: int) -> Outcome:
        _hoard.append(bytearray(b"x" * 60_000_000))
        return super().__call__(index)


_hoard: list[bytearray] = []


@dataclass
class InThisProcess:
    """An executor without processes, which notes what it was asked for."""

    make: Fake
    asked: list[list[int]] = field(default_factory=list)

    def run(self, indices: Iterable[int]) -> Iterator[Outcome]:
        self.asked.append(list(indices))
        yield from map(self.make, self.asked[-1])

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        pass

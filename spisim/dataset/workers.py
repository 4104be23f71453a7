"""Processes on this machine that make samples, one each at a time, and are watched.

A process that dies costs its sample only. The others go on, and a fresh one takes its place.
"""

from __future__ import annotations

import ctypes
import gc
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import count, islice
from multiprocessing.connection import Connection, wait
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, Protocol, Self

from spisim.dataset.records import DIED, Outcome, failure

if TYPE_CHECKING:
    from spisim.dataset.sample import Maker

Make = Callable[[int], Outcome]
#: Number of the world of a sample: a process that has made one sample of it makes others faster.
WorldOf = Callable[[int], int]

#: What a process needs, from which the default number of processes follows.
WORKER_MEMORY_MB = 700
#: A process makes room for a fresh one once it holds this much more than after its first sample,
GROWTH_MB = 400
#: or has made this many samples.
MAX_SAMPLES = 1000
#: Samples among which one of the world that a process has made last is looked for.
LOOK_AHEAD = 256
#: Default of the longest that a sample may take.
TIMEOUT_S = 1800.0


class Executor(Protocol):
    """Makes samples somewhere. Used as a context manager, which ends what is under way."""

    def run(self, indices: Iterable[int]) -> Iterator[Outcome]:
        """One outcome for each index, in any order."""

    def __enter__(self) -> Self: ...

    def __exit__(self, *exception: object) -> None: ...


@dataclass(eq=False)
class _Worker:
    """A process, our end of its pipe, and what it is doing."""

    process: Any
    pipe: Connection
    index: int | None = None
    since: float = 0.0
    made: int = 0
    first_memory_mb: float = 0.0
    world: int | None = None  # of what it made last, or is making

    def assign(self, index: int, world: int) -> None:
        self.index, self.since, self.world = index, time.monotonic(), world
        self.pipe.send(index)


class LocalExecutor:
    """Processes of this machine. Each goes on with the world it is in, as long as it lasts."""

    def __init__(
        self,
        make: Make,
        workers: int,
        timeout_s: float = TIMEOUT_S,
        world_of: WorldOf = lambda index: index,
    ) -> None:
        self._make = make
        self._count = workers
        self.timeout_s = timeout_s
        self._world_of = world_of
        self._workers: list[_Worker] = []

    @classmethod
    def of(cls, make: Maker, workers: int | None, timeout_s: float = TIMEOUT_S) -> Self:
        """For the samples of a plan; by default as many processes as this machine can take."""
        return cls(make, workers or default_workers(), timeout_s, make.planned.world_of)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        for worker in list(self._workers):
            self._end(worker)

    def run(self, indices: Iterable[int]) -> Iterator[Outcome]:
        """Outcomes as they come."""
        waiting = deque(indices)
        while waiting or any(worker.index is not None for worker in self._workers):
            self._give_work(waiting)
            busy = [worker for worker in self._workers if worker.index is not None]
            ready = wait([worker.pipe for worker in busy], timeout=1.0)
            for worker in busy:
                assert worker.index is not None
                if worker.pipe in ready:
                    yield self._received(worker)
                elif time.monotonic() - worker.since > self.timeout_s:
                    self._end(worker)
                    yield failure(worker.index, f"took longer than {self.timeout_s:g} s")

    def _give_work(self, waiting: deque[int]) -> None:
        while waiting:
            idle = next((worker for worker in self._workers if worker.index is None), None)
            if idle is None:
                if len(self._workers) == self._count:
                    return
                idle = self._start()
            index = self._next(idle, waiting)
            try:
                idle.assign(index, self._world_of(index))
            except OSError:  # it died while it had nothing to do
                self._end(idle)
            else:
                waiting.remove(index)

    def _next(self, idle: _Worker, waiting: deque[int]) -> int:
        """Of the world that it is in, else of one in which no other is, else the first."""
        taken = {worker.world for worker in self._workers if worker is not idle}
        fresh: int | None = None
        for index in islice(waiting, LOOK_AHEAD):
            world = self._world_of(index)
            if world == idle.world:
                return index
            if fresh is None and world not in taken:
                fresh = index
        return waiting[0] if fresh is None else fresh

    def _received(self, worker: _Worker) -> Outcome:
        assert worker.index is not None
        try:
            outcome, memory_mb = worker.pipe.recv()
        except (EOFError, OSError):
            worker.process.join()
            self._end(worker)
            return failure(worker.index, f"{DIED}{_how(worker.process.exitcode)}")
        worker.index = None
        worker.made += 1
        if worker.made == 1:
            worker.first_memory_mb = memory_mb
        if worker.made == MAX_SAMPLES or memory_mb > worker.first_memory_mb + GROWTH_MB:
            self._end(worker)
        return outcome

    def _start(self) -> _Worker:
        ours, theirs = _SPAWN.Pipe()
        process = _SPAWN.Process(target=_serve, args=(theirs, self._make), daemon=True)
        with _without_main():
            process.start()
        theirs.close()
        self._workers.append(_Worker(process, ours))
        return self._workers[-1]

    def _end(self, worker: _Worker) -> None:
        self._workers.remove(worker)
        worker.pipe.close()
        worker.process.kill()
        worker.process.join()


def default_workers() -> int:
    """One process for each core that this process may use, as far as the memory goes."""
    memory_mb = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 2**20
    return max(1, min(_cores(), int(memory_mb // WORKER_MEMORY_MB)))


_SPAWN = multiprocessing.get_context("spawn")


def _cores() -> int:
    """Physical cores; those that Linux does not tell from their second threads count each."""
    if not hasattr(os, "sched_getaffinity"):
        return os.cpu_count() or 1
    siblings = "/sys/devices/system/cpu/cpu{}/topology/thread_siblings_list"
    files = {cpu: Path(siblings.format(cpu)) for cpu in os.sched_getaffinity(0)}
    return len({file.read_text() if file.exists() else cpu for cpu, file in files.items()})


@contextmanager
def _without_main() -> Iterator[None]:
    """Keep processes that are started from running the user's script, as `spawn` would have them.

    They need nothing of it, and one without `if __name__ == "__main__"` would start others.
    """
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


def _serve(pipe: Connection, make: Make) -> None:
    """Body of a process: makes what it is told, until the pipe is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that started this one
    threading.Thread(target=_end_with_parent, daemon=True).start()
    for made in count(1):
        try:
            index = pipe.recv()
        except EOFError:
            return
        outcome = make(index)
        _give_back_memory()
        if made == 1:  # what is left, a few hundred modules, need not be looked through again
            gc.freeze()
        pipe.send((outcome, memory_mb()))


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os._exit(1)


def _give_back_memory() -> None:
    """Return what is not needed to the system, sample by sample.

    Scenes are held in cycles, which Python frees only now and then, and glibc keeps what was freed
    in fragments that add up over time.
    """
    gc.collect()
    with suppress(AttributeError):  # other C libraries
        ctypes.CDLL(None).malloc_trim(0)


def memory_mb() -> float:
    """Memory that this process holds; 0 where the system does not tell."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except OSError:
        return 0.0
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def _how(exit_code: int) -> str:
    if exit_code < 0:
        return f"killed by {signal.Signals(-exit_code).name}"
    return f"ended with exit status {exit_code}"

"""Local processes that make samples, one at a time each, under supervision.

A process that dies costs only its sample: the others continue, and a fresh one replaces it.
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
#: Number of a sample's world; a process makes further samples of the same world faster.
WorldOf = Callable[[int], int]

#: Memory per process, which limits the default number of processes.
WORKER_MEMORY_MB = 700
#: A process is replaced once it has grown by this much since its first sample,
MAX_GROWTH_MB = 400
#: or has made this many samples.
MAX_SAMPLES = 1000
#: Waiting samples searched for one of the world that a process is in.
LOOK_AHEAD = 256
#: Default time limit of a sample.
TIMEOUT_S = 1800.0


class Executor(Protocol):
    """Makes samples somewhere; leaving the context ends what is running."""

    def run(self, indices: Iterable[int]) -> Iterator[Outcome]:
        """Yield one outcome per index, in any order."""

    def __enter__(self) -> Self: ...

    def __exit__(self, *exception: object) -> None: ...


@dataclass(eq=False)
class _Worker:
    """A process, our end of its pipe, and its current sample."""

    process: Any
    pipe: Connection
    index: int | None = None
    since: float = 0.0
    made: int = 0
    first_memory_mb: float = 0.0
    world: int | None = None  # of its current or last sample

    def assign(self, index: int, world: int) -> None:
        self.index, self.since, self.world = index, time.monotonic(), world
        self.pipe.send(index)


class LocalExecutor:
    """Processes of this machine, each of which stays in one world as long as it lasts."""

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
        """Create the executor of a plan's samples; by default with `default_workers` processes."""
        return cls(make, workers or default_workers(), timeout_s, make.series.world_of)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        for worker in list(self._workers):
            self._end(worker)

    def run(self, indices: Iterable[int]) -> Iterator[Outcome]:
        """Yield outcomes as they arrive."""
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
            except OSError:  # it died while idle
                self._end(idle)
            else:
                waiting.remove(index)

    def _next(self, idle: _Worker, waiting: deque[int]) -> int:
        """Choose a sample of its world, else of a world without a process, else the first."""
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
        if worker.made == MAX_SAMPLES or memory_mb > worker.first_memory_mb + MAX_GROWTH_MB:
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
    """Return one process per available core, as far as memory allows."""
    memory_mb = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 2**20
    return max(1, min(_cores(), int(memory_mb // WORKER_MEMORY_MB)))


_SPAWN = multiprocessing.get_context("spawn")


def _cores() -> int:
    """Count the available physical cores; logical ones where the system does not list siblings."""
    if not hasattr(os, "sched_getaffinity"):
        return os.cpu_count() or 1
    siblings = "/sys/devices/system/cpu/cpu{}/topology/thread_siblings_list"
    files = {cpu: Path(siblings.format(cpu)) for cpu in os.sched_getaffinity(0)}
    return len({file.read_text() if file.exists() else cpu for cpu, file in files.items()})


@contextmanager
def _without_main() -> Iterator[None]:
    """Keep child processes from running the user's script, which `spawn` would import.

    They do not need it, and a script without `if __name__ == "__main__"` would start further ones.
    """
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


def _serve(pipe: Connection, make: Make) -> None:
    """Body of a process: make the samples requested through the pipe until it is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is handled by the parent
    threading.Thread(target=_end_with_parent, daemon=True).start()
    for made in count(1):
        try:
            index = pipe.recv()
        except (EOFError, ConnectionError):  # the latter if an outcome had not been read
            return
        outcome = make(index)
        _give_back_memory()
        if made == 1:  # keeps the garbage collector from scanning the loaded modules again
            gc.freeze()
        try:
            pipe.send((outcome, memory_mb()))
        except ConnectionError:
            return


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os._exit(1)


def _give_back_memory() -> None:
    """Return unused memory to the system after each sample.

    Scenes are held in reference cycles, which Python rarely collects, and glibc keeps freed memory
    in fragments that add up.
    """
    gc.collect()
    with suppress(AttributeError):  # other C libraries
        ctypes.CDLL(None).malloc_trim(0)


def memory_mb() -> float:
    """Return the resident memory of this process, in MiB; 0 where the system does not report it."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except OSError:
        return 0.0
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def _how(exit_code: int) -> str:
    if exit_code < 0:
        return f"killed by {signal.Signals(-exit_code).name}"
    return f"ended with exit status {exit_code}"

"""Make samples on a Dask cluster whose workers share the data set's folder."""

import asyncio
import logging
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent import futures
from contextlib import contextmanager
from itertools import count
from typing import Any, Self
from uuid import uuid4
from zlib import crc32

from reconstruction.base.errors import InputError
from spisim.dataset.records import DIED, Outcome, failure
from spisim.dataset.workers import LOOK_AHEAD, Make, WorldOf

#: Time limit for a scheduler to answer.
ANSWER_S = 8
#: Time to wait for a scheduler that is gone.
PATIENCE_S = 600.0
#: Samples submitted per worker: one running, one waiting.
SUBMITTED = 2


class SchedulerGone(Exception):
    """The scheduler no longer answers; what was submitted to it is lost."""


class DaskExecutor:
    """The workers of a cluster. Samples of a lost worker go to others.

    Samples of one world go to the same worker, as long as no other is idle.
    If the scheduler is gone, the executor waits for it and submits unfinished samples again.
    Workers that are still making them write the same bytes.

    Raises InputError if `distributed` is not installed, the scheduler does not answer, or it stays
    away for longer than PATIENCE_S.
    """

    def __init__(
        self,
        make: Make,
        address: str,
        say: Callable[[str], None] = print,
        world_of: WorldOf = lambda index: index,
    ) -> None:
        self._make = make
        self._world_of = world_of
        self._address = address
        self._say = say
        self._run = uuid4().hex  # makes task keys unique among all clients
        self._calls = count()
        try:
            self._client = _connected(address)
        except (OSError, ValueError) as error:
            reason = " ".join(str(error).split())
            raise InputError(f"--dask {address}: no scheduler answers there ({reason})") from None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self._client.close()

    def run(self, indices: Iterable[int]) -> Iterator[Outcome]:
        """Yield outcomes as they arrive."""
        left = dict.fromkeys(indices)
        while left:
            try:
                for outcome in self._by_this_scheduler(list(left)):
                    del left[outcome.index]
                    yield outcome
            except SchedulerGone:
                self._wait_for_scheduler()

    def _by_this_scheduler(self, indices: Iterable[int]) -> Iterator[Outcome]:
        """Yield outcomes as they arrive; submit only as many samples as workers can soon make."""
        from distributed import as_completed

        waiting = dict.fromkeys(indices)
        under_way: dict[Any, tuple[int, str | None]] = {}
        finished = as_completed([])

        def submit() -> None:
            for index, worker in self._following(list(waiting), list(under_way.values())):
                del waiting[index]
                future = self._submit(index, worker)
                under_way[future] = index, worker
                finished.add(future)

        submit()
        for future in finished:
            yield self._outcome(future, under_way.pop(future)[0])
            submit()

    def _following(
        self, waiting: Sequence[int], under_way: Sequence[tuple[int, str | None]]
    ) -> Iterator[tuple[int, str | None]]:
        """Samples for the workers that have room: of their worlds, or any for one that is idle."""
        workers = self._workers()
        if not workers:  # the next to come may take any
            yield from ((index, None) for index in waiting[: not under_way])
            return
        room = dict.fromkeys(workers, SUBMITTED)
        for _, worker in under_way:
            if worker in room:
                room[worker] -= 1
        others = []
        for index in waiting[:LOOK_AHEAD]:
            own = workers[crc32(str(self._world_of(index)).encode()) % len(workers)]
            if room[own] > 0:
                room[own] -= 1
                yield index, own
            else:
                others.append(index)
        idle = [worker for worker in workers if room[worker] == SUBMITTED]
        yield from zip(others, idle, strict=False)

    def _submit(self, index: int, worker: str | None) -> Any:
        key = f"sample-{index}-{next(self._calls)}-{self._run}"
        options: dict[str, Any] = {}
        if worker is not None:
            options = {"workers": [worker], "allow_other_workers": True}
        with self._detecting_loss():
            return self._client.submit(self._make, index, key=key, pure=False, **options)

    def _workers(self) -> list[str]:
        """Addresses of the workers, in order."""
        with self._detecting_loss():
            return sorted(self._client.scheduler_info(n_workers=-1)["workers"])

    def _outcome(self, future: Any, index: int) -> Outcome:
        from distributed.scheduler import KilledWorker

        try:
            with self._detecting_loss():
                outcome = future.result()
        except KilledWorker:
            return failure(index, f"{DIED}lost more than once")
        except SchedulerGone:
            raise
        except Exception as error:  # of Dask; errors of a sample become outcomes
            raise InputError(
                f"--dask {self._address}: the workers cannot make samples; they need the same "
                f"spisim as this machine ({type(error).__name__}: {error})"
            ) from error
        assert isinstance(outcome, Outcome)
        return outcome

    @contextmanager
    def _detecting_loss(self) -> Iterator[None]:
        """Raise SchedulerGone for whatever follows from its loss."""
        from distributed.client import ClosedClientError
        from distributed.comm import CommClosedError

        gone = (asyncio.CancelledError, futures.CancelledError, CommClosedError, ClosedClientError)
        try:
            yield
        except gone as error:
            raise SchedulerGone from error
        except Exception as error:
            if self._client.status == "running":
                raise
            raise SchedulerGone from error

    def _wait_for_scheduler(self) -> None:
        where = f"--dask {self._address}: the scheduler"
        self._say(f"{where} is gone; waiting for it")
        self._client.close()
        end = time.monotonic() + PATIENCE_S
        while True:
            try:
                self._client = _connected(self._address)
                workers = len(self._workers())
            except (OSError, SchedulerGone):
                if time.monotonic() > end:
                    raise InputError(
                        f"{where} is gone and did not return within {PATIENCE_S:g} s; run the same "
                        "command again to continue"
                    ) from None
            else:
                self._say(f"{where} is back with {workers} workers; continuing")
                return


def _connected(address: str) -> Any:
    """Connect to a scheduler. Raises OSError or ValueError if none answers."""
    try:
        from distributed import Client
    except ImportError:
        raise InputError("--dask needs distributed: pip install 'spisim[dask]'") from None
    for logger in ("distributed", "distributed.client"):  # which have levels of their own
        logging.getLogger(logger).setLevel(logging.CRITICAL)
    return Client(address, timeout=ANSWER_S)

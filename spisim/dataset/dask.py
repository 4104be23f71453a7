"""Samples made by the workers of a Dask cluster, which share the data set's folder."""

import asyncio
import logging
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent import futures
from contextlib import contextmanager
from itertools import count, islice
from typing import Any, Self
from uuid import uuid4

from reconstruction.base.errors import InputError
from spisim.dataset.records import DIED, Outcome, failure
from spisim.dataset.workers import Make

#: How long a scheduler may take to answer.
ANSWER_S = 8
#: How long to wait for one that is gone.
PATIENCE_S = 600.0
#: Samples handed out per worker: one being made, one waiting.
AHEAD = 2


class SchedulerGone(Exception):
    """The scheduler does not answer any more; what it was told is lost."""


class DaskExecutor:
    """A cluster's workers. Samples of one that is lost go to others.

    A scheduler that is gone is waited for. What was under way is then handed out again: workers
    that still make it write the same bytes.

    Raises InputError where `distributed` is not installed, the scheduler does not answer or stays
    away for longer than PATIENCE_S.
    """

    def __init__(self, make: Make, address: str, say: Callable[[str], None] = print) -> None:
        self._make = make
        self._address = address
        self._say = say
        self._run = uuid4().hex  # the scheduler takes equal keys for one task, whoever's they are
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
        """Outcomes as they come."""
        left = dict.fromkeys(indices)
        while left:
            try:
                for outcome in self._by_this_scheduler(list(left)):
                    del left[outcome.index]
                    yield outcome
            except SchedulerGone:
                self._wait_for_scheduler()

    def _by_this_scheduler(self, indices: Iterable[int]) -> Iterator[Outcome]:
        """Outcomes as they come; no more samples are handed out than workers can soon make."""
        from distributed import as_completed

        waiting = iter(indices)
        under_way = {self._submit(index): index for index in islice(waiting, self._room())}
        finished = as_completed(list(under_way))
        for future in finished:
            yield self._outcome(future, under_way.pop(future))
            for following in islice(waiting, max(0, self._room() - len(under_way))):
                another = self._submit(following)
                under_way[another] = following
                finished.add(another)

    def _submit(self, index: int) -> Any:
        key = f"sample-{index}-{next(self._calls)}-{self._run}"
        with self._noticed():
            return self._client.submit(self._make, index, key=key, pure=False)

    def _room(self) -> int:
        return max(1, AHEAD * self._workers())

    def _workers(self) -> int:
        with self._noticed():
            return len(self._client.scheduler_info(n_workers=-1)["workers"])

    def _outcome(self, future: Any, index: int) -> Outcome:
        from distributed.scheduler import KilledWorker

        try:
            with self._noticed():
                outcome = future.result()
        except KilledWorker:
            return failure(index, f"{DIED}lost more than once")
        except SchedulerGone:
            raise
        except Exception as error:  # of Dask: a sample's own is an outcome
            raise InputError(
                f"--dask {self._address}: its workers cannot make samples; they need the same "
                f"spisim as this machine ({type(error).__name__}: {error})"
            ) from error
        assert isinstance(outcome, Outcome)
        return outcome

    @contextmanager
    def _noticed(self) -> Iterator[None]:
        """SchedulerGone for whatever goes wrong because of that."""
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
                workers = self._workers()
            except (OSError, SchedulerGone):
                if time.monotonic() > end:
                    raise InputError(
                        f"{where} is gone and was not back within {PATIENCE_S:g} s; run the same "
                        "command again to go on where it was"
                    ) from None
            else:
                self._say(f"{where} is back, and has {workers} workers; going on")
                return


def _connected(address: str) -> Any:
    """Client of a scheduler. Raises OSError or ValueError where none answers."""
    try:
        from distributed import Client
    except ImportError:
        raise InputError("--dask needs distributed: pip install 'spisim[dask]'") from None
    for logger in ("distributed", "distributed.client"):  # which has a level of its own
        logging.getLogger(logger).setLevel(logging.CRITICAL)
    return Client(address, timeout=ANSWER_S)

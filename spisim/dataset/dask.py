"""Samples made by the workers of a Dask cluster, which share the data set's folder."""

import asyncio
import logging
from collections.abc import Iterable, Iterator
from itertools import count, islice
from typing import Any, Self
from uuid import uuid4

from reconstruction.errors import InputError
from spisim.dataset.records import DIED, Outcome, failure
from spisim.dataset.workers import Make

#: How long a scheduler may take to answer.
ANSWER_S = 8
#: Samples handed out per worker: one being made, one waiting.
AHEAD = 2


class DaskExecutor:
    """A cluster's workers. Samples of one that is lost go to others.

    Raises InputError where `distributed` is not installed or the scheduler does not answer.
    """

    def __init__(self, make: Make, address: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise InputError("--dask needs distributed: pip install 'spisim[dask]'") from None
        logging.getLogger("distributed").setLevel(logging.CRITICAL)
        try:
            self._client: Any = Client(address, timeout=ANSWER_S)
        except (OSError, ValueError, TimeoutError) as error:
            reason = " ".join(str(error).split())
            raise InputError(f"--dask {address}: no scheduler answers there ({reason})") from None
        self._make = make
        self._address = address
        self._run = uuid4().hex  # the scheduler takes equal keys for one task, whoever's they are
        self._calls = count()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self._client.close()

    def run(self, indices: Iterable[int]) -> Iterator[Outcome]:
        """Outcomes as they come; no more samples are handed out than workers can soon make."""
        from distributed import as_completed

        waiting = iter(indices)
        under_way = {self._submit(index): index for index in islice(waiting, self._room())}
        finished = as_completed(list(under_way))
        for future in finished:
            index = under_way.pop(future)
            yield self._outcome(future, index)
            for following in islice(waiting, max(0, self._room() - len(under_way))):
                another = self._submit(following)
                under_way[another] = following
                finished.add(another)

    def _submit(self, index: int) -> Any:
        key = f"sample-{index}-{next(self._calls)}-{self._run}"
        return self._client.submit(self._make, index, key=key, pure=False)

    def _room(self) -> int:
        return max(1, AHEAD * len(self._client.scheduler_info(n_workers=-1)["workers"]))

    def _outcome(self, future: Any, index: int) -> Outcome:
        from distributed.scheduler import KilledWorker

        try:
            outcome = future.result()
        except KilledWorker:
            return failure(index, f"{DIED}lost more than once")
        except asyncio.CancelledError:
            raise InputError(
                f"--dask {self._address}: the scheduler is gone; run the same command again to "
                "go on where it was"
            ) from None
        except Exception as error:  # of Dask: a sample's own is an outcome
            raise InputError(
                f"--dask {self._address}: its workers cannot make samples; they need the same "
                f"spisim as this machine ({type(error).__name__}: {error})"
            ) from error
        assert isinstance(outcome, Outcome)
        return outcome

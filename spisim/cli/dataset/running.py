"""What commands that make samples share: by whom they are made, and how the command ends."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import typer

from reconstruction.base.errors import InputError

from ..console import say
from ..outputs import resumed

if TYPE_CHECKING:
    from spisim.dataset.workers import Executor, Make

#: Exit status of a run that waited for space in vain.
OUT_OF_SPACE = 3


def executors(
    workers: int | None, dask: str | None, timeout_s: float
) -> Callable[[Make], Executor]:
    """Executors of what is to be made: processes, or the workers of a cluster.

    Raises InputError where both are asked for.
    """
    from spisim.dataset.dask import DaskExecutor
    from spisim.dataset.sample import Maker
    from spisim.dataset.workers import LocalExecutor, default_workers

    if dask is None:

        def local(make: Make) -> Executor:
            if isinstance(make, Maker):
                return LocalExecutor.of(make, workers, timeout_s)
            return LocalExecutor(make, workers or default_workers(), timeout_s)

        return local
    if workers is not None:
        raise InputError("--workers and --dask exclude each other")
    address = dask
    return lambda make: DaskExecutor(make, address, say)


@contextmanager
def explained() -> Iterator[None]:
    """Message of runs that are interrupted; message and exit status of those without space."""
    from spisim.dataset.runner import OutOfSpace

    try:
        with resumed():
            yield
    except OutOfSpace as error:
        say(f"error: {error}", style="red")
        raise typer.Exit(OUT_OF_SPACE) from None

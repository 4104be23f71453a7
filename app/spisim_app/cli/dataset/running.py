"""Arguments and execution shared by commands that make or read data sets."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from reconstruction.base.errors import InputError

from ..console import say
from ..options import number_option
from ..outputs import resumed

Folder = Annotated[
    Path, typer.Argument(metavar="DIR", help="Folder of a data set.", show_default=False)
]
Workers = Annotated[int | None, number_option(1, 4096, "Processes; by default one per core.")]
RetryFailed = Annotated[
    bool, typer.Option("--retry-failed", help="Retry samples that failed before.")
]
Deep = Annotated[
    bool,
    typer.Option(
        "--deep", help="Read all existing files, and make samples with damaged ones again."
    ),
]
Dask = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="Scheduler of a Dask cluster, instead of processes."),
]
Timeout = Annotated[
    int, number_option(1, 10**6, "Time limit of a sample in a local process, in seconds.")
]
SpaceTimeout = Annotated[
    int, number_option(0, 10**7, "Time to wait for space on a full disk, in seconds.")
]


if TYPE_CHECKING:
    from spisim.dataset.workers import Executor, Make

#: Exit status of a run that ran out of disk space.
OUT_OF_SPACE = 3


def executors(
    workers: int | None, dask: str | None, timeout_s: float
) -> Callable[[Make], Executor]:
    """Return executors: local processes, or the workers of a cluster.

    Raises InputError if both are requested.
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

    def remote(make: Make) -> Executor:
        if isinstance(make, Maker):
            return DaskExecutor(make, address, say, make.series.first_of)
        return DaskExecutor(make, address, say)

    return remote


@contextmanager
def explained() -> Iterator[None]:
    """Explain interruptions and full disks; the latter set the exit status."""
    from spisim.dataset.runner import OutOfSpace

    try:
        with resumed():
            yield
    except OutOfSpace as error:
        say(f"error: {error}", style="red")
        raise typer.Exit(OUT_OF_SPACE) from None

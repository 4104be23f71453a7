"""Arguments that the subcommands share, and `spisim study`."""

from pathlib import Path
from typing import Annotated

import typer

from ..options import number_option

Folder = Annotated[
    Path, typer.Argument(metavar="DIR", help="Folder of a data set.", show_default=False)
]
Workers = Annotated[int | None, number_option(1, 4096, "Processes; by default one per core.")]
RetryFailed = Annotated[
    bool, typer.Option("--retry-failed", help="Try samples again that failed before.")
]
Deep = Annotated[
    bool,
    typer.Option(
        "--deep", help="Read all files that are there, and make samples again that are damaged."
    ),
]
Dask = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="Scheduler of a Dask cluster, instead of processes."),
]
Timeout = Annotated[
    int, number_option(1, 10**6, "Seconds that a sample may take in a process of its own.")
]
SpaceTimeout = Annotated[int, number_option(0, 10**7, "Seconds to wait for space on a full disk.")]

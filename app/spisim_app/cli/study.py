"""`spisim study`: sweeps, their plots and tables, and a report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from . import complete
from .console import print_json, progress_bar, say
from .dataset.progress import progress_display
from .dataset.running import Dask, RetryFailed, SpaceTimeout, Timeout, Workers, executors, explained
from .options import Bar, Json, Overwrite
from .outputs import files_read

if TYPE_CHECKING:
    from spisim.dataset.study.run import Finished

EXAMPLE = "spisim study fog-and-rain -o out/fog --quick"


def command(
    plan: Annotated[
        str,
        typer.Argument(
            metavar="PLAN",
            help="What to compare: a YAML file, or the name of a shipped study.",
            autocompletion=complete.studies,
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder of captures and results.")
    ],
    workers: Workers = None,
    dask: Dask = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="The plan's small version, which takes a few minutes.")
    ] = False,
    retry_failed: RetryFailed = False,
    timeout: Timeout = 1800,
    space_timeout: SpaceTimeout = 3600,
    overwrite: Overwrite = False,
    json: Json = False,
    progress: Bar = None,
) -> None:
    """Simulate and reconstruct all combinations of a plan; write tables, plots and a report.

    Running it again makes missing samples. Exit status: 0 all done, 1 some samples failed, 2
    unusable input, 3 disk full, 130 interrupted.
    """
    from reconstruction.base.folders import output_folder
    from spisim.dataset.study import load_study, run_study, study_files
    from spisim_app.report.study import study_outputs, write_study

    planned = load_study(plan)
    if quick:
        planned = planned.quick()
    folder = output.absolute()
    files = [*study_files(folder, planned), *study_outputs(folder, planned)]
    executor = executors(workers, dask, timeout)
    with output_folder(folder, files, files_read(plan), overwrite=overwrite), explained():
        with progress_display(progress) as made, progress_bar("Evaluating", progress) as evaluated:
            finished = run_study(
                planned,
                folder,
                executor,
                retry_failed=retry_failed,
                space_timeout_s=space_timeout,
                say=say,
                made=made,
                evaluated=evaluated,
            )
        pages = write_study(folder, finished.results)
    _tell(finished, (*pages, *finished.written), json)
    raise typer.Exit(1 if finished.failed else 0)


def _tell(finished: Finished, written: tuple[Path, ...], json: bool) -> None:
    report = written[0]
    if json:
        print_json({**finished.summary(), "written": written})
        return
    say(f"{finished.evaluated} samples evaluated, {finished.failed} failed")
    say(f"Wrote {len(written)} files into {report.parent}")
    say(f"Look at it: {report.as_uri()}")

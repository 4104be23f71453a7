"""`spisim dataset run`: make the captures of a plan."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from reconstruction.base.errors import InputError

from ..console import print_json, say
from ..options import Bar, Json, number_option
from .costs import print_preview
from .progress import progress_display
from .running import Dask, Deep, RetryFailed, SpaceTimeout, Timeout, Workers, executors, explained

if TYPE_CHECKING:
    from spisim.dataset.planned import PlannedSet
    from spisim.dataset.runner import State
    from spisim.dataset.workers import Executor, Make

EXAMPLE = "spisim dataset plan.yaml -o fog --workers 2"


def command(
    plan: Annotated[Path, typer.Argument(metavar="PLAN", help="What to make: a YAML file.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="DIR", help="Folder of the data set.")
    ] = None,
    workers: Workers = None,
    samples: Annotated[
        int | None, number_option(1, 10**7, "Number of samples, instead of the plan's.")
    ] = None,
    retry_failed: RetryFailed = False,
    deep: Deep = False,
    dask: Dask = None,
    timeout: Timeout = 1800,
    space_timeout: SpaceTimeout = 3600,
    dry_run: Annotated[
        bool,
        typer.Option(
            "--dry-run",
            help="Only check the plan, and estimate what it would cost; no file is kept.",
        ),
    ] = False,
    pilot: Annotated[
        int | None,
        number_option(
            1,
            10_000,
            "Make only so many samples, of every scene and weather, and estimate the cost of "
            "all; a run into the same folder goes on from them. With --dry-run 12 by default.",
        ),
    ] = None,
    json: Json = False,
    progress: Bar = None,
) -> None:
    """Make the captures of a plan in a folder; running it again makes missing ones.

    Exit status: 0 all done, 1 some samples failed, 2 unusable input, 3 disk full, 130 interrupted.
    """
    from reconstruction.base.files import require_folder
    from spisim.dataset.folder import Layout, has_its_content, has_its_size
    from spisim.dataset.planned import load_plan
    from spisim.dataset.preview import check
    from spisim.dataset.runner import run_dataset
    from spisim.dataset.sample import Maker
    from spisim.transport.backend import activate

    planned = load_plan(plan)
    if samples is not None:
        planned = planned.with_samples(samples)
    executor = executors(workers, dask, timeout)
    if dry_run:
        with tempfile.TemporaryDirectory() as passing:
            _estimate(planned, Path(passing), executor, workers, pilot, json, progress)
        return
    if output is None:
        raise InputError("--output DIR is missing")
    folder = output.absolute()
    require_folder(folder)
    stored = Layout(folder).plan
    if samples is not None and stored.exists() and stored.samefile(plan):
        raise InputError(f"--samples would change {plan}: change it there, or rename it")
    if pilot is not None:
        _estimate(planned, folder, executor, workers, pilot, json, progress)
        return
    check(planned)
    activate()  # fails once here rather than in every process
    with explained(), progress_display(progress) as update:
        state = run_dataset(
            planned,
            folder,
            executor(Maker(planned, folder)),
            retry_failed=retry_failed,
            is_sound=has_its_content if deep else has_its_size,
            space_timeout_s=space_timeout,
            say=say,
            progress=update,
        )
    _tell(folder, state, json)
    raise typer.Exit(1 if state.failed else 0)


def _estimate(
    planned: PlannedSet,
    folder: Path,
    executor: Callable[[Make], Executor],
    workers: int | None,
    pilot: int | None,
    json: bool,
    progress: bool | None,
) -> None:
    from spisim.dataset.preview import PILOT_SAMPLES, preview
    from spisim.dataset.workers import default_workers
    from spisim.transport.backend import activate

    activate()
    with explained(), progress_display(progress) as update:
        result = preview(
            planned,
            folder,
            executor,
            workers or default_workers(),
            pilot=pilot or PILOT_SAMPLES,
            progress=update,
        )
    if json:
        print_json(result.summary())
    else:
        print_preview(result)


def _tell(folder: Path, state: State, json: bool) -> None:
    from spisim.dataset.folder import Layout
    from spisim.dataset.manifest import Manifest

    with Manifest.open(Layout(folder).manifest) as manifest:
        failures = manifest.failures()
    if json:
        print_json({"folder": folder, **vars(state), "failures": failures})
        return
    for index, reason in list(failures.items())[:5]:
        say(f"sample {index} failed: {reason}")
    say(f"{state.done} of {state.samples} samples are done in {folder}, {state.failed} failed")
    if failures:
        say(f"Their tracebacks are in {folder / 'errors'}; retry with --retry-failed")

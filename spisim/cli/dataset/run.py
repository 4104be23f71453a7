"""`spisim dataset run`: a plan becomes many captures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..console import messages, print_json, results
from ..options import Bar, Json, number_option
from .progress import short_time, shown

if TYPE_CHECKING:
    from spisim.dataset.plan import PlannedSet
    from spisim.dataset.runner import State
    from spisim.dataset.workers import Executor

EXAMPLE = "spisim dataset plan.yaml -o fog --workers 2"

#: Exit status of a run that waited for space in vain.
OUT_OF_SPACE = 3


def command(
    plan: Annotated[Path, typer.Argument(metavar="PLAN", help="What to make: a YAML file.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="DIR", help="Folder of the data set.")
    ] = None,
    workers: Annotated[
        int | None, number_option(1, 4096, "Processes; by default one per core.")
    ] = None,
    samples: Annotated[
        int | None, number_option(1, 10**9, "Instead of the plan's number of samples.")
    ] = None,
    retry_failed: Annotated[
        bool, typer.Option("--retry-failed", help="Try samples again that failed before.")
    ] = False,
    dask: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Scheduler of a Dask cluster, instead of processes."),
    ] = None,
    timeout: Annotated[
        int, number_option(1, 10**6, "Seconds that a sample may take in a process of its own.")
    ] = 1800,
    space_timeout: Annotated[
        int, number_option(0, 10**7, "Seconds to wait for space on a full disk.")
    ] = 3600,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only check the plan, and tell what it would cost.")
    ] = False,
    json: Json = False,
    progress: Bar = None,
) -> None:
    """Make the captures of a plan in a folder; run again, it makes those that are missing.

    Exit status: 0 all done, 1 some samples failed, 2 input that cannot be used, 3 no space left,
    130 interrupted.
    """
    from reconstruction.errors import InputError
    from spisim.dataset.plan import load_plan
    from spisim.dataset.preview import check
    from spisim.dataset.runner import OutOfSpace, run_dataset
    from spisim.dataset.workers import default_workers
    from spisim.transport.backend import activate

    planned = load_plan(plan)
    if samples is not None:
        planned = planned.with_samples(samples)
    if dry_run:
        _dry_run(planned, workers or default_workers(), json)
        return
    if output is None:
        raise InputError("--output DIR is missing")
    if dask is not None and workers is not None:
        raise InputError("--workers and --dask exclude each other")
    check(planned)
    activate()  # before every process finds out by itself that light cannot be traced
    folder = output.absolute()
    executor = _executor(planned, folder, workers or default_workers(), dask, timeout)
    try:
        with shown(progress) as update:
            state = run_dataset(
                planned,
                folder,
                executor,
                retry_failed=retry_failed,
                space_timeout_s=space_timeout,
                say=_say,
                progress=update,
            )
    except OutOfSpace as error:
        messages.print(f"error: {error}", style="red", markup=False, soft_wrap=True)
        raise typer.Exit(OUT_OF_SPACE) from None
    except KeyboardInterrupt:
        _say("interrupted; no file is left half-written. Run the same command again to go on")
        raise typer.Exit(130) from None
    _tell(folder, state, json)
    raise typer.Exit(1 if state.failed else 0)


def _executor(
    planned: PlannedSet, folder: Path, workers: int, dask: str | None, timeout_s: float
) -> Executor:
    from spisim.dataset.sample import Maker

    make = Maker(planned, folder)
    if dask is not None:
        from spisim.dataset.dask import DaskExecutor

        return DaskExecutor(make, dask)
    from spisim.dataset.workers import LocalExecutor

    return LocalExecutor(make, workers, timeout_s)


def _dry_run(planned: PlannedSet, workers: int, json: bool) -> None:
    from spisim.dataset.preview import preview

    told = preview(planned, workers)
    if json:
        print_json(told.summary())
        return
    for sample in told.shown:
        values = ", ".join(f"{name}: {_brief(value)}" for name, value in sample.parameters.items())
        results.print(f"{sample.index:6}  {sample.scene_name}  {values}", markup=False)
    results.print(
        f"{told.samples} samples, {told.bytes / 1e6:.0f} MB, about "
        f"{short_time(told.seconds)} with {workers} workers "
        f"({told.seconds_per_sample:.1f} s and {told.bytes_per_sample / 1e3:.0f} kB each)"
    )


def _tell(folder: Path, state: State, json: bool) -> None:
    from spisim.dataset.folder import Layout
    from spisim.dataset.manifest import Manifest

    with Manifest.open(Layout(folder).manifest) as manifest:
        failures = manifest.failures()
    if json:
        print_json(
            {
                "folder": folder,
                "samples": state.samples,
                "done": state.done,
                "failed": state.failed,
                "made": state.made,
                "seconds": state.seconds,
                "failures": failures,
            }
        )
        return
    for index, reason in list(failures.items())[:5]:
        _say(f"sample {index} failed: {reason}")
    _say(f"{state.done} of {state.samples} samples are done in {folder}, {state.failed} failed")
    if failures:
        _say(f"Their tracebacks are in {folder / 'errors'}; --retry-failed tries them again")


def _say(text: str) -> None:
    messages.print(text, markup=False, soft_wrap=True)


def _brief(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)

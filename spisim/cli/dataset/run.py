"""`spisim dataset run`: a plan becomes many captures."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from reconstruction.base.errors import InputError

from ..console import print_json, results, say
from ..options import Bar, Json, number_option
from .arguments import Dask, Deep, RetryFailed, SpaceTimeout, Timeout, Workers
from .progress import short_time, shown
from .running import executors, explained

if TYPE_CHECKING:
    from spisim.dataset.planned import PlannedSet
    from spisim.dataset.runner import State

EXAMPLE = "spisim dataset plan.yaml -o fog --workers 2"


def command(
    plan: Annotated[Path, typer.Argument(metavar="PLAN", help="What to make: a YAML file.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="DIR", help="Folder of the data set.")
    ] = None,
    workers: Workers = None,
    samples: Annotated[
        int | None, number_option(1, 10**7, "Instead of the plan's number of samples.")
    ] = None,
    retry_failed: RetryFailed = False,
    deep: Deep = False,
    dask: Dask = None,
    timeout: Timeout = 1800,
    space_timeout: SpaceTimeout = 3600,
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
    from reconstruction.base.files import require_folder
    from spisim.dataset.folder import Layout, has_its_content, has_its_size
    from spisim.dataset.planned import load_plan
    from spisim.dataset.preview import check
    from spisim.dataset.runner import run_dataset
    from spisim.dataset.sample import Maker
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
    folder = output.absolute()
    require_folder(folder)
    kept = Layout(folder).plan
    if samples is not None and kept.exists() and kept.samefile(plan):
        raise InputError(f"--samples would change {plan}: change it there, or give it another name")
    executor = executors(workers, dask, timeout)
    check(planned)
    activate()  # before every process finds out by itself that light cannot be traced
    with explained(), shown(progress) as update:
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


def _dry_run(planned: PlannedSet, workers: int, json: bool) -> None:
    from spisim.dataset.preview import preview
    from spisim.dataset.records import flat

    told = preview(planned, workers)
    if json:
        print_json(told.summary())
        return
    rows = [dict(flat(sample.parameters)) for sample in told.shown]
    common = {k: v for k, v in rows[0].items() if all(k in row and row[k] == v for row in rows)}
    if common:
        results.print(f"   all  {_listed(common)}", soft_wrap=True)
    for sample, row in zip(told.shown, rows, strict=True):
        own = {name: value for name, value in row.items() if name not in common}
        line = f"{sample.index:6}  {sample.scene_name}  {_listed(own)}"
        results.print(line.rstrip(), soft_wrap=True)
    if told.samples > len(rows):
        results.print(f"   …  and {told.samples - len(rows)} more")
    results.print(
        f"{told.samples} samples, {told.bytes / 1e6:.3g} MB, about "
        f"{short_time(told.seconds)} with {workers} workers "
        f"({told.seconds_per_sample:.2g} s and {told.bytes_per_sample / 1e3:.3g} kB each)",
        soft_wrap=True,
    )


def _listed(parameters: Mapping[str, Any]) -> str:
    return ", ".join(f"{name}: {_brief(value)}" for name, value in parameters.items())


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
        say(f"Their tracebacks are in {folder / 'errors'}; --retry-failed tries them again")


def _brief(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)

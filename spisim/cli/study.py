"""`spisim study`: sweeps, their plots and tables, and a report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .console import messages, print_json, progress_bar
from .dataset.progress import shown
from .dataset.run import OUT_OF_SPACE
from .options import Bar, Json, number_option

if TYPE_CHECKING:
    from spisim.study.run import Finished

EXAMPLE = "spisim study studies/fog-and-rain.yaml -o out/fog --quick"


def command(
    plan: Annotated[Path, typer.Argument(metavar="PLAN", help="What to compare: a YAML file.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder of captures and results.")
    ],
    workers: Annotated[
        int | None, number_option(1, 4096, "Processes; by default one per core.")
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="The small setting that the plan has, in a few minutes.")
    ] = False,
    retry_failed: Annotated[
        bool, typer.Option("--retry-failed", help="Try samples again that failed before.")
    ] = False,
    json: Json = False,
    progress: Bar = None,
) -> None:
    """Simulate and reconstruct all that a plan compares; write tables, plots and a report.

    Run again, it makes what is missing. Exit status: 0 all done, 1 some samples failed, 2 input
    that cannot be used, 3 no space left, 130 interrupted.
    """
    from spisim.dataset.runner import OutOfSpace
    from spisim.dataset.workers import default_workers
    from spisim.study import load_study, run_study

    planned = load_study(plan)
    if quick:
        planned = planned.quick()
    try:
        with shown(progress) as made, progress_bar("Evaluating", progress) as evaluated:
            finished = run_study(
                planned,
                output.absolute(),
                workers or default_workers(),
                retry_failed=retry_failed,
                say=_say,
                made=made,
                evaluated=evaluated,
            )
    except OutOfSpace as error:
        messages.print(f"error: {error}", style="red", markup=False, soft_wrap=True)
        raise typer.Exit(OUT_OF_SPACE) from None
    except KeyboardInterrupt:
        _say("interrupted; no file is left half-written. Run the same command again to go on")
        raise typer.Exit(130) from None
    _tell(finished, json)
    raise typer.Exit(1 if finished.failed else 0)


def _tell(finished: Finished, json: bool) -> None:
    report = finished.written[0]
    if json:
        print_json(finished.summary())
        return
    _say(f"{finished.evaluated} samples evaluated, {finished.failed} failed")
    _say(f"Wrote {len(finished.written)} files into {report.parent}")
    _say(f"Look at it: {report.as_uri()}")


def _say(text: str) -> None:
    messages.print(text, markup=False, soft_wrap=True)

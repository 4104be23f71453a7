"""Run a study from its plan to its tables."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from reconstruction.base.errors import InputError
from reconstruction.base.files import Output, mark, write_atomically
from reconstruction.base.folders import locked_folder
from spisim.dataset.folder import Layout
from spisim.dataset.opening import Say
from spisim.dataset.preview import check
from spisim.dataset.runner import SPACE_TIMEOUT_S, State, run_dataset
from spisim.dataset.sample import Maker
from spisim.dataset.study.evaluation import evaluate_all
from spisim.dataset.study.metrics import named_methods
from spisim.dataset.study.plan import PlannedStudy
from spisim.dataset.study.results import Results, results_of, table_outputs, tables
from spisim.dataset.workers import Executor, Make
from spisim.transport.backend import activate

STUDY = "study.yaml"
#: The kind of file in its mark.
KIND = "study"


@dataclass(frozen=True)
class Finished:
    """The results of a study, the state of its data set, and the tables written."""

    results: Results
    state: State
    written: tuple[Path, ...]

    @property
    def evaluated(self) -> int:
        """Number of samples with metrics."""
        return sum(bool(row.metrics) for row in self.results.rows)

    @property
    def failed(self) -> int:
        """Number of samples without metrics: not simulated, or not reconstructed."""
        return len(self.results.rows) - self.evaluated

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready summary: the means with their intervals by combination."""
        study = self.results.planned.study
        return {
            "samples": self.state.samples,
            "made": self.state.made,
            "evaluated": self.evaluated,
            "failed": self.failed,
            "seconds": self.state.seconds,
            "means": [
                dict(zip(study.parameters, each.condition, strict=True))
                | {"metric": each.metric}
                | asdict(each.estimate)
                for each in self.results.summaries.values()
            ],
        }


def study_files(folder: Path, planned: PlannedStudy) -> list[Output]:
    """Return the files that a study writes beside its data set, apart from its report.

    Parameters
    ----------
    folder
        Folder of the data set.
    planned
        The study. If its plan is read from the folder, that file is not among them.
    """
    plan = Output(folder / STUDY, KIND)
    return table_outputs(folder) + ([] if _is_plan(planned, plan.path) else [plan])


def run_study(
    planned: PlannedStudy,
    folder: Path,
    executor: Callable[[Make], Executor],
    *,
    retry_failed: bool = False,
    space_timeout_s: float = SPACE_TIMEOUT_S,
    say: Say = print,
    made: Callable[[State], None] = lambda state: None,
    evaluated: Callable[[float], None] = lambda fraction: None,
) -> Finished:
    """Make the missing captures and metrics of a study, and write the tables.

    The folder is locked until the tables are written.

    Parameters
    ----------
    planned
        The study.
    folder
        Folder of the data set.
    executor
        Called twice for the workers: for captures and for metrics.
    retry_failed
        Whether to retry samples that failed before.
    space_timeout_s
        Time to wait for disk space.
    say
        Called with messages.
    made, evaluated
        Called with the progress of captures and of metrics.

    Raises
    ------
    InputError
        As `run_dataset`, and if all samples failed.
    OutOfSpace
        If the disk stayed full.
    """
    with locked_folder(folder):
        if not Layout(folder).plan.exists():  # an earlier run has checked the plan
            activate()  # fails once here rather than in every process
            check(planned.data_set)
        state = run_dataset(
            planned.data_set,
            folder,
            executor(Maker(planned.data_set, folder)),
            retry_failed=retry_failed,
            space_timeout_s=space_timeout_s,
            say=say,
            progress=made,
        )
        data, evaluations = evaluate_all(
            folder, executor, evaluated, named_methods(planned.study.metrics)
        )
        if not any(each.metrics for each in evaluations.values()):
            reasons = [record.error for record in data.failed]
            reasons += [evaluation.error for evaluation in evaluations.values()]
            reasons += ["the evaluation code changed meanwhile"]
            raise InputError(f"{folder}: all samples failed; the first reason is: {reasons[0]}")
        results = results_of(planned, (*data.records, *data.failed), evaluations)
        return Finished(results, state, _write(results, folder))


def _write(results: Results, folder: Path) -> tuple[Path, ...]:
    plan, comment = results.planned.text, f"# {mark(KIND)}\n"
    texts = tables(folder, results)
    if not _is_plan(results.planned, folder / STUDY):
        texts[folder / STUDY] = plan if comment in plan else comment + plan
    for path, content in texts.items():
        write_atomically(path, content.encode())
    return tuple(texts)


def _is_plan(planned: PlannedStudy, path: Path) -> bool:
    """Return whether a path is the file that the study was read from, which is left as it is."""
    return path.exists() and path.samefile(planned.path)

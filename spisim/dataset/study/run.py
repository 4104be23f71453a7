"""A study from its plan to its tables."""

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
#: Of the file, as its mark tells it.
KIND = "study"


@dataclass(frozen=True)
class Finished:
    """What a study found, how its data set went, and the tables that tell of it."""

    results: Results
    state: State
    written: tuple[Path, ...]

    @property
    def evaluated(self) -> int:
        """Number of samples with metrics."""
        return sum(bool(row.metrics) for row in self.results.rows)

    @property
    def failed(self) -> int:
        """Number of samples without: not simulated, or not reconstructed."""
        return len(self.results.rows) - self.evaluated

    def summary(self) -> dict[str, Any]:
        """JSON-ready; the means with their intervals by combination."""
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
    """Files that a study leaves in its folder beside its data set, those of this layer."""
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
    """Make what is missing of a study's captures and metrics; write the tables.

    The folder is that of the data set. `executor` is asked twice for those who work: for captures
    and for metrics. `made` and `evaluated` are told the progress.

    Raises InputError and OutOfSpace as `run_dataset`, and InputError where all samples failed. The
    folder is held until the tables are written.
    """
    with locked_folder(folder):
        if not Layout(folder).plan.exists():  # whatever an earlier run made was sound
            activate()  # before every process finds out by itself that light cannot be traced
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
            reasons += ["the code that evaluates changed meanwhile"]
            raise InputError(f"{folder}: all samples failed; the first one because: {reasons[0]}")
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
    """Whether a file is where the study was read from: then it stays as it is."""
    return path.exists() and path.samefile(planned.path)

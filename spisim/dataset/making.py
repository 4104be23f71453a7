"""Make data sets from Python."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from reconstruction.base.arrays import usual_float_errors
from reconstruction.base.errors import InputError
from spisim.dataset.planned import load_plan, stated_plan
from spisim.dataset.preview import check
from spisim.dataset.reader import DataSet, open_dataset
from spisim.dataset.runner import run_dataset
from spisim.dataset.sample import Maker
from spisim.dataset.workers import LocalExecutor
from spisim.transport.backend import check_backend

logger = logging.getLogger(__name__)


@usual_float_errors
def make_dataset(
    plan: str | Path | Mapping[str, Any],
    folder: str | Path,
    *,
    workers: int | None = None,
    retry_failed: bool = False,
    progress: Callable[[float], None] | None = None,
) -> DataSet:
    """Make the samples of a plan that a folder lacks, including those left by an earlier run.

    Parameters
    ----------
    plan
        A plan file, or its fields; file names in them are relative to the working folder.
    folder
        Of the data set: new, empty, or begun with this plan.
    workers
        Processes that make samples; by default one per core, as far as memory allows.
    retry_failed
        Whether to retry samples that failed before.
    progress
        Called with the attempted fraction of the samples, from 0 to 1.

    Returns
    -------
    DataSet
        A warning counts failed samples; `failed` of the data set lists them.

    Raises
    ------
    InputError
        If the plan or the folder cannot be used.
    OutOfSpace
        If the disk stayed full for an hour; call again to continue.
    """
    if workers is not None and workers < 1:
        raise InputError(f"workers should be at least 1; found {workers}")
    planned = stated_plan(plan) if isinstance(plan, Mapping) else load_plan(Path(plan))
    folder = Path(folder).absolute()
    check(planned)
    check_backend()  # fails once here rather than in every process
    state = run_dataset(
        planned,
        folder,
        LocalExecutor.of(Maker(planned, folder), workers),
        retry_failed=retry_failed,
        say=logger.warning,
        progress=lambda state: progress(state.fraction) if progress else None,
    )
    data = open_dataset(folder)
    if state.failed:
        first = data.failed[0]
        warnings.warn(
            f"{state.failed} of {state.samples} samples failed; sample {first.index}: "
            f"{first.error}",
            stacklevel=2,
        )
    return data

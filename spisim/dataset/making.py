"""Data sets from Python: a plan, a folder, and the samples that are missing in it."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from reconstruction.base.errors import InputError
from spisim.dataset.planned import load_plan, stated_plan
from spisim.dataset.preview import check
from spisim.dataset.reader import DataSet, open_dataset
from spisim.dataset.runner import run_dataset
from spisim.dataset.sample import Maker
from spisim.dataset.workers import LocalExecutor
from spisim.transport.backend import activate

logger = logging.getLogger(__name__)


def make_dataset(
    plan: str | Path | Mapping[str, Any],
    folder: str | Path,
    *,
    workers: int | None = None,
    retry_failed: bool = False,
    progress: Callable[[float], None] | None = None,
) -> DataSet:
    """Make the samples of a plan that a folder lacks, all or those that an earlier run left.

    Parameters
    ----------
    plan: a plan file, or the fields of one; files that these name lie in the working folder.
    folder: of the data set; it is new, empty, or begun with this plan.
    workers: processes that make samples; by default one per core, as far as the memory goes.
    retry_failed: whether samples that failed before are tried again.
    progress: called with the fraction of the samples that are tried, from 0 to 1.

    Returns
    -------
    The data set, opened. Samples that failed are warned of; `failed` of the data set has them.

    Raises
    ------
    InputError
        For a plan or a folder that cannot be used.
    OutOfSpace
        If the disk stayed full for an hour; the next call goes on.
    """
    if workers is not None and workers < 1:
        raise InputError(f"workers should be at least 1; found {workers}")
    planned = stated_plan(plan) if isinstance(plan, Mapping) else load_plan(Path(plan))
    folder = Path(folder).absolute()
    check(planned)
    activate()  # before every process finds out by itself that light cannot be traced
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

"""Export formats of data sets, known by the entry points of `spisim.exports` alone.

A writer takes the samples, a folder and the number of samples per file. It returns the paths of the
files. It raises InputError if they cannot be written.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from reconstruction.base.registry import Registry

if TYPE_CHECKING:
    from spisim.dataset.reader import DataSet

Writer = Callable[["DataSet", Path, int], list[Path]]

EXPORTS: Registry[Writer] = Registry(
    "export format",
    attribute="EXPORT",
    group="spisim.exports",
    hint="the formats that come with spisim are missing; reinstall it: pip install spisim",
)

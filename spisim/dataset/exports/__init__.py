"""Export formats for programs that do not read data sets, one module each.

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
    "export format", package=__name__, attribute="EXPORT", group="spisim.exports"
)

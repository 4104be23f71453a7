"""A packed data set: its manifest, its plan, and arrays that are mapped into memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from reconstruction.base.errors import InputError, nearest
from spisim.dataset.folder import Layout, has_its_content, has_its_size
from spisim.dataset.manifest import read_manifest
from spisim.dataset.records import Record

INDEX = "pack.json"
FORMAT: Literal[1] = 1

_Count = Annotated[int, Field(ge=0)]


class PackedArray(BaseModel):
    """What a pack tells of one of its arrays, (samples, …)."""

    model_config = ConfigDict(strict=True, extra="forbid")

    file: Annotated[str, Field(pattern=r"^\d{3}\.npy$")]
    bytes: _Count
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    dims: list[str]
    units: str
    meaning: str


class Index(BaseModel):
    """What stands in `pack.json`; `source` is the data set's folder, seen from the pack's."""

    model_config = ConfigDict(strict=True, extra="forbid")

    made: str
    format: Literal[1]
    source: str
    source_samples: _Count
    arrays: dict[str, PackedArray]


@dataclass(frozen=True, eq=False)
class Pack:
    """Arrays of the samples in the rows of `indices`; copies in other processes map them anew."""

    folder: Path
    index: Index
    indices: NDArray[np.int64]  # of the samples, ascending

    @classmethod
    def of(cls, folder: Path, records: Sequence[Record]) -> Pack | None:
        """The pack that a folder holds, whose finished samples are given; None if it holds none.

        Raises InputError for one that is damaged, or whose data set has other samples by now.
        """
        layout = Layout(folder)
        path = layout.own(folder / INDEX)
        if not path.is_file():
            return None
        try:
            index = Index.model_validate_json(path.read_bytes())
        except ValidationError as error:
            where = ".".join(map(str, error.errors()[0]["loc"]))
            raise InputError(f"{path}: no index of a pack of format {FORMAT}: {where}") from None
        pack = cls(folder, index, np.array([record.index for record in records], np.int64))
        pack.check_source(records)
        _ = pack.columns  # whose sizes are checked once, here
        return pack

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "columns"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)

    @cached_property
    def columns(self) -> dict[str, NDArray[Any]]:
        """The arrays, mapped; InputError for one that is not as the index tells."""
        return {name: self._mapped(name, reported) for name, reported in self.index.arrays.items()}

    def _mapped(self, name: str, reported: PackedArray) -> NDArray[Any]:
        path = Layout(self.folder).own(self.folder / reported.file)
        try:
            column = np.load(path, mmap_mode="r", allow_pickle=False)
        except (OSError, ValueError, EOFError) as error:
            raise InputError(f"{path}: {name} cannot be read ({error}); pack again") from None
        if not has_its_size(path, vars(reported)) or column.shape[:1] != self.indices.shape:
            raise InputError(f"{path}: {name} is not as it was written; pack again")
        return np.asarray(column)  # slices of a memmap cost more than what they copy

    def column(self, name: str) -> NDArray[Any]:
        """An array of all samples; InputError, naming the nearest, where the pack has none."""
        if name not in self.columns:
            raise InputError(
                f"{self.folder}: the pack holds no {name!r}: {nearest(name, self.columns)}; "
                "pack again with it, or open the data set"
            )
        return self.columns[name]

    def rows(self, indices: Sequence[int]) -> NDArray[np.intp]:
        """Rows of samples."""
        return np.searchsorted(self.indices, indices)

    def check_source(self, records: Sequence[Record]) -> None:
        """InputError if the data set, where it is still there, has other samples than then."""
        source = (self.folder / self.index.source).resolve()
        try:
            _, there = read_manifest(source)
        except InputError:  # the pack was moved, or the data set is gone
            return
        now = {record.index: record.sha256 for record in there if record.done}
        same = all(now.get(record.index) == record.sha256 for record in records)
        if not same or len(now) != self.index.source_samples:
            raise InputError(
                f"{self.folder} was packed when {source} had {self.index.source_samples} samples; "
                f"it has {len(now)} now{'' if same else ', and others'}: pack it again, or move "
                "the pack elsewhere to go on with what it holds"
            )

    def damaged(self) -> Iterator[tuple[str, str]]:
        """Files whose SHA-256 is another than when they were written, and what is wrong."""
        for reported in self.index.arrays.values():
            if not has_its_content(self.folder / reported.file, vars(reported)):
                yield reported.file, "another SHA-256 than when it was written"

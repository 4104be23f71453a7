"""A packed data set: manifest, plan, and memory-mapped arrays."""

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
    """Entry of one array (samples, …) in the index of a pack."""

    model_config = ConfigDict(strict=True, extra="forbid")

    file: Annotated[str, Field(pattern=r"^\d{3}\.npy$")]
    bytes: _Count
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    dims: list[str]
    units: str
    meaning: str


class Index(BaseModel):
    """Contents of `pack.json`; `source` is the data set's folder relative to the pack."""

    model_config = ConfigDict(strict=True, extra="forbid")

    made: str
    format: Literal[1]
    source: str
    source_samples: _Count
    arrays: dict[str, PackedArray]


@dataclass(frozen=True, eq=False)
class Pack:
    """Arrays of the samples whose indices are given; a pickled copy maps them again."""

    folder: Path
    index: Index
    indices: NDArray[np.int64]  # ascending

    @classmethod
    def of(cls, folder: Path, records: Sequence[Record]) -> Pack | None:
        """Return the pack in a folder with these finished samples, or None if there is none.

        Raises InputError if it is damaged or no longer matches its data set.
        """
        layout = Layout(folder)
        path = layout.own(folder / INDEX)
        if not path.is_file():
            return None
        try:
            index = Index.model_validate_json(path.read_bytes())
        except ValidationError as error:
            where = ".".join(map(str, error.errors()[0]["loc"]))
            raise InputError(
                f"{path}: {where}: invalid in a pack index of format {FORMAT}"
            ) from None
        pack = cls(folder, index, np.array([record.index for record in records], np.int64))
        pack.check_source(records)
        _ = pack.columns  # checks their sizes
        return pack

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "columns"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)

    @cached_property
    def columns(self) -> dict[str, NDArray[Any]]:
        """The mapped arrays by name. Raises InputError if one differs from its index entry."""
        return {name: self._mapped(name, entry) for name, entry in self.index.arrays.items()}

    def _mapped(self, name: str, entry: PackedArray) -> NDArray[Any]:
        path = Layout(self.folder).own(self.folder / entry.file)
        try:
            column = np.load(path, mmap_mode="r", allow_pickle=False)
        except (OSError, ValueError, EOFError) as error:
            raise InputError(f"{path}: {name} cannot be read ({error}); pack again") from None
        if not has_its_size(path, vars(entry)) or column.shape[:1] != self.indices.shape:
            raise InputError(f"{path}: {name} differs from when it was packed; pack again")
        return np.asarray(column)  # slicing a memmap is slower than copying the slice

    def column(self, name: str) -> NDArray[Any]:
        """Return an array of all samples. Raises InputError if the pack has no such array."""
        if name not in self.columns:
            raise InputError(
                f"{self.folder}: the pack has no array {name!r}: {nearest(name, self.columns)}; "
                "pack it too, or open the data set"
            )
        return self.columns[name]

    def rows(self, indices: Sequence[int]) -> NDArray[np.intp]:
        """Return the rows of samples with these indices."""
        return np.searchsorted(self.indices, indices)

    def check_source(self, records: Sequence[Record]) -> None:
        """Raise InputError if the data set is still there, but its samples have changed."""
        source = (self.folder / self.index.source).resolve()
        try:
            _, there = read_manifest(source)
        except InputError:  # the pack or the data set was moved
            return
        now = {record.index: record.sha256 for record in there if record.done}
        same = all(now.get(record.index) == record.sha256 for record in records)
        if not same or len(now) != self.index.source_samples:
            raise InputError(
                f"{self.folder} was packed when {source} had {self.index.source_samples} samples; "
                f"it now has {len(now)}{'' if same else ', some of them changed'}; pack it again, "
                "or move the pack elsewhere to use it as it is"
            )

    def damaged(self) -> Iterator[tuple[str, str]]:
        """Yield files whose SHA-256 has changed, and what is wrong."""
        for entry in self.index.arrays.values():
            if not has_its_content(self.folder / entry.file, vars(entry)):
                yield entry.file, "SHA-256 differs from when it was written"

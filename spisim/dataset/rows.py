"""Arrays of a data set, sample by sample, from captures or from a pack."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, overload

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from spisim.dataset.pack import Pack

Row = dict[str, NDArray[Any]]


class Sample(Protocol):
    """What a row needs of a sample."""

    @property
    def index(self) -> int: ...
    def array(self, name: str) -> NDArray[Any]: ...


@dataclass(frozen=True, eq=False)
class CaptureRows(Sequence[Row]):
    """Rows read from the captures on access."""

    samples: Sequence[Sample]
    names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.samples)

    @overload
    def __getitem__(self, position: int) -> Row: ...
    @overload
    def __getitem__(self, position: slice) -> CaptureRows: ...
    def __getitem__(self, position: int | slice) -> Row | CaptureRows:
        if isinstance(position, slice):
            return CaptureRows(self.samples[position], self.names)
        sample = self.samples[position]
        index = np.array(sample.index)
        return {name: sample.array(name) for name in self.names} | {"index": index}


@dataclass(frozen=True, eq=False)
class PackedRows(Sequence[Row]):
    """Rows of a pack's arrays (views) and of numeric parameters."""

    pack: Pack
    names: tuple[str, ...]
    rows: NDArray[np.intp]  # in the pack
    numbers: Mapping[str, NDArray[Any]]  # numeric parameters by name

    def __len__(self) -> int:
        return len(self.rows)

    @overload
    def __getitem__(self, position: int) -> Row: ...
    @overload
    def __getitem__(self, position: slice) -> PackedRows: ...
    def __getitem__(self, position: int | slice) -> Row | PackedRows:
        if isinstance(position, slice):
            numbers = {name: values[position] for name, values in self.numbers.items()}
            return PackedRows(self.pack, self.names, self.rows[position], numbers)
        row = self.rows[position]
        columns = self.pack.columns
        arrays = {
            name: np.asarray(self.numbers[name][position])
            if name in self.numbers
            else columns[name][row]
            for name in self.names
        }
        return arrays | {"index": self.pack.indices[row, ...]}

"""Named arrays of one sample after the other, from its capture or from a pack."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from spisim.dataset.pack import Pack
    from spisim.dataset.reader import DataSet

Row = dict[str, NDArray[Any]]


@dataclass(frozen=True, eq=False)
class CaptureRows(Sequence[Row]):
    """Read from the captures when asked for."""

    samples: DataSet
    names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.samples)

    @overload
    def __getitem__(self, place: int) -> Row: ...
    @overload
    def __getitem__(self, place: slice) -> CaptureRows: ...
    def __getitem__(self, place: int | slice) -> Row | CaptureRows:
        if isinstance(place, slice):
            return CaptureRows(self.samples[place], self.names)
        sample = self.samples[place]
        index = np.array(sample.index)
        return {name: sample.array(name) for name in self.names} | {"index": index}


@dataclass(frozen=True, eq=False)
class PackedRows(Sequence[Row]):
    """Views of a pack's arrays, and numbers among the parameters."""

    pack: Pack
    names: tuple[str, ...]
    rows: NDArray[np.intp]  # of the samples in the pack
    numbers: Mapping[str, NDArray[Any]]  # of the samples themselves, by name

    def __len__(self) -> int:
        return len(self.rows)

    @overload
    def __getitem__(self, place: int) -> Row: ...
    @overload
    def __getitem__(self, place: slice) -> PackedRows: ...
    def __getitem__(self, place: int | slice) -> Row | PackedRows:
        if isinstance(place, slice):
            numbers = {name: values[place] for name, values in self.numbers.items()}
            return PackedRows(self.pack, self.names, self.rows[place], numbers)
        row = self.rows[place]
        columns = self.pack.columns
        arrays = {
            name: np.asarray(self.numbers[name][place])
            if name in self.numbers
            else columns[name][row]
            for name in self.names
        }
        return arrays | {"index": self.pack.indices[row, ...]}

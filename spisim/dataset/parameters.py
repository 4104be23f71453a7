"""Parameters of all samples of a data set: what was drawn, and which of it are numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spisim.dataset.records import Record


@dataclass(frozen=True, eq=False)
class Parameters:
    """What was drawn for the samples of a whole data set, whichever of them are selected."""

    records: tuple[Record, ...]

    @cached_property
    def names(self) -> list[str]:
        """Names of all parameters, of whichever sample."""
        return list(dict.fromkeys(name for record in self.records for name in record.parameters))

    @cached_property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of those that are numbers, by name: in every sample that has them, and equal."""
        result: dict[str, tuple[int, ...] | None] = {}
        for record in self.records:
            for name, value in record.parameters.items():
                if value is not None:
                    shape = _shape(value)
                    result[name] = shape if result.get(name, shape) == shape else None
        return {name: shape for name, shape in result.items() if shape is not None}

    def number(self, name: str, values: Mapping[str, Any]) -> NDArray[Any]:
        """A parameter that is a number, of the sample that has these values; nan where it lacks it.

        Raises KeyError where no sample has a number of this name.
        """
        shape, value = self.shapes[name], values.get(name)
        return np.full(shape, np.nan) if value is None else np.asarray(value)


def common_parameters(records: Sequence[Record]) -> dict[str, Any]:
    """Parameters that have one and the same value in all samples."""
    first = records[0].parameters if records else {}
    return {
        name: value
        for name, value in first.items()
        if all(name in each.parameters and each.parameters[name] == value for each in records)
    }


def _shape(value: Any) -> tuple[int, ...] | None:
    """Shape of numbers; None for anything else."""
    if isinstance(value, int | float):
        return ()
    try:
        array = np.asarray(value)
    except ValueError:  # rows of different lengths
        return None
    return array.shape if array.dtype.kind in "biuf" else None

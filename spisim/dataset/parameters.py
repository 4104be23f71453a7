"""Parameters of all samples of a data set, and parts that share none of their values."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.errors import InputError
from spisim.dataset.records import Record

Part = TypeVar("Part")


@dataclass(frozen=True, eq=False)
class Parameters:
    """The parameters of all samples of a data set, including unselected ones."""

    records: tuple[Record, ...]

    @cached_property
    def names(self) -> list[str]:
        """Names of all parameters."""
        return list(dict.fromkeys(name for record in self.records for name in record.parameters))

    @cached_property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of numeric parameters by name, if equal in every sample that has them."""
        shapes: dict[str, tuple[int, ...] | None] = {}
        for record in self.records:
            for name, value in record.parameters.items():
                if value is not None:
                    shape = _shape(value)
                    shapes[name] = shape if shapes.get(name, shape) == shape else None
        return {name: shape for name, shape in shapes.items() if shape is not None}

    def number(self, name: str, values: Mapping[str, Any]) -> NDArray[Any]:
        """Return a numeric parameter of the sample with these values; nan if it lacks it.

        Raises KeyError if no sample has a numeric parameter of this name.
        """
        shape, value = self.shapes[name], values.get(name)
        return np.full(shape, np.nan) if value is None else np.asarray(value)


def common_parameters(records: Sequence[Record]) -> dict[str, Any]:
    """Return the parameters whose value is the same in all samples."""
    first = records[0].parameters if records else {}
    return {
        name: value
        for name, value in first.items()
        if all(name in each.parameters and each.parameters[name] == value for each in records)
    }


class Split(NamedTuple, Generic[Part]):
    """Something of each part, such as its fraction or its samples."""

    train: Part
    validation: Part
    test: Part


def part_of(key: str, fractions: Split[float], seed: int) -> str:
    """Return the name of the part of a key, by a hash of seed and key.

    Raises InputError unless the fractions are non-negative and sum to one.
    """
    if min(fractions) < 0 or not math.isclose(sum(fractions), 1, abs_tol=1e-9):
        raise InputError(
            f"fractions of train, validation and test should be from 0 to 1 and sum to 1; "
            f"found {', '.join(f'{fraction:g}' for fraction in fractions)}"
        )
    digest = hashlib.sha256(f"{seed}:{key}".encode()).digest()
    quantile = int.from_bytes(digest[:8]) / 2**64
    if quantile < fractions.train:
        return "train"
    return "validation" if quantile < fractions.train + fractions.validation else "test"


def _shape(value: Any) -> tuple[int, ...] | None:
    """Return the shape of numbers; None for anything else."""
    if isinstance(value, int | float):
        return ()
    try:
        array = np.asarray(value)
    except ValueError:  # rows of different lengths
        return None
    return array.shape if array.dtype.kind in "biuf" else None

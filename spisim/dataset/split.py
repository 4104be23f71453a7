"""Parts of a data set that share no scene."""

import hashlib
import math
from typing import Generic, NamedTuple, TypeVar

from reconstruction.base.errors import InputError

Part = TypeVar("Part")


class Split(NamedTuple, Generic[Part]):
    """Something of each part: its share, its samples."""

    train: Part
    validation: Part
    test: Part


def part_of(key: str, fractions: Split[float], seed: int) -> str:
    """Name of the part to which a key belongs, by a hash of seed and key.

    Raises InputError for shares that are negative or do not sum to one.
    """
    if min(fractions) < 0 or not math.isclose(sum(fractions), 1, abs_tol=1e-9):
        raise InputError(
            f"shares of train, validation and test should be from 0 to 1 and sum to 1; "
            f"found {', '.join(f'{fraction:g}' for fraction in fractions)}"
        )
    digest = hashlib.sha256(f"{seed}:{key}".encode()).digest()
    position = int.from_bytes(digest[:8]) / 2**64
    if position < fractions.train:
        return "train"
    return "validation" if position < fractions.train + fractions.validation else "test"

"""Seeds of what is drawn by chance, as part of a name: random:7."""

import numpy as np

from ..base.errors import InputError


def generator_of(kind: str, name: str, *, seeded: bool) -> np.random.Generator | None:
    """The random generator that a name asks for, as 7 in "random:7"; None of one not ``seeded``.

    Raises InputError where the seed is missing, none is needed, and it is no number from 0.
    """
    bare, colon, seed = name.partition(":")
    if not seeded:
        if colon:
            raise InputError(f"{kind} {bare!r} takes no seed; {seed!r} is not needed")
        return None
    if not (seed.isascii() and seed.isdecimal()):
        raise InputError(
            f"{kind} {name!r}: a seed is needed after a colon, a whole number from 0, as {bare}:1"
        )
    return np.random.default_rng(int(seed))

"""Errors that a user can cause, told in a sentence."""

from collections.abc import Iterable
from difflib import get_close_matches


class InputError(ValueError):
    """A file, option or value cannot be used; the message says which and what is allowed."""


def nearest(name: str, allowed: Iterable[str]) -> str:
    """Point from an unknown name to the known ones: ``did you mean 'x'? allowed: a, b, c``."""
    names = list(allowed)
    known = f"allowed: {', '.join(names)}"
    close = get_close_matches(name, names, n=1)
    return f"did you mean {close[0]!r}? {known}" if close else known

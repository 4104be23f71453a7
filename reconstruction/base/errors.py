"""Errors that a user can cause, told in a sentence."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from itertools import islice
from pathlib import Path

#: Names that are all told of.
MAX_NAMES = 24
#: Of a name, and names that are looked at: both may come from files of any size.
MAX_LETTERS, MAX_SEARCHED = 80, 10_000
#: Of what an error says that is not ours.
MAX_REPORTED = 500


class InputError(ValueError):
    """A file, option or value cannot be used; the message says which and what is allowed."""


class LimitError(InputError):
    """There is more of something than is read, which ends reading: nothing else makes up for it."""


@contextmanager
def naming(path: str | Path) -> Iterator[None]:
    """Put the file in front of the message of an InputError raised within, unless it is there."""
    try:
        yield
    except InputError as error:
        if str(error).startswith((f"{path}:", f"{path} is ")):
            raise
        raise type(error)(f"{path}: {error}") from error.__cause__


def explain(error: OSError) -> str:
    """What went wrong, and with which file where that is known."""
    if error.filename is None:
        return error.strerror or str(error)
    return f"{error.filename}: {error.strerror or error}"


def in_words(error: Exception) -> str:
    """What went wrong in one line; of an error that nobody has foreseen its kind, too."""
    if isinstance(error, OSError):
        return explain(error)
    text = " ".join(str(error).split())[:MAX_REPORTED]
    return text if isinstance(error, InputError) else f"{type(error).__name__}: {text}"


def nearest(name: str, allowed: Iterable[str]) -> str:
    """Point from an unknown name to the known ones: ``did you mean 'x'? allowed: a, b, c``.

    Of many names only those that are a little like it are told.
    """
    name, names = name[:MAX_LETTERS], [each[:MAX_LETTERS] for each in islice(allowed, MAX_SEARCHED)]
    if len(names) <= MAX_NAMES:
        available = f"allowed: {', '.join(names)}"
    else:
        like = get_close_matches(name, names, n=MAX_NAMES // 2, cutoff=0.5) or names[:3]
        available = f"allowed: {', '.join(like)} and {len(names) - len(like)} others"
    close = get_close_matches(name, names, n=1)
    return f"did you mean {close[0]!r}? {available}" if close else available

"""Errors that a user can cause, with messages of one sentence."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from itertools import islice
from pathlib import Path

#: Number of names up to which all are listed.
MAX_NAMES = 24
#: Limits of a name, and of names that are searched: both may come from untrusted files.
MAX_LETTERS, MAX_SEARCHED = 80, 10_000
#: Characters of a foreign error message.
MAX_REPORTED = 500


class InputError(ValueError):
    """A file, option or value cannot be used; the message states which, and what is allowed."""


class LimitError(InputError):
    """A file exceeds a limit, which ends reading: no other file format is tried."""


@contextmanager
def naming(path: str | Path) -> Iterator[None]:
    """Prefix the message of an InputError raised within by the file, unless it is there."""
    try:
        yield
    except InputError as error:
        if str(error).startswith((f"{path}:", f"{path} is ")):
            raise
        raise type(error)(f"{path}: {error}") from error.__cause__


def explain(error: OSError) -> str:
    """Message of an OSError, with its file if known."""
    if error.filename is None:
        return error.strerror or str(error)
    return f"{error.filename}: {error.strerror or error}"


def in_words(error: BaseException) -> str:
    """Message of any error in one line, with its type if it was not foreseen."""
    if isinstance(error, OSError):
        return explain(error)
    text = " ".join(str(error).split())[:MAX_REPORTED]
    return text if isinstance(error, InputError) else f"{type(error).__name__}: {text}"


def nearest(name: str, allowed: Iterable[str]) -> str:
    """Hint for an unknown name: ``did you mean 'x'? allowed: a, b, c``; of many, similar names."""
    name, names = name[:MAX_LETTERS], [each[:MAX_LETTERS] for each in islice(allowed, MAX_SEARCHED)]
    if len(names) <= MAX_NAMES:
        available = f"allowed: {', '.join(names)}"
    else:
        like = get_close_matches(name, names, n=MAX_NAMES // 2, cutoff=0.5) or names[:3]
        available = f"allowed: {', '.join(like)} and {len(names) - len(like)} others"
    close = get_close_matches(name, names, n=1)
    return f"did you mean {close[0]!r}? {available}" if close else available

"""Files that a command will write, checked before any work."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import yaml

from reconstruction.base.files import Output

INTERRUPTED = "interrupted; no file is left half-written"

#: Suffixes of files named by users, by the kind in the file's mark.
ENDINGS = {
    "simulated capture": (".h5", ".hdf5"),
    "transport image": (".exr",),
    "histograms": (".npz",),
    "radiance": (".exr",),
    "picture": (".png",),
    "scene view": (".png",),
    "budget": (".png",),
    "capture report": (".html", ".htm"),
    "contact sheet": (".html", ".htm"),
}

#: The C loader if available; names need no values.
_LOADER: Any = getattr(yaml, "CBaseLoader", yaml.BaseLoader)


def output(path: Path, kind: str, size_bytes: int = 1_000_000) -> Output:
    """Return a file of a kind under a name chosen by the user."""
    return Output(path, kind, ENDINGS[kind], size_bytes=size_bytes)


def beside(path: Path, kind: str, size_bytes: int = 1_000_000) -> Output:
    """Return a further file of another kind beside that of the user."""
    return output(path.parent / f"{path.stem}{ENDINGS[kind][0]}", kind, size_bytes)


def files_read(*names: str | Path) -> Iterator[Path]:
    """Return files of the user that a command reads, including those that they refer to.

    `names` are files or folders; shipped files do not count.
    """
    for path in map(Path, names):
        if path.exists():
            yield path
        if path.suffix in (".yaml", ".yml") and path.is_file():
            yield from _referred(path)


@contextmanager
def resumed() -> Iterator[None]:
    """On interruption, tell how to resume a command that keeps finished work."""
    try:
        yield
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"{INTERRUPTED}. Run the same command again to continue") from None


def _referred(path: Path) -> Iterator[Path]:
    """Yield everything in a YAML file that is the name of a file."""
    for word in _words(path):
        with suppress(OSError, ValueError):  # not a name
            if (file := path.parent / word).is_file():
                yield file


def _words(path: Path) -> Iterable[str]:
    words = set()
    with suppress(OSError, UnicodeDecodeError, yaml.YAMLError):  # reported when it is loaded
        for event in yaml.parse(path.read_text(encoding="utf-8"), _LOADER):
            if isinstance(event, yaml.ScalarEvent):
                words.add(event.value)
    return words

"""What a command will write, looked at before any work."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import yaml

from reconstruction.base.files import Output

INTERRUPTED = "interrupted; no file is left half-written"

#: Endings of the names of what users give a name to, by the kind that the file's mark tells.
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

#: The quick one, where there is one; names need no values.
_LOADER: Any = getattr(yaml, "CBaseLoader", yaml.BaseLoader)


def output(path: Path, kind: str, size_bytes: int = 1_000_000) -> Output:
    """A file of a kind, under a name that the user chose."""
    return Output(path, kind, ENDINGS[kind], size_bytes=size_bytes)


def beside(path: Path, kind: str, size_bytes: int = 1_000_000) -> Output:
    """A further file of another kind, beside the one that the user named."""
    return output(path.parent / f"{path.stem}{ENDINGS[kind][0]}", kind, size_bytes)


def files_read(*names: str | Path) -> Iterator[Path]:
    """Files of the user that a command reads, those included that they refer to.

    `names` are files or folders; what is shipped under a name is none of the user's.
    """
    for path in map(Path, names):
        if path.exists():
            yield path
        if path.suffix in (".yaml", ".yml") and path.is_file():
            yield from _referred(path)


@contextmanager
def resumed() -> Iterator[None]:
    """Tell who interrupts a command that keeps what is done how to go on with it."""
    try:
        yield
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"{INTERRUPTED}. Run the same command again to go on") from None


def _referred(path: Path) -> Iterator[Path]:
    """Whatever a YAML file says that is the name of a file."""
    for word in _words(path):
        with suppress(OSError, ValueError):  # no name at all
            if (file := path.parent / word).is_file():
                yield file


def _words(path: Path) -> Iterable[str]:
    words = set()
    with suppress(OSError, UnicodeDecodeError, yaml.YAMLError):  # told when it is loaded
        for event in yaml.parse(path.read_text(encoding="utf-8"), _LOADER):
            if isinstance(event, yaml.ScalarEvent):
                words.add(event.value)
    return words

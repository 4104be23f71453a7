"""The folder of measurements: which sets are there, and whether they are those of the pages."""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from measured_figures import MeasuredSet

HASHES = Path(__file__).with_name("measured.sha256")
"""SHA-256 of every file of every set, as sha256sum writes and checks it."""
SHOWN = 12
"""Digits of a hash that tables show."""


@dataclass(frozen=True)
class Found:
    """Where a set is (None if nowhere) and in what it differs from the published one."""

    folder: Path | None
    differences: tuple[str, ...] = ()
    shipped: bool = False

    @property
    def state(self) -> str:
        """In words."""
        if self.folder is None:
            return "missing"
        return "; ".join(self.differences) or ("as shipped" if self.shipped else "as published")


def find(measured: MeasuredSet, data: Path | None) -> Found:
    """A set among the data or, if they lack it, where it is shipped."""
    folder = data and data / measured.folder
    if folder is not None and folder.is_dir():
        return Found(folder, tuple(_differences(measured.folder, folder)))
    return Found(measured.shipped, shipped=True)


def _differences(name: str, folder: Path) -> Iterator[str]:
    published = {path: digest for path, digest in hashes().items() if path.startswith(f"{name}/")}
    there = {
        f"{name}/{path.relative_to(folder).as_posix()}": path
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }
    for path in sorted(published.keys() | there.keys()):
        if path not in there:
            yield f"{path} is missing"
        elif path not in published:
            yield f"{path} is not of the published set"
        elif (digest := digest_of(there[path])) != published[path]:
            yield f"{path} has the hash {digest[:SHOWN]}…, not {published[path][:SHOWN]}…"


@cache
def hashes() -> dict[str, str]:
    """Hash of each published file, by its path among the data."""
    lines = HASHES.read_text(encoding="utf-8").splitlines()
    return {path: digest for digest, path in (line.split(maxsplit=1) for line in lines)}


def digest_of(path: Path) -> str:
    """SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()

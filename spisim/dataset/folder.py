"""Where things lie in the folder of a data set."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

from reconstruction import Capture
from reconstruction.base.errors import InputError
from reconstruction.base.files import whole_name
from reconstruction.base.folders import LOCK
from spisim.base.config import load_yaml
from spisim.dataset.database import COMPANIONS
from spisim.dataset.records import Outcome

if TYPE_CHECKING:
    from spisim.dataset.planned import Sample

#: Samples that share a folder.
PER_FOLDER = 1000
#: Files beside a capture: the light's image, and its spots' histograms.
SIDECARS = (".exr", ".npz")

#: Files that runs write under temporary names first, and what tries how much space there is.
_WRITTEN = re.compile(
    r"plan\.yaml|space"
    r"|samples/\d{3,}/\d{6,}\.(h5|exr|npz)"
    r"|errors/\d{6,}\.txt"
    r"|metrics/\d{3,}/\d{6,}\.json"
)
_NO_LINKS = "{} is a link; a data set holds none, so that its folder is all that it touches"
_FOLDERS = ("samples", "errors", "metrics")
_DAMAGED = re.compile(r"manifest\.damaged-\d+\.sqlite(-journal|-wal|-shm)?")


#: Whether a file is as the manifest tells, by its path and what that tells of it.
Sound = Callable[[Path, Mapping[str, Any]], bool]


@dataclass(frozen=True)
class Layout:
    """Paths of a data set."""

    folder: Path

    @property
    def plan(self) -> Path:
        """The plan as it was run."""
        return self.folder / "plan.yaml"

    @property
    def manifest(self) -> Path:
        """SQLite file with a row for every sample that was tried."""
        return self.folder / "manifest.sqlite"

    @property
    def lock(self) -> Path:
        """Held by the process that runs the data set."""
        return self.folder / LOCK

    @property
    def samples(self) -> Path:
        """Folder of the captures and what lies beside them."""
        return self.folder / "samples"

    def capture(self, index: int) -> Path:
        """Capture of a sample."""
        return self.samples / f"{index // PER_FOLDER:03}" / f"{index:06}.h5"

    def error(self, index: int) -> Path:
        """Traceback of a sample that failed."""
        return self.folder / "errors" / f"{index:06}.txt"

    def metrics(self, index: int) -> Path:
        """Metrics of a capture, where a study is made of the data set."""
        return self.folder / "metrics" / f"{index // PER_FOLDER:03}" / f"{index:06}.json"

    def relative(self, path: Path) -> str:
        """Path as the manifest tells it."""
        return path.relative_to(self.folder).as_posix()

    def captures(self) -> Iterator[Path]:
        """All captures that are there, in order."""
        yield from sorted(self.samples.glob("*/*.h5"))

    def own(self, path: Path) -> Path:
        """The path of a file of the data set, which may be missing.

        Raises InputError where a link leads there, and for what is no regular file: others' data
        sets could have anything read or written by such.
        """
        if link := self.first_link(path):
            raise InputError(_NO_LINKS.format(link))
        if path.exists() and not path.is_file():
            raise InputError(f"{path} is not a regular file")
        return path

    def first_link(self, path: Path) -> Path | None:
        """The first link on the way from the folder to a path in it, which may be that itself."""
        inside = path.relative_to(self.folder).parts
        positions = (self.folder.joinpath(*inside[:depth]) for depth in range(1, len(inside) + 1))
        return next((position for position in positions if position.is_symlink()), None)

    def refuse_links(self) -> None:
        """InputError where anything that a run reads or writes is a link."""
        for path in everything(self.folder):
            if self._is_own(path.relative_to(self.folder).parts[0]) and path.is_symlink():
                raise InputError(_NO_LINKS.format(path))

    def strangers(self) -> list[str]:
        """Names in the folder that no run leaves there."""
        if not self.folder.is_dir():
            return []
        return sorted(path.name for path in self.folder.iterdir() if not self._is_own(path.name))

    def _is_own(self, name: str) -> bool:
        own = {self.plan.name, self.lock.name, *_FOLDERS}
        own |= {self.manifest.name + ending for ending in ("", *COMPANIONS)}
        return (
            name in own or self.is_unfinished(self.folder / name) or bool(_DAMAGED.fullmatch(name))
        )

    def is_unfinished(self, path: Path) -> bool:
        """Whether a file has the temporary name of one that a process of a run was writing."""
        whole = whole_name(path)
        return whole is not None and bool(_WRITTEN.fullmatch(self.relative(whole)))

    def remove_leftovers(self) -> None:
        """Remove what processes of runs that were killed had not finished writing.

        The folder has to be a data set's: see `opened`.
        """
        positions = (everything(self.folder / name) for name in _FOLDERS)
        for path in (*self.folder.iterdir(), *chain.from_iterable(positions)):
            if self.is_unfinished(path) and path.is_file():
                path.unlink(missing_ok=True)


def everything(folder: Path) -> Iterator[Path]:
    """All files, folders and links in a folder and its folders; nothing behind a link."""
    with suppress(FileNotFoundError), os.scandir(folder) as entries:
        for entry in entries:
            yield Path(entry.path)
            if entry.is_dir(follow_symlinks=False):
                yield from everything(Path(entry.path))


def fingerprint(path: Path) -> dict[str, Any]:
    """Size and SHA-256 of a file, `bytes` and `sha256`."""
    with path.open("rb") as file:
        return {
            "bytes": path.stat().st_size,
            "sha256": hashlib.file_digest(file, "sha256").hexdigest(),
        }


def has_its_size(path: Path, reported: Mapping[str, Any]) -> bool:
    """Whether a file is there and has as many bytes as the manifest tells."""
    with suppress(OSError):
        return bool(path.stat().st_size == reported["bytes"])
    return False


def has_its_content(path: Path, reported: Mapping[str, Any]) -> bool:
    """Whether a file is there and its SHA-256 is the one that the manifest tells."""
    return has_its_size(path, reported) and fingerprint(path)["sha256"] == reported["sha256"]


def done(layout: Layout, sample: Sample, beside: Iterable[Path]) -> Outcome:
    """Outcome of a sample whose capture, and what lies `beside` it, are written."""
    path = layout.capture(sample.index)
    return Outcome(
        sample.index,
        "done",
        scene=sample.scene_name,
        parameters=sample.parameters,
        file=layout.relative(path),
        **fingerprint(path),
        sidecars={layout.relative(each): fingerprint(each) for each in beside},
    )


@dataclass(frozen=True)
class Origin:
    """What a capture tells of the data set that it was made for."""

    plan: str  # its digest
    index: int
    sidecars: Mapping[str, str]  # SHA-256 of the files beside it, by their suffix

    @property
    def settings(self) -> dict[str, Any]:
        """As it stands in the settings of the capture."""
        return {"plan": self.plan, "index": self.index, "sidecars": dict(self.sidecars)}


def origin_of(capture: Capture) -> Origin | None:
    """Where a capture belongs; None for one of no data set."""
    with suppress(InputError, TypeError, KeyError, ValueError, AttributeError):
        reported = load_yaml(capture.provenance.settings, "settings")["data_set"]
        sidecars = {str(k): str(v) for k, v in reported.get("sidecars", {}).items()}
        return Origin(str(reported["plan"]), int(reported["index"]), sidecars)
    return None

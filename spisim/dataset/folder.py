"""Paths in the folder of a data set, and the identity of its files."""

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
from reconstruction.base.files import PROBE, whole_name
from reconstruction.base.folders import LOCK
from spisim.base.config import load_yaml
from spisim.dataset.database import COMPANIONS
from spisim.dataset.records import Outcome

if TYPE_CHECKING:
    from spisim.dataset.planned import Sample

#: Parameter of samples in a series of fogs: visibility of the fog whose paths carry their light.
TRACED_IN = "traced_visibility_m"
#: Samples per subfolder.
PER_FOLDER = 1000
#: Suffixes of files beside a capture: the transport image, and the spots' histograms.
SIDECARS = (".exr", ".npz")

#: Files that runs write under temporary names first, and probes of the folder.
_WRITTEN = re.compile(
    rf"plan\.yaml|manifest\.sqlite|{PROBE}"
    r"|samples/\d{3,}/\d{6,}\.(h5|exr|npz)"
    r"|errors/\d{6,}\.txt"
    r"|metrics/\d{3,}/\d{6,}\.json"
)
_NO_LINKS = "{} is a link; for safety, a data set must not contain any"
_FOLDERS = ("samples", "errors", "metrics")
_DAMAGED = re.compile(r"manifest\.damaged-\d+\.sqlite(-journal|-wal|-shm)?")


#: Whether a file matches its entry in the manifest.
Sound = Callable[[Path, Mapping[str, Any]], bool]


@dataclass(frozen=True)
class Layout:
    """Paths of a data set."""

    folder: Path

    @property
    def plan(self) -> Path:
        """The plan that was run."""
        return self.folder / "plan.yaml"

    @property
    def manifest(self) -> Path:
        """SQLite file with a row for every attempted sample."""
        return self.folder / "manifest.sqlite"

    @property
    def lock(self) -> Path:
        """Lock file of the process that runs the data set."""
        return self.folder / LOCK

    @property
    def samples(self) -> Path:
        """Folder of the captures and their sidecars."""
        return self.folder / "samples"

    def capture(self, index: int) -> Path:
        """Return the path of a sample's capture."""
        return self.samples / f"{index // PER_FOLDER:03}" / f"{index:06}.h5"

    def error(self, index: int) -> Path:
        """Return the path of the traceback of a failed sample."""
        return self.folder / "errors" / f"{index:06}.txt"

    def metrics(self, index: int) -> Path:
        """Return the path of a capture's metrics in a study."""
        return self.folder / "metrics" / f"{index // PER_FOLDER:03}" / f"{index:06}.json"

    def relative(self, path: Path) -> str:
        """Return a path as the manifest stores it."""
        return path.relative_to(self.folder).as_posix()

    def captures(self) -> Iterator[Path]:
        """Yield all existing captures in order."""
        yield from sorted(self.samples.glob("*/*.h5"))

    def own(self, path: Path) -> Path:
        """Return the path of a file of the data set, which may be missing.

        Raises InputError if a link leads there or it is no regular file, because an untrusted data
        set could use these to have other files read or overwritten.
        """
        if link := self.first_link(path):
            raise InputError(_NO_LINKS.format(link))
        if path.exists() and not path.is_file():
            raise InputError(f"{path} is not a regular file")
        return path

    def first_link(self, path: Path) -> Path | None:
        """Return the first symbolic link on the way from the folder to a path, or None."""
        inside = path.relative_to(self.folder).parts
        steps = (self.folder.joinpath(*inside[:depth]) for depth in range(1, len(inside) + 1))
        return next((step for step in steps if step.is_symlink()), None)

    def refuse_links(self) -> None:
        """Raise InputError if anything that a run reads or writes is a link."""
        for path in everything(self.folder):
            if self._is_own(path.relative_to(self.folder).parts[0]) and path.is_symlink():
                raise InputError(_NO_LINKS.format(path))

    def strangers(self) -> list[str]:
        """Return names in the folder that no run writes."""
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
        """Return whether a path is the temporary name of a file that a run writes."""
        whole = whole_name(path)
        return whole is not None and bool(_WRITTEN.fullmatch(self.relative(whole)))

    def remove_leftovers(self) -> None:
        """Remove unfinished files of killed runs.

        The folder must be known to be a data set's; see `opened`.
        """
        contents = (everything(self.folder / name) for name in _FOLDERS)
        for path in (*self.folder.iterdir(), *chain.from_iterable(contents)):
            if self.is_unfinished(path) and path.is_file():
                path.unlink(missing_ok=True)


def everything(folder: Path) -> Iterator[Path]:
    """Yield all files, folders and links below a folder, without following links."""
    with suppress(FileNotFoundError), os.scandir(folder) as entries:
        for entry in entries:
            yield Path(entry.path)
            if entry.is_dir(follow_symlinks=False):
                yield from everything(Path(entry.path))


def fingerprint(path: Path) -> dict[str, Any]:
    """Return the size and the SHA-256 of a file, as `bytes` and `sha256`."""
    with path.open("rb") as file:
        return {
            "bytes": path.stat().st_size,
            "sha256": hashlib.file_digest(file, "sha256").hexdigest(),
        }


def has_its_size(path: Path, recorded: Mapping[str, Any]) -> bool:
    """Return whether a file exists and has its recorded size."""
    with suppress(OSError):
        return bool(path.stat().st_size == recorded["bytes"])
    return False


def has_its_content(path: Path, recorded: Mapping[str, Any]) -> bool:
    """Return whether a file exists and has its recorded SHA-256."""
    return has_its_size(path, recorded) and fingerprint(path)["sha256"] == recorded["sha256"]


def done(
    layout: Layout,
    sample: Sample,
    beside: Iterable[Path],
    warnings: Iterable[str],
    traced_visibility_m: float | None = None,
) -> Outcome:
    """Return the outcome of a sample whose capture and sidecars (`beside`) are written."""
    path = layout.capture(sample.index)
    light = {} if traced_visibility_m is None else {TRACED_IN: traced_visibility_m}
    return Outcome(
        sample.index,
        "done",
        scene=sample.scene_name,
        parameters={**sample.parameters, **light},
        file=layout.relative(path),
        **fingerprint(path),
        sidecars={layout.relative(each): fingerprint(each) for each in beside},
        warnings=tuple(dict.fromkeys(warnings)),
    )


@dataclass(frozen=True)
class Origin:
    """Where a capture says that it belongs."""

    plan: str  # its digest
    index: int
    sidecars: Mapping[str, str]  # SHA-256 of the files beside it, by their suffix
    warnings: tuple[str, ...] = ()  # of its simulation
    #: Of the fog whose paths carry its light, in a series of fogs.
    traced_visibility_m: float | None = None

    @property
    def settings(self) -> dict[str, Any]:
        """Its form in the settings of the capture."""
        fields = {"plan": self.plan, "index": self.index, "sidecars": dict(self.sidecars)}
        if self.traced_visibility_m is not None:
            fields[TRACED_IN] = self.traced_visibility_m
        return fields | ({"warnings": list(self.warnings)} if self.warnings else {})


def origin_of(capture: Capture) -> Origin | None:
    """Return the origin of a capture; None if it belongs to no data set."""
    with suppress(InputError, TypeError, KeyError, ValueError, AttributeError):
        origin = load_yaml(capture.provenance.settings, "settings")["data_set"]
        sidecars = {str(k): str(v) for k, v in origin.get("sidecars", {}).items()}
        warnings = tuple(map(str, origin.get("warnings", ())))
        light = origin.get(TRACED_IN)
        traced_m = None if light is None else float(light)
        return Origin(str(origin["plan"]), int(origin["index"]), sidecars, warnings, traced_m)
    return None

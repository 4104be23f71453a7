"""Where things lie in the folder of a data set."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from reconstruction import Capture
from reconstruction.errors import InputError
from spisim.config import load_yaml
from spisim.dataset.records import Outcome

if TYPE_CHECKING:
    from spisim.dataset.plan import Sample

#: Samples that share a folder.
PER_FOLDER = 1000


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
        return self.folder / ".lock"

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

    def relative(self, path: Path) -> str:
        """Path as the manifest tells it."""
        return path.relative_to(self.folder).as_posix()

    def captures(self) -> Iterator[Path]:
        """All captures that are there, in order."""
        yield from sorted(self.samples.glob("*/*.h5"))

    def remove_leftovers(self) -> None:
        """Remove temporary files of processes that were killed while they wrote."""
        for place in (self.folder, self.samples, self.folder / "errors"):
            for pattern in (".*.tmp", "*/.*.tmp"):
                for path in place.glob(pattern):
                    path.unlink(missing_ok=True)


def fingerprint(path: Path) -> dict[str, Any]:
    """Size and SHA-256 of a file, `bytes` and `sha256`."""
    with path.open("rb") as file:
        return {
            "bytes": path.stat().st_size,
            "sha256": hashlib.file_digest(file, "sha256").hexdigest(),
        }


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


def belongs_to(capture: Capture) -> tuple[str, int] | None:
    """Digest of the plan that a capture was made for, and its index there; None for others."""
    with suppress(InputError, TypeError, KeyError, ValueError):
        told = load_yaml(capture.provenance.settings, "settings")["data_set"]
        return str(told["plan"]), int(told["index"])
    return None

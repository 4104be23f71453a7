"""Verify that the files of a data set match its manifest."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from reconstruction import InputError, read_capture
from spisim.dataset.folder import Layout, everything, fingerprint, origin_of
from spisim.dataset.manifest import read_manifest
from spisim.dataset.pack import Pack
from spisim.dataset.records import Record

Problem = Literal["missing", "damaged", "link", "foreign", "extra", "unfinished"]


@dataclass(frozen=True)
class Finding:
    """A problem with a file; `file` is its path within the data set.

    - missing: listed in the manifest, but not there
    - damaged: differs from what was written
    - link: a symbolic link, whose target is not part of the data set
    - foreign: a capture of another plan
    - extra: not in the manifest
    - unfinished: left by an interrupted run
    """

    file: str
    problem: Problem
    detail: str


def verify(folder: Path, progress: Callable[[float], None] | None = None) -> list[Finding]:
    """Read every file of a data set and compare it with the manifest.

    Parameters
    ----------
    folder
        A data set or a pack.
    progress
        Called with the completed fraction, from 0 to 1.

    Returns
    -------
    list of Finding
        The problems, sorted by file.

    Raises
    ------
    InputError
        If the folder holds no data set, or its manifest is damaged.
    """
    meta, records = read_manifest(folder)
    pack = Pack.of(folder, [record for record in records if record.done])
    if pack is not None:
        return [Finding(name, "damaged", detail) for name, detail in pack.damaged()]
    findings: list[Finding] = []
    layout = Layout(folder)
    if not layout.plan.is_file():
        findings.append(Finding(layout.plan.name, "missing", "the plan of the samples"))
    done = [record for record in records if record.done]
    given: set[str] = set()
    for number, record in enumerate(done, start=1):
        given |= {str(record.file), *record.sidecars}
        findings += _of_record(layout, record)
        if progress:
            progress(number / len(done))
    for path in everything(folder):
        name = layout.relative(path)
        if path.is_symlink():
            findings.append(Finding(name, "link", f"to {path.readlink()}"))
        elif layout.samples in path.parents and not path.is_dir() and name not in given:
            findings.append(_unknown(layout, path, name, meta["plan_digest"]))
    return sorted(findings, key=lambda finding: finding.file)


def _of_record(layout: Layout, record: Record) -> Iterator[Finding]:
    capture = {str(record.file): {"bytes": record.bytes, "sha256": record.sha256}}
    for name, recorded in (capture | dict(record.sidecars)).items():
        path = layout.folder / name
        if layout.first_link(path):
            continue  # reported separately
        if not path.is_file():
            yield Finding(name, "missing", f"of sample {record.index}")
        elif (size := path.stat().st_size) != recorded["bytes"]:
            yield Finding(name, "damaged", f"{size} bytes instead of {recorded['bytes']}")
        elif fingerprint(path)["sha256"] != recorded["sha256"]:
            yield Finding(name, "damaged", "SHA-256 differs from when it was written")


def _unknown(layout: Layout, path: Path, name: str, plan: str) -> Finding:
    if layout.is_unfinished(path):
        return Finding(name, "unfinished", "left by an interrupted run; can be removed")
    if path.suffix != ".h5":
        return Finding(name, "extra", "not in the manifest")
    try:
        origin = origin_of(read_capture(path))
    except InputError:
        return Finding(name, "extra", "not a readable capture")
    if origin is not None and origin.plan == plan:
        return Finding(name, "extra", "a capture of this plan that is not in the manifest")
    return Finding(name, "foreign", "a capture of another plan or of no data set")

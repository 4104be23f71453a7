"""The folder of a data set made ready for a run: new, or as an earlier run left it."""

import difflib
import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import yaml

from reconstruction import read_capture
from reconstruction.errors import InputError
from reconstruction.files import require_folder, write_atomically
from spisim.dataset.folder import Layout, belongs_to, done
from spisim.dataset.lock import locked
from spisim.dataset.manifest import DamagedManifest, Manifest
from spisim.dataset.plan import PlannedSet, order_of
from spisim.version import __version__

Say = Callable[[str], None]

SOFTWARE = f"spisim {__version__}"


@contextmanager
def opened(planned: PlannedSet, folder: Path, say: Say) -> Iterator[Manifest]:
    """Manifest of a folder that fits the plan, locked for this process.

    What a run needs to start again is put in order: leftovers of killed processes go, samples
    whose files are gone are to be made again, captures that the manifest does not know are added
    to it, and a manifest that is damaged or lost is rebuilt from the captures.

    Raises InputError where the folder cannot be written, another run holds it, it holds samples of
    another plan or more of them than planned, or captures that are not of this data set.
    """
    layout = Layout(folder)
    require_folder(folder)
    folder.mkdir(parents=True, exist_ok=True)
    with locked(layout.lock):
        layout.remove_leftovers()
        if layout.plan.exists():
            _check_same_fields(planned, layout)
        with _manifest(planned, layout, say) as manifest:
            _check_same_files(planned, manifest, layout)
            _check_size(manifest.indices(), planned, layout)
            _forget_lost(manifest, layout, say)
            _adopt(planned, manifest, layout, say)
            text = planned.text.encode()
            if not layout.plan.exists() or layout.plan.read_bytes() != text:
                write_atomically(layout.plan, text)
            _tell_of_other_software(manifest, say)
            manifest.note({"samples": str(planned.plan.size)})
            try:
                yield manifest
            finally:
                layout.remove_leftovers()


def _manifest(planned: PlannedSet, layout: Layout, say: Say) -> Manifest:
    if layout.manifest.exists():
        try:
            return Manifest.open(layout.manifest)
        except DamagedManifest as error:
            aside = _set_aside(layout.manifest)
            say(f"{error}; kept as {aside.name} and rebuilt from the samples")
    return Manifest.create(
        layout.manifest,
        {
            "plan_digest": planned.digest,
            "name": planned.plan.name,
            "samples": str(planned.plan.size),
            "created": datetime.now(UTC).isoformat(timespec="seconds"),
            "software": SOFTWARE,
            "files": json.dumps(_digests(planned.files)),
        },
    )


def _set_aside(path: Path) -> Path:
    numbers = iter(range(1, 10**6))
    aside = next(
        place
        for number in numbers
        if not (place := path.with_name(f"{path.stem}.damaged-{number}{path.suffix}")).exists()
    )
    path.rename(aside)
    journal = path.with_name(f"{path.name}-journal")
    if journal.exists():
        journal.rename(aside.with_name(f"{aside.name}-journal"))
    return aside


def _check_same_fields(planned: PlannedSet, layout: Layout) -> None:
    try:
        before: Any = yaml.safe_load(layout.plan.read_text(encoding="utf-8"))
        before = {name: value for name, value in before.items() if name != "samples"}
    except (yaml.YAMLError, UnicodeDecodeError, AttributeError):
        raise InputError(f"{layout.plan}: not the plan of a data set; use another folder") from None
    if before != planned.fields or order_of(before) != order_of(planned.fields):
        raise InputError(
            f"{layout.folder} holds samples of another plan; use another folder, or this plan as "
            f"it was. What changed:\n{_difference(before, planned.fields)}"
        )


def _check_same_files(planned: PlannedSet, manifest: Manifest, layout: Layout) -> None:
    meta = manifest.meta
    if meta["plan_digest"] == planned.digest:
        return
    before, now = json.loads(meta["files"]), _digests(planned.files)
    changed = [name for name in now if before.get(name) != now[name]]
    if not changed:  # and the plan that would tell what did is lost
        raise InputError(
            f"{layout.folder} holds samples of another plan; use another folder, or the plan of "
            "these samples"
        )
    raise InputError(
        f"{layout.folder} holds samples of this plan with other files: {', '.join(changed)}; "
        "use another folder, or the files as they were"
    )


def _digests(files: Mapping[str, Any]) -> dict[str, str]:
    return {
        name: hashlib.sha256(yaml.safe_dump(fields).encode()).hexdigest()
        for name, fields in files.items()
    }


def _difference(before: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    # What stands deeper keeps its order, which may be the difference.
    old, new = (
        yaml.safe_dump(dict(sorted(fields.items())), sort_keys=False).splitlines()
        for fields in (before, now)
    )
    return "\n".join(difflib.unified_diff(old, new, "before", "now", lineterm=""))


def _check_size(indices: Iterable[int], planned: PlannedSet, layout: Layout) -> None:
    there = max(indices, default=-1) + 1
    if there > planned.plan.size:
        raise InputError(
            f"{layout.folder} holds samples up to number {there - 1}, and the plan has only "
            f"{planned.plan.size}; ask for at least {there}, or use another folder"
        )


def _tell_of_other_software(manifest: Manifest, say: Say) -> None:
    before = manifest.meta.get("software")
    if before != SOFTWARE:
        say(f"begun by {before}, and goes on with {SOFTWARE}: samples may differ between the two")


def _forget_lost(manifest: Manifest, layout: Layout, say: Say) -> None:
    lost = [
        index
        for index, files in manifest.files().items()
        if any(_size(layout.folder / name) != size for name, size in files.items())
    ]
    for index in lost:
        manifest.forget(index)
    if lost:
        say(f"{len(lost)} samples have lost a file and are made again: {_some(lost)}")


def _adopt(planned: PlannedSet, manifest: Manifest, layout: Layout, say: Say) -> None:
    """Captures without a row: of a run that was killed, or of a lost manifest."""
    known = {name for files in manifest.files().values() for name in files}
    damaged: list[Path] = []
    foreign: list[Path] = []
    found: set[int] = set()
    for path in layout.captures():
        if layout.relative(path) in known:
            continue
        try:
            told = belongs_to(read_capture(path))
        except InputError:
            ours = _is_of_a_sample(path, planned.plan.size, layout)
            (damaged if ours else foreign).append(path)
            continue
        if told is None or told[0] != planned.digest or layout.capture(told[1]) != path:
            foreign.append(path)
        else:
            found.add(told[1])
    if foreign:
        raise InputError(
            f"{_some(foreign)}: not of this data set, though in its folder; move it elsewhere"
        )
    _check_size(found, planned, layout)
    for path in damaged:
        path.unlink()
    if damaged:
        say(f"damaged captures removed, to be made again: {_some(damaged)}")
    adopted = sum(_record_found(planned, manifest, layout, index) for index in sorted(found))
    if adopted:
        say(f"{adopted} samples found that the manifest did not know")


def _is_of_a_sample(path: Path, samples: int, layout: Layout) -> bool:
    """Whether a file lies where one of so many samples has its capture."""
    with suppress(ValueError):
        index = int(path.stem)
        return 0 <= index < samples and layout.capture(index) == path
    return False


def _record_found(planned: PlannedSet, manifest: Manifest, layout: Layout, index: int) -> bool:
    path, keep = layout.capture(index), planned.plan.keep
    kept = {".exr": keep.transport, ".npz": keep.histograms}
    beside = [path.with_suffix(suffix) for suffix, wanted in kept.items() if wanted]
    if not all(each.is_file() for each in beside):
        return False  # made again, as any sample without a row
    manifest.record(done(layout, planned.sample(index), beside))
    return True


def _size(path: Path) -> int | None:
    with suppress(OSError):
        return path.stat().st_size
    return None


def _some(things: list[Any], most: int = 5) -> str:
    more = f" and {len(things) - most} more" if len(things) > most else ""
    return ", ".join(map(str, things[:most])) + more

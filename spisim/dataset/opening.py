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
from reconstruction.base.errors import InputError
from reconstruction.base.files import write_atomically
from spisim.base.config import load_yaml, read_text
from spisim.dataset.database import COMPANIONS
from spisim.dataset.folder import (
    SIDECARS,
    Layout,
    Origin,
    Sound,
    done,
    fingerprint,
    has_its_size,
    origin_of,
)
from spisim.dataset.manifest import DamagedManifest, Manifest, read_manifest
from spisim.dataset.pack import INDEX
from spisim.dataset.plan import Keep
from spisim.dataset.planned import PlannedSet, order_of
from spisim.dataset.records import Outcome
from spisim.version import __version__

Say = Callable[[str], None]

SOFTWARE = f"spisim {__version__}"


@contextmanager
def opened(
    planned: PlannedSet, folder: Path, say: Say, is_sound: Sound = has_its_size
) -> Iterator[Manifest]:
    """Manifest of a folder that fits the plan; the caller holds the folder.

    What a run needs to start again is put in order: leftovers of killed processes go, samples
    whose files are gone or not sound are to be made again, captures that the manifest does not know
    are added to it, and a manifest that is damaged or lost is rebuilt from the captures.

    Raises InputError where the folder holds links or is somebody's for other things, it holds
    samples of another plan or more of them than planned, or captures that are not of this data set.
    """
    layout = Layout(folder)
    _check_is_free(planned, layout)  # before anything is written
    with _manifest(planned, layout, say) as manifest:
        _check_same_files(planned, manifest, layout)
        layout.remove_leftovers()  # now that the folder is known to be this data set's
        _check_size(manifest.indices(), planned, layout)
        lost = _forget_lost(manifest, layout, say, is_sound)
        _adopt(planned, manifest, layout, say, lost)
        text = planned.text.encode()
        if not layout.plan.exists() or layout.plan.read_bytes() != text:
            write_atomically(layout.plan, text)
        _tell_of_other_software(manifest, say)
        manifest.note({"samples": str(planned.plan.size)})
        try:
            yield manifest
        finally:
            layout.remove_leftovers()


def _check_is_free(planned: PlannedSet, layout: Layout) -> None:
    """InputError unless a folder is new, holds nothing but what a run leaves, or is this set's."""
    layout.refuse_links()
    if (layout.folder / INDEX).exists():
        raise InputError(f"{layout.folder} is a pack, not a data set; choose another folder")
    if layout.plan.exists():
        _check_same_fields(planned, layout)
        return
    strangers = layout.strangers()
    if strangers and not _has_manifest(layout):
        raise InputError(
            f"{layout.folder} is not empty and no data set: it holds {_some(strangers)}; choose a "
            "new or empty folder"
        )


def _has_manifest(layout: Layout) -> bool:
    with suppress(InputError):
        read_manifest(layout.folder)
        return True
    return False


def _manifest(planned: PlannedSet, layout: Layout, say: Say) -> Manifest:
    if layout.own(layout.manifest).exists():
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
        position
        for number in numbers
        if not (position := path.with_name(f"{path.stem}.damaged-{number}{path.suffix}")).exists()
    )
    path.rename(aside)
    for ending in COMPANIONS:
        beside = path.with_name(path.name + ending)
        if beside.exists():
            beside.rename(aside.with_name(aside.name + ending))
    return aside


def _check_same_fields(planned: PlannedSet, layout: Layout) -> None:
    try:
        before: Any = load_yaml(read_text(layout.own(layout.plan)), layout.plan)
        before = {name: value for name, value in before.items() if name != "samples"}
        order = order_of(before)
    except (InputError, AttributeError, TypeError):
        raise InputError(f"{layout.plan}: not the plan of a data set; use another folder") from None
    if before != planned.fields or order != order_of(planned.fields):
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


def _forget_lost(manifest: Manifest, layout: Layout, say: Say, is_sound: Sound) -> list[int]:
    lost = [
        index
        for index, files in manifest.files().items()
        if not all(is_sound(layout.folder / name, reported) for name, reported in files.items())
    ]
    for index in lost:
        manifest.forget(index)
    if lost:
        say(f"{len(lost)} samples have lost or damaged files and are made again: {_some(lost)}")
    return lost


def _adopt(
    planned: PlannedSet, manifest: Manifest, layout: Layout, say: Say, lost: Iterable[int]
) -> None:
    """Captures without a row: of a run that was killed, or of a lost manifest.

    Those of samples that are `lost` are none: they are made again.
    """
    available = {name for files in manifest.files().values() for name in files}
    available |= {layout.relative(layout.capture(index)) for index in lost}
    damaged: list[Path] = []
    foreign: list[Path] = []
    result: dict[int, Origin] = {}
    for path in layout.captures():
        if layout.relative(path) in available:
            continue
        try:
            origin = origin_of(read_capture(path))
        except InputError:
            ours = _is_of_a_sample(path, planned.plan.size, layout)
            (damaged if ours else foreign).append(path)
            continue
        if origin and origin.plan == planned.digest and layout.capture(origin.index) == path:
            result[origin.index] = origin
        else:
            foreign.append(path)
    if foreign:
        raise InputError(
            f"{_some(foreign)}: not of this data set, though in its folder; move it elsewhere"
        )
    _check_size(result, planned, layout)
    for path in damaged:
        path.unlink()
    if damaged:
        say(f"damaged captures removed, to be made again: {_some(damaged)}")
    whole = [
        index for index in sorted(result) if _is_whole(planned.plan.keep, layout, result[index])
    ]
    if whole:
        manifest.record(*(_result(planned, layout, index) for index in whole))
        say(f"{len(whole)} samples found that the manifest did not know")
    if again := sorted(result.keys() - set(whole)):  # as any sample without a row
        say(f"samples without the files beside their captures, to be made again: {_some(again)}")


def _is_of_a_sample(path: Path, samples: int, layout: Layout) -> bool:
    """Whether a file lies where one of so many samples has its capture."""
    with suppress(ValueError):
        index = int(path.stem)
        return 0 <= index < samples and layout.capture(index) == path
    return False


def _retained(keep: Keep, capture: Path) -> list[Path]:
    """What a plan keeps beside a capture."""
    wanted = zip(SIDECARS, (keep.transport, keep.histograms), strict=True)
    return [capture.with_suffix(suffix) for suffix, is_retained in wanted if is_retained]


def _is_whole(keep: Keep, layout: Layout, origin: Origin) -> bool:
    """Whether what lies beside a capture, which vouches for itself, is what that tells of."""
    return all(
        path.is_file() and fingerprint(path)["sha256"] == origin.sidecars.get(path.suffix)
        for path in _retained(keep, layout.capture(origin.index))
    )


def _result(planned: PlannedSet, layout: Layout, index: int) -> Outcome:
    beside = _retained(planned.plan.keep, layout.capture(index))
    return done(layout, planned.sample(index), beside)


def _some(things: list[Any], maximum: int = 5) -> str:
    more = f" and {len(things) - maximum} more" if len(things) > maximum else ""
    return ", ".join(map(str, things[:maximum])) + more

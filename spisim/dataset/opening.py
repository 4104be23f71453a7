"""Prepare the folder of a data set for a run, whether it is new or left by an earlier run."""

import difflib
import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from itertools import count
from pathlib import Path
from typing import Any

import yaml

from reconstruction import capture_warnings, read_capture
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
from spisim.dataset.values import has_integer_bounds
from spisim.version import __version__

Say = Callable[[str], None]

SOFTWARE = f"spisim {__version__}"


@contextmanager
def opened(
    planned: PlannedSet, folder: Path, say: Say, is_sound: Sound = has_its_size
) -> Iterator[Manifest]:
    """Open the manifest of a folder that fits the plan; the caller must hold the folder's lock.

    It repairs what killed runs left behind. It removes unfinished files. It forgets samples whose
    files are missing or unsound, so that they are made again. It adds captures that the manifest
    lacks, and rebuilds a damaged or lost manifest from the captures.

    Raises InputError if the folder contains links or other files, samples of another plan, more
    samples than planned, or captures of another data set.
    """
    layout = Layout(folder)
    _check_is_free(planned, layout)  # before anything is written
    with _manifest(planned, layout, say) as manifest:
        _check_same_files(planned, manifest, layout)
        layout.remove_leftovers()  # safe, now that the folder is known to be this data set's
        _check_size(manifest.indices(), planned, layout)
        lost = _forget_lost(manifest, layout, say, is_sound)
        _adopt(planned, manifest, layout, say, lost)
        text = planned.text.encode()
        if not layout.plan.exists() or layout.plan.read_bytes() != text:
            write_atomically(layout.plan, text)
        _warn_of_other_software(manifest, say)
        manifest.note({"samples": str(planned.plan.size)})
        try:
            yield manifest
        finally:
            layout.remove_leftovers()


def _check_is_free(planned: PlannedSet, layout: Layout) -> None:
    """Raise InputError unless a folder is new, holds only a run's files, or is this data set's."""
    layout.refuse_links()
    if (layout.folder / INDEX).exists():
        raise InputError(f"{layout.folder} is a pack, not a data set; choose another folder")
    if layout.plan.exists():
        _check_same_fields(planned, layout)
        return
    strangers = layout.strangers()
    if strangers and not _has_manifest(layout):
        raise InputError(
            f"{layout.folder} is neither empty nor a data set: it holds {_some(strangers)}; use "
            "another folder"
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
            say(f"{error}; moved to {aside.name} and rebuilt from the samples")
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
    candidates = (path.with_name(f"{path.stem}.damaged-{n}{path.suffix}") for n in count(1))
    aside = next(candidate for candidate in candidates if not candidate.exists())
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
            f"{layout.folder} holds samples of another plan; use another folder, or restore the "
            f"plan. Changes:\n{_difference(before, planned.fields)}"
        )


def _check_same_files(planned: PlannedSet, manifest: Manifest, layout: Layout) -> None:
    meta = manifest.meta
    if meta["plan_digest"] == planned.digest:
        return
    before, now = json.loads(meta["files"]), _digests(planned.files)
    changed = [name for name in now if before.get(name) != now[name]]
    if not changed and has_integer_bounds(planned.fields):
        raise InputError(
            f"{layout.folder} holds samples of which {{uniform: [low, high]}} with integer bounds "
            "drew integers; it draws real numbers now, or integers with integer: true; "
            "use another folder"
        )
    if not changed:  # the plan changed, and its earlier text is lost
        raise InputError(
            f"{layout.folder} holds samples of another plan; use another folder, or restore the "
            "plan"
        )
    raise InputError(
        f"{layout.folder} holds samples of this plan with other files: {', '.join(changed)}; "
        "use another folder, or restore the files"
    )


def _digests(files: Mapping[str, Any]) -> dict[str, str]:
    return {
        name: hashlib.sha256(yaml.safe_dump(fields).encode()).hexdigest()
        for name, fields in files.items()
    }


def _difference(before: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    # Nested fields are not sorted, because their order may be the difference.
    old, new = (
        yaml.safe_dump(dict(sorted(fields.items())), sort_keys=False).splitlines()
        for fields in (before, now)
    )
    return "\n".join(difflib.unified_diff(old, new, "before", "now", lineterm=""))


def _check_size(indices: Iterable[int], planned: PlannedSet, layout: Layout) -> None:
    there = max(indices, default=-1) + 1
    if there > planned.plan.size:
        raise InputError(
            f"{layout.folder} holds samples up to number {there - 1}, but the plan has only "
            f"{planned.plan.size}; ask for at least {there}, or use another folder"
        )


def _warn_of_other_software(manifest: Manifest, say: Say) -> None:
    before = manifest.meta.get("software")
    if before != SOFTWARE:
        say(f"begun by {before}, continued by {SOFTWARE}; samples may differ between the two")


def _forget_lost(manifest: Manifest, layout: Layout, say: Say, is_sound: Sound) -> list[int]:
    lost = [
        index
        for index, files in manifest.files().items()
        if not all(is_sound(layout.folder / name, recorded) for name, recorded in files.items())
    ]
    for index in lost:
        manifest.forget(index)
    if lost:
        say(f"remaking {len(lost)} samples with missing or damaged files: {_some(lost)}")
    return lost


def _adopt(
    planned: PlannedSet, manifest: Manifest, layout: Layout, say: Say, lost: Iterable[int]
) -> None:
    """Add captures without a row, which a killed run or a lost manifest left.

    Captures of `lost` samples are ignored, because those are made again.
    """
    available = {name for files in manifest.files().values() for name in files}
    available |= {layout.relative(layout.capture(index)) for index in lost}
    damaged: list[Path] = []
    foreign: list[Path] = []
    origins: dict[int, Origin] = {}
    warnings: dict[int, list[str]] = {}
    for path in layout.captures():
        if layout.relative(path) in available:
            continue
        try:
            capture = read_capture(path)
            origin = origin_of(capture)
        except InputError:
            ours = _is_of_a_sample(path, planned.plan.size, layout)
            (damaged if ours else foreign).append(path)
            continue
        if origin and origin.plan == planned.digest and layout.capture(origin.index) == path:
            origins[origin.index] = origin
            warnings[origin.index] = [*origin.warnings, *capture_warnings(capture)]
        else:
            foreign.append(path)
    if foreign:
        raise InputError(
            f"{_some(foreign)}: in this data set's folder, but not part of it; move it elsewhere"
        )
    _check_size(origins, planned, layout)
    for path in damaged:
        path.unlink()
    if damaged:
        say(f"removed damaged captures, which are made again: {_some(damaged)}")
    keep = planned.plan.keep
    complete = [index for index in sorted(origins) if _is_complete(keep, layout, origins[index])]
    if complete:
        manifest.record(
            *(
                done(
                    layout,
                    planned.sample(index),
                    _sidecars(keep, layout.capture(index)),
                    warnings[index],
                    origins[index].traced_visibility_m,
                )
                for index in complete
            )
        )
        say(f"found {len(complete)} samples that the manifest lacked")
    if again := sorted(origins.keys() - set(complete)):  # they have no row
        say(f"remaking samples whose sidecar files are missing: {_some(again)}")


def _is_of_a_sample(path: Path, samples: int, layout: Layout) -> bool:
    """Return whether a path is that of the capture of one of so many samples."""
    with suppress(ValueError):
        index = int(path.stem)
        return 0 <= index < samples and layout.capture(index) == path
    return False


def _sidecars(keep: Keep, capture: Path) -> list[Path]:
    """Return the files that a plan keeps beside a capture."""
    wanted = zip(SIDECARS, (keep.transport, keep.histograms), strict=True)
    return [capture.with_suffix(suffix) for suffix, is_kept in wanted if is_kept]


def _is_complete(keep: Keep, layout: Layout, origin: Origin) -> bool:
    """Return whether the sidecars of a capture are those that it lists."""
    return all(
        path.is_file() and fingerprint(path)["sha256"] == origin.sidecars.get(path.suffix)
        for path in _sidecars(keep, layout.capture(origin.index))
    )


def _some(things: list[Any], maximum: int = 5) -> str:
    more = f" and {len(things) - maximum} more" if len(things) > maximum else ""
    return ", ".join(map(str, things[:maximum])) + more

"""Samples as shots for programs of others: images as they were measured, depth as it is."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from reconstruction import Capture, Reconstructor
from reconstruction.base.errors import InputError, naming
from reconstruction.capture import CaptureFile
from reconstruction.exports import Shot, TimestampedPose
from reconstruction.exports.export import check_folder, with_stage
from spisim.scene import Drone
from spisim.scene.cache import SceneCache

if TYPE_CHECKING:
    from spisim.dataset.reader import DataSet, StoredSample

#: Of the names of folders.
LONGEST = 100
SECOND_NS = 10**9

_cache = SceneCache()  # of this process


def placed(capture: Capture | CaptureFile | None, frame: int) -> TimestampedPose | None:
    """When, in a flight, and where a simulated frame was taken: the middle of it.

    None for a recording of a real rig, and a result. Raises InputError for a capture whose scene is
    none.
    """
    if capture is None or not capture.provenance.scene:
        return None
    drone = Drone.of(capture.provenance.scene, "its scene", _cache)
    buckets = capture.setup.buckets
    middle_s = (frame + 0.5) * buckets.pattern_period_s * capture.setup.plan.exposures
    time_s = None if drone.time_s is None else drone.time_s + middle_s
    return TimestampedPose(time_s, drone.after(middle_s))


def true_shots(sample: StoredSample) -> Iterator[Shot]:
    """Frames of a sample with the image that is made of it, ranges measured, and the true depth.

    Raises InputError for one that cannot be read or reconstructed, or knows no truth.
    """
    capture = sample.capture
    with naming(sample.path):
        if capture.truth is None:
            raise InputError("holds no truth; a plan that says `keep: {truth: true}` keeps it")
        reconstruct = Reconstructor(capture.setup, image="edge-preserving", depth=())
        for number in range(capture.frames):
            position = placed(capture, number)
            result = reconstruct(capture.frame(number))
            yield Shot(
                0 if position is None or position.time_s is None else round(1e9 * position.time_s),
                result.image,
                capture.truth.at(number).depth_m,
                capture.optics,
                None if position is None else position.pose,
                result.ranges,
                capture.spots,
            )


def write_by_scene(
    samples: DataSet, folder: Path, write: Callable[[Iterable[Shot], Path], None]
) -> list[Path]:
    """Let ``write`` fill a folder for each scene with the frames of its samples, in order.

    Raises InputError as `write_whole`, for samples without truth, and as ``write`` does.
    """

    def fill(stage: Path) -> None:
        for name, positions in _by_scene(samples).items():
            inside = stage / name
            inside.mkdir()
            write(_in_time(samples[position] for position in positions), inside)

    return write_whole(samples, folder, fill)


def write_whole(samples: DataSet, folder: Path, fill: Callable[[Path], None]) -> list[Path]:
    """Let ``fill`` fill a folder that takes its name when it is whole; the files in it.

    Raises InputError for a set without samples, and a folder that holds other things than an
    earlier export, or samples, or cannot be written into.
    """
    folder = Path(folder)
    if not samples:
        raise InputError(f"{samples.folder}: there is no finished sample to export")
    check_folder(folder, [samples.folder])
    with_stage(folder, fill, folder=True)
    return sorted(path for path in folder.rglob("*") if path.is_file())


def _by_scene(samples: DataSet) -> dict[str, list[int]]:
    """Places of the samples by names of folders, one for each scene."""
    names: dict[str, str] = {}
    result: dict[str, list[int]] = {}
    for position, record in enumerate(samples.records):
        scene = str(record.scene)
        if scene not in names:
            plain = re.sub(r"[^A-Za-z0-9_-]+", "-", scene).strip("-")[:LONGEST] or "scene"
            taken = plain in result
            names[scene] = f"{plain}-{len(names)}" if taken else plain
        result.setdefault(names[scene], []).append(position)
    return result


def _in_time(samples: Iterable[StoredSample]) -> Iterator[Shot]:
    """Their frames, those that know no later time a second after the one before."""
    last_ns = -SECOND_NS
    for sample in samples:
        for shot in true_shots(sample):
            following = shot.stamp_ns > last_ns
            last_ns = shot.stamp_ns if following else last_ns + SECOND_NS
            yield replace(shot, stamp_ns=last_ns)

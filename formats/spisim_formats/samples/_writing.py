"""Samples as shots for export: the reconstructed image and the true depth."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from reconstruction import Reconstructor
from reconstruction.base.errors import InputError, naming
from reconstruction.exports import Shot
from reconstruction.exports.export import check_folder, with_stage
from spisim.dataset import DataSet
from spisim.dataset.exports import Writer
from spisim.dataset.poses import placed
from spisim.dataset.stored_sample import StoredSample

MAX_NAME_LENGTH = 100
SECOND_NS = 10**9


def true_shots(sample: StoredSample) -> Iterator[Shot]:
    """Yield each frame of a sample with its reconstructed image, measured ranges and true depth.

    Raises InputError if the sample cannot be read or reconstructed, or holds no truth.
    """
    capture = sample.capture
    with naming(sample.path):
        if capture.truth is None:
            raise InputError("holds no truth; set `keep: {truth: true}` in the plan")
        reconstruct = Reconstructor(capture.setup, image="edge-preserving", depth=())
        for number in range(capture.frames):
            placement = placed(capture, number)
            result = reconstruct(capture.frame(number))
            yield Shot(
                0
                if placement is None or placement.time_s is None
                else round(1e9 * placement.time_s),
                result.image,
                capture.truth.at(number).depth_m,
                capture.optics,
                None if placement is None else placement.pose,
                result.ranges,
                capture.spots,
            )


def write_by_scene(write: Callable[[Iterable[Shot], Path], None]) -> Writer:
    """Return a writer that lets ``write`` fill one folder per scene with its frames in order.

    The writer raises InputError as `write_whole`, for samples without truth, and as ``write`` does.
    It ignores the shard size.
    """

    def write_all(samples: DataSet, folder: Path, shard_size: int = 0) -> list[Path]:
        def fill(stage: Path) -> None:
            for name, positions in _by_scene(samples).items():
                (stage / name).mkdir()
                write(_in_time(samples[position] for position in positions), stage / name)

        return write_whole(samples, folder, fill)

    return write_all


def write_whole(samples: DataSet, folder: Path, fill: Callable[[Path], None]) -> list[Path]:
    """Let ``fill`` write a folder that appears only when it is complete; return its files.

    Raises InputError if there are no samples, if the folder holds anything but an earlier export,
    or if it cannot be written.
    """
    folder = Path(folder)
    if not samples:
        raise InputError(f"{samples.folder}: no finished samples to export")
    check_folder(folder, [samples.folder])
    with_stage(folder, fill, folder=True)
    return sorted(path for path in folder.rglob("*") if path.is_file())


def _by_scene(samples: DataSet) -> dict[str, list[int]]:
    """Return positions of the samples by folder name, one folder per scene."""
    names: dict[str, str] = {}
    result: dict[str, list[int]] = {}
    for position, record in enumerate(samples.records):
        scene = str(record.scene)
        if scene not in names:
            plain = re.sub(r"[^A-Za-z0-9_-]+", "-", scene).strip("-")[:MAX_NAME_LENGTH] or "scene"
            taken = plain in result
            names[scene] = f"{plain}-{len(names)}" if taken else plain
        result.setdefault(names[scene], []).append(position)
    return result


def _in_time(samples: Iterable[StoredSample]) -> Iterator[Shot]:
    """Yield frames with increasing time stamps, one second apart where a later time is missing."""
    last_ns = -SECOND_NS
    for sample in samples:
        for shot in true_shots(sample):
            following = shot.stamp_ns > last_ns
            last_ns = shot.stamp_ns if following else last_ns + SECOND_NS
            yield replace(shot, stamp_ns=last_ns)

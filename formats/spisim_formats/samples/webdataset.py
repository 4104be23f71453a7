"""TAR shards of a data set, which WebDataset and similar loaders stream."""

from __future__ import annotations

import io
import itertools
import json
import tarfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from reconstruction.base.errors import InputError
from reconstruction.base.files import is_marked, mark, remove_unfinished, write_atomically
from reconstruction.base.folders import locked_folder

if TYPE_CHECKING:
    from spisim.dataset.reader import DataSet
    from spisim.dataset.stored_sample import StoredSample

#: The kind of file in the shards' marks.
KIND = "export"


def write_shards(samples: DataSet, folder: str | Path, shard_size: int = 1000) -> list[Path]:
    """Write a data set as TAR shards `shard-000000.tar`, ….

    A sample is its capture `000123.h5`, its index, scene and parameters `000123.json`, and its
    sidecars. Equal samples give byte-equal shards. Each shard appears whole or not at all.

    Parameters
    ----------
    samples
        The finished samples of a data set, or some of them.
    folder
        An empty folder or one with earlier shards, outside the data set.
    shard_size
        Samples per shard.

    Returns
    -------
    list of Path
        The shards.

    Raises
    ------
    InputError
        If there are no samples, `shard_size` is below 1, the folder lies in the data set, holds
        other shards, cannot be written or is in use, or captures are missing.
    """
    folder = Path(folder)
    if not samples:
        raise InputError(f"{samples.folder}: no finished samples to export")
    if shard_size < 1:
        raise InputError(f"shard_size should be at least 1; found {shard_size}")
    if folder.resolve().is_relative_to(samples.folder.resolve()):
        raise InputError(f"{folder} lies in the data set {samples.folder}; choose another folder")
    batches = [
        list(range(start, min(start + shard_size, len(samples))))
        for start in range(0, len(samples), shard_size)
    ]
    paths = [folder / f"shard-{number:06d}.tar" for number in range(len(batches))]
    with locked_folder(folder):
        there = sorted(folder.glob("shard-*.tar"))
        others = [path for path in there if path not in paths or not is_marked(path, KIND)]
        if others:
            raise InputError(f"{others[0]} belongs to another export; choose an empty folder")
        remove_unfinished(paths)
        for path, positions in zip(paths, batches, strict=True):
            members = itertools.chain.from_iterable(
                _members(samples[position]) for position in positions
            )
            write_atomically(path, _tar(members))
    return paths


def _members(sample: StoredSample) -> Iterator[tuple[str, bytes]]:
    key = f"{sample.index:06d}"
    metadata = {
        "index": sample.index,
        "scene_name": sample.scene_name,
        "parameters": dict(sample.parameters),
    }
    yield f"{key}.h5", _content(sample.path)
    yield f"{key}.json", json.dumps(metadata, ensure_ascii=False).encode()
    for path in sample.sidecars:
        yield f"{key}{path.suffix}", _content(path)


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise InputError(
            f"{path}: missing; `spisim dataset verify` lists all missing files"
        ) from None


def _tar(members: Iterator[tuple[str, bytes]]) -> bytes:
    buffer = io.BytesIO()
    comment = {"comment": mark(KIND)}
    with tarfile.open(
        fileobj=buffer, mode="w", format=tarfile.PAX_FORMAT, pax_headers=comment
    ) as tar:
        for name, content in members:
            header = tarfile.TarInfo(name)  # default time and owner, for equal bytes
            header.size = len(content)
            header.mode = 0o644
            tar.addfile(header, io.BytesIO(content))
    return buffer.getvalue()


EXPORT = write_shards

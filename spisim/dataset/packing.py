"""A data set becomes a pack: every capture is verified and read once."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
from numpy.lib.format import open_memmap

from reconstruction.base.errors import InputError
from reconstruction.base.files import is_marked, mark, require_folder
from reconstruction.exports.export import with_stage
from spisim.dataset.fields import FIELDS, find_field
from spisim.dataset.folder import Layout, fingerprint, has_its_content
from spisim.dataset.manifest import Manifest, read_manifest
from spisim.dataset.pack import FORMAT, INDEX, Index, PackedArray
from spisim.dataset.reader import DataSet, StoredSample, open_dataset

#: Of the index, as its mark tells it.
KIND = "pack"


def pack_dataset(
    samples: DataSet,
    folder: str | Path,
    names: Iterable[str] = (),
    progress: Callable[[float], None] = lambda fraction: None,
) -> DataSet:
    """Write arrays of samples as files that are mapped into memory, with manifest and plan.

    Parameters
    ----------
    samples: of a data set; all or some.
    folder: a new one, an empty one, or that of an earlier pack, whose place the new one takes.
    names: of arrays; by default all that the first capture holds. Numbers among the parameters
        stand in the manifest.
    progress: called with the fraction that is done, from 0 to 1.

    Returns
    -------
    The pack, opened: a data set that reads these arrays, and no captures.

    Raises
    ------
    InputError
        For a folder that cannot be used, a set without samples or that is a pack, names that
        there are not, captures that are not as they were written, and shapes that differ.
    """
    folder = Path(folder).absolute()
    check_packable(samples, folder)
    first = samples[0]
    chosen = list(dict.fromkeys(names)) or [
        name
        for name, field in FIELDS.items()
        if field.recorded and field.read(first.capture) is not None
    ]
    for name in chosen:
        if find_field(name) is None:
            samples.check_names([name])
            raise InputError(f"{name} is a parameter, which a pack has anyway; name arrays")
    with_stage(folder, lambda stage: _fill(stage, folder, samples, chosen, progress), folder=True)
    return open_dataset(folder)


def check_packable(samples: DataSet, folder: Path) -> None:
    """InputError unless there are captures to pack, and a folder can be written."""
    if not samples:
        raise InputError(f"{samples.folder}: there is no finished sample to pack")
    if samples.pack is not None:
        raise InputError(
            f"{samples.folder} is a pack itself; pack the data set that it was made of"
        )
    ours, theirs = folder.resolve(), samples.folder.resolve()
    if ours.is_relative_to(theirs) or theirs.is_relative_to(ours):
        raise InputError(f"{folder} overlaps the data set {samples.folder}; choose another folder")
    require_folder(folder)
    earlier = (folder / INDEX).is_file() and is_marked(folder / INDEX, KIND)
    if folder.is_symlink() or (folder.exists() and any(folder.iterdir()) and not earlier):
        raise InputError(f"{folder} holds other things than a pack; choose an empty folder")


def _fill(
    stage: Path,
    folder: Path,
    samples: DataSet,
    names: list[str],
    progress: Callable[[float], None],
) -> None:
    files = {name: stage / f"{number:03d}.npy" for number, name in enumerate(names)}
    columns: dict[str, np.memmap] = {}
    for row, (record, sample) in enumerate(zip(samples.records, samples, strict=True)):
        if not has_its_content(sample.path, vars(record)):
            raise InputError(f"{sample.path}: not as it was written; `spisim dataset verify` tells")
        for name, path in files.items():
            values = sample.array(name)
            if row == 0:
                shape = (len(samples), *values.shape)
                columns[name] = open_memmap(path, "w+", values.dtype, shape)
            _check_shape(sample, name, values.shape, columns[name].shape[1:])
            columns[name][row] = values
        progress((row + 1) / len(samples))
    for column in columns.values():
        column.flush()
    reported = {name: _reported(name, path) for name, path in files.items()}
    meta, everything = read_manifest(samples.folder)
    index = Index(
        made=mark(KIND),
        format=FORMAT,
        source=os.path.relpath(samples.folder.resolve(), folder.resolve()),
        source_samples=sum(record.done for record in everything),
        arrays=reported,
    )
    with Manifest.create(stage / Layout(stage).manifest.name, meta) as manifest:
        manifest.keep(*samples.records)
    if Layout(samples.folder).plan.is_file():
        shutil.copyfile(Layout(samples.folder).plan, Layout(stage).plan)
    (stage / INDEX).write_text(index.model_dump_json(indent=1), encoding="utf-8")


def _check_shape(
    sample: StoredSample, name: str, shape: tuple[int, ...], first: tuple[int, ...]
) -> None:
    if shape != first:
        raise InputError(
            f"{sample.path}: {name} has shape {shape}, that of the first sample {first}; select "
            "samples of equal shape"
        )


def _reported(name: str, path: Path) -> PackedArray:
    field = find_field(name)
    assert field is not None  # names have been checked
    return PackedArray(
        file=path.name,
        **fingerprint(path),
        dims=list(field.dims),
        units=field.units,
        meaning=field.meaning,
    )

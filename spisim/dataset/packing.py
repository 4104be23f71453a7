"""Write a data set as a pack, verifying and reading every capture once."""

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
from spisim.dataset.reader import DataSet, open_dataset
from spisim.dataset.stored_sample import StoredSample

#: The kind of file in the index's mark.
KIND = "pack"


def pack_dataset(
    samples: DataSet,
    folder: str | Path,
    names: Iterable[str] = (),
    progress: Callable[[float], None] = lambda fraction: None,
) -> DataSet:
    """Write arrays of samples as memory-mapped files, with manifest and plan.

    Parameters
    ----------
    samples
        A data set, or some of its samples.
    folder
        A new or empty folder, or that of an earlier pack, which is replaced.
    names
        Arrays to pack; by default all that the first capture holds. Numeric parameters are in
        the manifest anyway.
    progress
        Called with the completed fraction, from 0 to 1.

    Returns
    -------
    DataSet
        The opened pack: a data set with these arrays and without captures.

    Raises
    ------
    InputError
        If the folder cannot be used, there are no samples, they are a pack themselves, a name is
        unknown, captures have changed since they were written, or shapes differ.
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
            raise InputError(f"{name} is a parameter, which every pack includes; name arrays only")
    with_stage(folder, lambda stage: _fill(stage, folder, samples, chosen, progress), folder=True)
    return open_dataset(folder)


def check_packable(samples: DataSet, folder: Path) -> None:
    """Raise InputError unless there are captures to pack and the folder can be written."""
    if not samples:
        raise InputError(f"{samples.folder}: no finished samples to pack")
    if samples.pack is not None:
        raise InputError(f"{samples.folder} is itself a pack; pack the data set it was made from")
    ours, theirs = folder.resolve(), samples.folder.resolve()
    if ours.is_relative_to(theirs) or theirs.is_relative_to(ours):
        raise InputError(f"{folder} overlaps the data set {samples.folder}; choose another folder")
    require_folder(folder)
    earlier = (folder / INDEX).is_file() and is_marked(folder / INDEX, KIND)
    if folder.is_symlink() or (folder.exists() and any(folder.iterdir()) and not earlier):
        raise InputError(f"{folder} is neither empty nor a pack; choose an empty folder")


def _fill(
    stage: Path, folder: Path, samples: DataSet, names: list[str], progress: Callable[[float], None]
) -> None:
    files = {name: stage / f"{number:03d}.npy" for number, name in enumerate(names)}
    columns: dict[str, np.memmap] = {}
    for row, (record, sample) in enumerate(zip(samples.records, samples, strict=True)):
        if not has_its_content(sample.path, vars(record)):
            raise InputError(
                f"{sample.path}: changed since it was written; run `spisim dataset verify`"
            )
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
    meta, everything = read_manifest(samples.folder)
    index = Index(
        made=mark(KIND),
        format=FORMAT,
        source=os.path.relpath(samples.folder.resolve(), folder.resolve()),
        source_samples=sum(record.done for record in everything),
        arrays={name: _entry(name, path) for name, path in files.items()},
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
            f"{sample.path}: {name} has shape {shape}, but {first} in the first sample; select "
            "samples of equal shape"
        )


def _entry(name: str, path: Path) -> PackedArray:
    field = find_field(name)
    assert field is not None  # names are checked before
    return PackedArray(
        file=path.name,
        **fingerprint(path),
        dims=list(field.dims),
        units=field.units,
        meaning=field.meaning,
    )

"""Joining of recordings that follow one another into one file."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import h5py

from reconstruction.capture import (
    PARTS,
    Capture,
    Provenance,
    Setup,
    datasets,
    hdf5,
    read_capture,
)
from reconstruction.capture.file import KINDS, write_datasets
from reconstruction.capture.schema import FRAMES, TRUTHS, present_fields


def join_captures(
    parts: Sequence[str | Path], path: str | Path, setup: Setup, provenance: Provenance
) -> None:
    """Write recordings of successive frames as one, with two of them in memory at a time.

    Equal recordings give equal bytes.

    Parameters
    ----------
    parts : sequence of paths
        Capture files with equal datasets, in the order of their frames, each with truth or each
        without. The first begins with frame 0.
    path : path
        Capture file to write, not atomically.
    setup : Setup
        Of all frames.
    provenance : Provenance
        Of the whole.

    Raises
    ------
    InputError
        As `read_capture`.
    OSError
        If the file cannot be written.
    """
    first = read_capture(parts[0])

    def captures() -> Iterator[Capture]:
        yield first
        yield from map(read_capture, parts[1:])

    rows = {FRAMES: 0, TRUTHS: 0}
    for capture in captures():
        rows[FRAMES] += capture.frames
        rows[TRUTHS] += 0 if capture.truth is None else len(capture.truth.frame)

    def create(file: h5py.File, name: str, value: Any, units: str) -> None:
        if name in axes:
            shape = (rows[axes[name]], *value.shape[1:])
            hdf5.create(file, name, shape, value.dtype, units)
        else:
            hdf5.put(file, name, value, units)

    axes = {
        f"{group}/{name}": str(stored.axes[0])
        for group in PARTS
        if (part := getattr(first, group)) is not None
        for name, stored in present_fields(part)
        if stored.by_frame
    }

    def write(file: h5py.File) -> None:
        write_datasets(file, setup.plans, first, provenance, create)
        begun = {FRAMES: 0, TRUTHS: 0}
        for capture in captures():
            added = {}
            for name, value, _ in datasets(setup.plans, capture):
                if name in axes:
                    axis = axes[name]
                    at = begun[axis]
                    shifted = value + begun[FRAMES] if name == "truth/frame" else value
                    file[name][at : at + len(value)] = shifted
                    added[axis] = at + len(value)
            begun |= added

    hdf5.write_in_place(Path(path), write, KINDS[provenance.source])

"""Grids and pictures of all around of Mitsuba scenes, as far as 1550 nm asks: their red."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim_formats.library.content import scaling, translation
from spisim_formats.library.files import read_bytes
from spisim_formats.library.lattice import MAX_CELLS, Lattice
from spisim_formats.library.surround import read_linear_red, surround
from spisim_formats.mitsuba.elements import Node

#: The file that a node names.
Find: TypeAlias = Callable[[Node], Path]

#: Rows of a picture of all around for one of the file's, and pixels up to which.
FINER, FINE_PIXELS = 16, 2**22


def is_grid(value: object) -> bool:
    """Whether a property of a medium is a grid of numbers."""
    return isinstance(value, Node) and value.type == "gridvolume"


def read_lattice(node: Node, find: Find) -> Lattice:
    """A `gridvolume` in the scene's unit; InputError for a file that is missing or damaged."""
    values, low, high = _read_volume(find(node))
    to_world = node.value("to_world", np.eye(4))
    if node.value("use_grid_bbox", False):
        to_world = to_world @ translation(low) @ scaling(high - low)
    return Lattice(values, to_world)


def _read_volume(path: Path) -> tuple[NDArray[np.float32], Floats, Floats]:
    """First channel (nz, ny, nx) of a file of Mitsuba's, and two corners of a box."""
    data = read_bytes(path)
    if data[:3] != b"VOL" or len(data) < 48 or data[3] != 3:
        raise InputError(f"{path.name}: is no grid of Mitsuba's format 3")
    kind, nx, ny, nz, channels = struct.unpack_from("<5i", data, 4)
    corners = np.frombuffer(data, "<f4", 6, 24).astype(float)
    if kind != 1:
        raise InputError(f"{path.name}: numbers of kind {kind} are not read, only float32")
    if min(nx, ny, nz, channels) < 1 or nx * ny * nz > MAX_CELLS:
        raise InputError(f"{path.name}: {nx} × {ny} × {nz} cells; at most {MAX_CELLS:,} are read")
    count = nx * ny * nz * channels
    if len(data) < 48 + 4 * count:
        raise InputError(f"{path.name}: is cut off: {len(data)} of {48 + 4 * count} bytes")
    values = np.frombuffer(data, "<f4", count, 48).reshape(nz, ny, nx, channels)[..., 0]
    if not (np.isfinite(values).all() and values.min() >= 0):
        raise InputError(f"{path.name}: should hold values from 0 on")
    return values, corners[:3], corners[3:]


def read_surround(node: Node, find: Find) -> tuple[NDArray[np.float32], Floats]:
    """Linear red (h, w) of an `envmap` as a lamp of a scene file has it, and its axes (3, 3).

    Mitsuba's first and last rows are the poles, here rows are bands: finer ones, which follow the
    straight lines from row to row but for 1/16 of a row about each. InputError for what cannot be
    read.
    """
    red = read_linear_red(find(node))
    rows = len(red)
    count = max(1, min(FINER, FINE_PIXELS // red.size)) * rows
    position = (np.arange(count) + 0.5) / count * (rows - 1)
    low = np.minimum(position.astype(int), rows - 2)
    fraction = (position - low).astype(np.float32)[:, None]
    bands = (1 - fraction) * red[low] + fraction * red[low + 1]
    return surround(bands, node.value("to_world", np.eye(4)), node.what)

"""Capture files (docs/reference/capture-format.md): written whole, read whole or frame by frame."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import MISSING, fields, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import h5py
import numpy as np

from ..base.arrays import Floats
from ..base.errors import InputError
from ..base.files import write_atomically
from ..operators import BASES, PatternPlan
from . import hdf5
from .buckets import Buckets
from .charge import PatternTaps
from .model import (
    PARTS,
    READING_PARTS,
    SOURCES,
    Capture,
    Frames,
    Optics,
    Provenance,
    Setup,
    Truth,
    axis_sizes,
    check_frames,
    check_part,
    check_parts,
)
from .poses import Poses
from .readings import READINGS
from .schema import Stored, check_shape, present_fields, stored_fields
from .spots import Spots

FORMAT = hdf5.Format(
    name="spisim-capture",
    kind="capture",
    oldest=(2, 0),
    version=(4, 1),
    remedy="record, simulate or import it again",
)
KINDS = {"simulation": "simulated capture", "hardware": "hardware capture"}
"""Kind in a file's mark, by the source of the capture."""
MAX_PLANS = 4096
"""Maximum number of frames until patterns repeat."""
TEXTS = ("instrument", "scene", "settings")

Part = TypeVar("Part")


def write_capture(capture: Capture, path: str | Path) -> None:
    """Write a capture to HDF5, whole or not at all; equal captures give equal bytes.

    Raises OSError if the file cannot be written.
    """
    kind = KINDS[capture.provenance.source]
    plans, provenance = capture.setup.plans, capture.provenance
    write = partial(write_datasets, plans=plans, parts=capture, provenance=provenance)
    write_atomically(path, hdf5.content(write, kind))


def read_capture(path: str | Path) -> Capture:
    """Read a capture into memory.

    Raises InputError, which names the file, if it is missing, damaged, not a capture, of another
    format version, links to other files or takes too much memory, or if a dataset is missing, has
    another shape or unit, or an impossible value (docs/reference/capture-format.md).
    """
    with open_capture(path) as file:
        return file.capture(0, file.frames)


@contextmanager
def open_capture(path: str | Path) -> Iterator["CaptureFile"]:
    """Open a capture file to read its frames on demand; raises InputError as `read_capture`."""
    if Path(path).is_dir():
        raise InputError(f"{path} is a folder; the name of a capture file is needed")
    if not Path(path).exists():
        raise InputError(f"{path}: no such capture file")
    if not Path(path).is_file():
        raise InputError(f"{path} is not a regular file; the name of a capture file is needed")
    with hdf5.opened(path, FORMAT) as file:
        yield CaptureFile(file)


class CaptureFile:
    """An open capture file.

    ``setup``, ``frames`` and ``provenance`` are those of a `Capture`. Readings and truth are read
    and checked on demand; all methods raise InputError as `read_capture` does.
    """

    def __init__(self, file: hdf5.Contents) -> None:
        self._file = file
        self.provenance = _read_provenance(file)
        self.setup = read_setup(file)
        self.frames = file.shape("buckets/counts", "count")[0]
        if self.frames < 1:
            raise InputError("buckets/counts holds no frame")
        self._by_frame = {
            group: {
                name: (stored, file.dataset(f"{group}/{name}", stored.units))
                for name, stored in present_fields(part)
                if stored.by_frame
            }
            for group in READING_PARTS
            if (part := getattr(self.setup, group)) is not None
        }

    def frame(self, frame: int = 0) -> Frames:
        """Read one frame; raises InputError if it does not exist."""
        return self.batch(frame, frame + 1)

    def batch(self, start: int, stop: int) -> Frames:
        """Read frames ``start`` to ``stop``, exclusive; raises InputError if they do not exist."""
        check_frames(start, stop, self.frames)
        readings = self._readings(start, stop)
        check_parts(readings)
        return readings

    def capture(self, start: int, stop: int) -> Capture:
        """Read frames ``start`` to ``stop``, exclusive, as a capture with their truth only."""
        readings = self.batch(start, stop)
        plan, *following_plans = (
            self.setup.plan_of(frame)
            for frame in range(start, min(start + len(self.setup.plans), stop))
        )
        return Capture(
            plan=plan,
            following_plans=tuple(following_plans),
            optics=self.setup.optics,
            buckets=readings.buckets,
            spots=readings.spots,
            pattern_taps=readings.pattern_taps,
            poses=readings.poses,
            provenance=self.provenance,
            truth=self._truth(start, stop),
        )

    def _truth(self, start: int, stop: int) -> Truth | None:
        """Truth of frames, numbered from ``start``."""
        file, still = self._file, self.frames == 1
        if "truth" not in file:
            return None
        if file.version < (3, 0):
            truth = _truth_of_the_first_frame(file, still=still)
            return truth if still or start == 0 else None
        frame = file.numbers("truth/frame").ravel()
        still = bool(file.number("truth/still"))
        frames = np.flatnonzero(still | (frame >= start) & (frame < stop))
        if not frames.size:
            return None
        sizes = axis_sizes(self.setup.plan)
        _check_shapes(file, "truth", Truth, sizes)
        truth = _read(file, "truth", Truth, slice(frames[0], frames[-1] + 1))
        check_part("truth", truth, axis_sizes(self.setup.plan))
        return truth if still else replace(truth, frame=truth.frame - start)

    def _readings(self, start: int, stop: int) -> Frames:
        setup = self.setup

        def read(group: str, part: Part) -> Part:
            values = {
                name: stored.converted(f"{group}/{name}", dataset.read(slice(start, stop)))
                for name, (stored, dataset) in self._by_frame.get(group, {}).items()
            }
            return replace(part, **values) if values else part  # type: ignore[type-var]

        parts = [(group, getattr(setup, group)) for group in READING_PARTS]
        return Frames(start, **{group: part and read(group, part) for group, part in parts})


def read_setup(file: hdf5.Tables) -> Setup:
    """Read what the frames of a recording share, which may have no frames yet.

    Raises InputError as `read_capture`.
    """
    plan, *following_plans = _read_plans(file)
    sizes = axis_sizes(plan)
    kinds: dict[str, type | None] = {
        "buckets": Buckets,
        "spots": _spots_class(file),
        "pattern_taps": PatternTaps if "pattern_taps" in file else None,
        "poses": Poses if "poses" in file else None,
        "optics": Optics if "optics" in file else None,
    }
    for group, part in kinds.items():
        if part is not None:
            _check_shapes(file, group, part, sizes)
    parts: dict[str, Any] = {
        group: None if part is None else _read(file, group, part, slice(0, 0))
        for group, part in kinds.items()
    }
    setup = Setup(plan=plan, following_plans=tuple(following_plans), **parts)
    check_parts(setup)
    return setup


def write_datasets(
    file: h5py.File,
    plans: Sequence[PatternPlan],
    parts: Capture,
    provenance: Provenance,
    put: Callable[[h5py.File, str, Any, str], object] = hdf5.put,
) -> None:
    """Fill a file with ``put``, which gets name, value and unit of each dataset of the parts."""
    hdf5.put_format(file, FORMAT)
    for name in ("source", "software", "created"):
        hdf5.put_attribute(file, name, getattr(provenance, name))
    for name, value, units in datasets(plans, parts):
        put(file, name, value, units)
    for name in TEXTS:
        hdf5.put(file, f"provenance/{name}", getattr(provenance, name), "1")
    if provenance.seed is not None:
        hdf5.put(file, "provenance/seed", np.int64(provenance.seed), "1")


def datasets(
    plans: Sequence[PatternPlan], parts: Capture | Setup
) -> Iterator[tuple[str, Any, str]]:
    """Yield name, value and unit of each dataset of a capture file, given its successive plans."""
    yield from _datasets_of_plans(plans)
    for group in PARTS:
        part = getattr(parts, group, None)
        if part is not None:
            for name, stored in present_fields(part):
                value = stored.converted(f"{group}/{name}", np.asarray(getattr(part, name)))
                on_disk = value.astype(np.uint8) if value.dtype.kind == "b" else value
                yield f"{group}/{name}", on_disk, stored.units
    if parts.spots is not None:
        yield "spots/method", parts.spots.method, "1"


def _datasets_of_plans(plans: Sequence[PatternPlan]) -> Iterator[tuple[str, Any, str]]:
    first = plans[0]
    yield "patterns/shape", np.array(first.shape, np.int32), "1"
    for name in ("index", "polarity"):
        by_frame = np.stack([getattr(plan, name) for plan in plans])
        yield f"patterns/{name}", by_frame if len(plans) > 1 else by_frame[0], "1"
    for name in ("basis", "order"):
        yield f"patterns/{name}", getattr(first, name), "1"
    for name in first.patterns.arrays:
        yield f"patterns/{name}", getattr(first.patterns, name), "1"
    if first.throughput is not None:
        yield "patterns/throughput", first.throughput, "1"


def _read_plans(file: hdf5.Tables) -> list[PatternPlan]:
    """Plans of successive frames: one for all frames, or one per row of indices."""
    basis = BASES[file.text("patterns/basis")]
    shape = file.numbers("patterns/shape")
    if shape.shape != (2,) or not (np.isfinite(shape) & (shape == np.floor(shape))).all():
        raise InputError(f"patterns/shape is {shape.tolist()}, expected 2 integers")
    height, width = (int(side) for side in shape)
    arrays = {name: file.get(f"patterns/{name}", "1") for name in basis.arrays}
    patterns, order = basis.restored((height, width), arrays), file.text("patterns/order")
    index, polarity = (file.numbers(f"patterns/{name}") for name in ("index", "polarity"))
    throughput = _read_throughput(file)
    if index.ndim != 2:
        return [PatternPlan((height, width), index, polarity, order, patterns, throughput)]
    if polarity.shape != index.shape:
        raise InputError(
            f"patterns/polarity has shape {polarity.shape}, expected {index.shape} as of "
            "patterns/index"
        )
    if not 1 <= len(index) <= MAX_PLANS:
        raise InputError(f"patterns/index has {len(index)} rows; 1..{MAX_PLANS} are allowed")
    return [
        PatternPlan((height, width), *each, order, patterns, throughput)
        for each in zip(index, polarity, strict=True)
    ]


def _read_throughput(file: hdf5.Tables) -> Floats | None:
    """Factor of each row of the basis, which files since version 4.1 may state."""
    if "patterns/throughput" not in file:
        return None
    return np.asarray(file.get("patterns/throughput", "1"))


def _read_provenance(file: hdf5.Contents) -> Provenance:
    source = file.attribute("source")
    if source not in SOURCES:
        raise InputError(f"source is {source!r}; allowed: {', '.join(SOURCES)}")
    seeded = "provenance/seed" in file
    return Provenance(
        source=source,  # type: ignore[arg-type]
        software=file.attribute("software"),
        created=file.attribute("created"),
        seed=file.integer("provenance/seed") if seeded else None,
        **{name: file.text(f"provenance/{name}") for name in TEXTS},
    )


def _spots_class(file: hdf5.Tables) -> type[Spots] | None:
    if "spots" not in file:
        return None
    try:
        return READINGS[file.text("spots/method")]
    except InputError as error:
        raise InputError(f"spots/method: {error}") from error


def _check_shapes(file: hdf5.Tables, group: str, part: type, sizes: dict[str, int]) -> None:
    for name, stored in _recorded_fields(file, group, part):
        shape = file.shape(f"{group}/{name}", stored.units)
        if (stored.one_for_all or not stored.axes) and set(shape) == {1}:
            shape = ()  # a scalar may be an array of one element
        check_shape(f"{group}/{name}", shape, stored, sizes)


def _read(file: hdf5.Tables, group: str, part: type[Part], rows: slice | None = None) -> Part:
    """Read a part of the capture, with the given rows of the datasets that have a row per frame."""
    return part(
        **{
            name: _value(file, f"{group}/{name}", stored, rows)
            for name, stored in _recorded_fields(file, group, part)
        }
    )


def _recorded_fields(file: hdf5.Tables, group: str, part: type) -> list[tuple[str, Stored]]:
    """Fields of a part without those that are optional and missing from the file."""
    default = {
        field.name: field.default
        for field in fields(part)
        if not (field.default is MISSING and field.default_factory is MISSING)
    }
    return [
        (name, stored)
        for name, stored in stored_fields(part)
        if not (name in default and (stored.nan or default[name] is None))
        or f"{group}/{name}" in file
    ]


def _value(file: hdf5.Tables, where: str, stored: Stored, rows: slice | None) -> Any:
    value = file.get(where, stored.units, rows if stored.by_frame else None)
    array = stored.converted(where, value)
    scalar = array.size == 1 and (stored.one_for_all or not stored.axes)
    return array.item() if scalar else array


def _truth_of_the_first_frame(file: hdf5.Contents, *, still: bool) -> Truth:
    """Truth in a file of format version 2."""
    values: dict[str, Any] = {}
    for name, stored in _recorded_fields(file, "truth", Truth):
        if stored.axes[1:]:  # all but which frames these are
            value = file.get(f"truth/{name}", stored.units)
            values[name] = stored.converted(f"truth/{name}", value)[None]
    return Truth(frame=np.zeros(1, np.int64), still=still, **values)

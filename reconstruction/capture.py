"""The capture file: one recording, real or simulated (see docs/capture-format.md).

The annotations of the data classes are the file's schema: reading, writing and checking follow
them. Everything geometric is in the projector's optical frame: x right, y down, z forward, origin
at its pinhole. The CW-iToF convention is S_k = B + A cos(phi - tap_phase_k) with
phi = 2 pi f L / c + phase_offset, L the whole optical path.
"""

import hashlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import h5py
import numpy as np
from numpy.typing import NDArray

from .errors import InputError
from .files import write_atomically
from .hdf5 import content, get, get_attribute, get_text, opened, put, put_attribute
from .patterns import PatternPlan
from .schema import Stored, check_value, stored_fields

FORMAT = "spisim-capture"
VERSION = (1, 0)


Unit = Literal["electron", "count"]
Readings = Annotated[NDArray[Any], Stored("count", ("frames", "exposures"), "int32 or float64")]
Taps = Annotated[NDArray[Any], Stored("count", ("frames", 4, "taps"), "int32 or float64")]
Image = NDArray[np.float32]
Reals = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Buckets:
    """Single-pixel readings, one per exposure.

    ``counts`` are raw ADC counts, int32 or float64; electrons = (counts - offset_counts) *
    electrons_per_count. ``saturated`` marks readings that must not be used. ``noise_electrons`` is
    the rms electronics and ADC noise of one exposure. Times, scale and noise are nan where unknown.
    """

    counts: Readings
    saturated: Annotated[NDArray[np.bool_], Stored("1", ("frames", "exposures"), "bool")]
    exposure_time_s: Annotated[float, Stored("s", positive=True, nan=True)]
    pattern_period_s: Annotated[float, Stored("s", positive=True, nan=True)]
    electrons_per_count: Annotated[float, Stored("electron/count", positive=True, nan=True)]
    offset_counts: Annotated[float, Stored("count")]
    noise_electrons: Annotated[float, Stored("electron", nan=True)]

    @property
    def unit(self) -> Unit:
        """Unit of ``signal``."""
        return "electron" if np.isfinite(self.electrons_per_count) else "count"

    @property
    def signal(self) -> Reals:
        """Light of each exposure (frames, M): electrons, or counts where their scale is unknown."""
        scale = self.electrons_per_count if self.unit == "electron" else 1.0
        return np.asarray((self.counts - self.offset_counts) * scale)


@dataclass(frozen=True, eq=False)
class Spots:
    """CW-iToF readings of the four laser spots, and how to turn them into ranges.

    ``periods`` is the number of modulation periods that each tap accumulates;
    ``noise_electrons`` the rms electronics and ADC noise of one tap.
    """

    taps: Taps
    saturated: Annotated[NDArray[np.bool_], Stored("1", ("frames", 4, "taps"), "bool")]
    directions: Annotated[Reals, Stored("1", (4, 3))]
    detector_positions_m: Annotated[Reals, Stored("m", (4, 3))]
    modulation_frequency_hz: Annotated[float, Stored("Hz", positive=True)]
    periods: Annotated[int, Stored("1", dtype="int64", positive=True)]
    tap_phases_rad: Annotated[Reals, Stored("rad", ("taps",))]
    phase_offset_rad: Annotated[float, Stored("rad")]
    electrons_per_count: Annotated[float, Stored("electron/count", positive=True)]
    offset_counts: Annotated[float, Stored("count")]
    noise_electrons: Annotated[float, Stored("electron", nan=True)]


@dataclass(frozen=True, eq=False)
class Optics:
    """Projector pinhole: tangents of the half angles to the outer edges of the pattern."""

    tan_half_width: Annotated[float, Stored("1", positive=True)]
    tan_half_height: Annotated[float, Stored("1", positive=True)]


@dataclass(frozen=True, eq=False)
class Truth:
    """What a simulation knows: only evaluation reads it; nan where nothing is hit.

    ``image`` is the electrons per exposure that each virtual pixel alone, fully on, contributes;
    ``image_error`` the standard error of the light transport that found it.
    """

    image: Annotated[Image, Stored("electron", ("height", "width"), "float32", nan=True)]
    image_error: Annotated[Image, Stored("electron", ("height", "width"), "float32", nan=True)]
    range_m: Annotated[Image, Stored("m", ("height", "width"), "float32", nan=True)]
    depth_m: Annotated[Image, Stored("m", ("height", "width"), "float32", nan=True)]
    reflectance: Annotated[Image, Stored("1", ("height", "width"), "float32", nan=True)]
    spot_range_m: Annotated[Reals, Stored("m", (4,), nan=True)]


@dataclass(frozen=True)
class Provenance:
    """Where a capture comes from: ``created`` is an ISO time.

    ``instrument``, ``scene`` and the ``settings`` of the simulator are YAML text.
    """

    source: Literal["simulation", "hardware"]
    software: str
    created: str
    instrument: str
    scene: str = ""
    seed: int | None = None
    settings: str = ""


@dataclass(frozen=True, eq=False)
class Capture:
    """One recording. Raises InputError if its parts do not fit together."""

    plan: PatternPlan
    buckets: Buckets
    spots: Spots | None
    optics: Optics | None
    provenance: Provenance
    truth: Truth | None = None

    def __post_init__(self) -> None:
        _check(self)

    @property
    def frames(self) -> int:
        """Number of frames."""
        return int(self.buckets.counts.shape[0])

    @cached_property
    def digest(self) -> str:
        """SHA-256 over patterns and readings, by which a result knows its recording."""
        plan = self.plan
        readings = [np.array(plan.shape), plan.index, plan.polarity, self.buckets.counts]
        if self.spots is not None:
            readings.append(self.spots.taps)
        digest = hashlib.sha256()
        for values in readings:
            digest.update(f"{values.shape}".encode())
            digest.update(values.astype(np.float64).tobytes())  # of whichever type the file has
        return digest.hexdigest()


PARTS = {"buckets": Buckets, "spots": Spots, "optics": Optics, "truth": Truth}
OPTIONAL = ("spots", "optics", "truth")
SOURCES = ("simulation", "hardware")
TEXTS = ("instrument", "scene", "settings")


def write_capture(capture: Capture, path: str | Path) -> None:
    """Write a capture to HDF5, whole or not at all; equal captures give byte-equal files.

    Raises OSError if the file cannot be written.
    """
    write_atomically(path, content(lambda file: _write(file, capture)))


def read_capture(path: str | Path) -> Capture:
    """Read a capture.

    Raises InputError, naming the file, if it is missing, damaged, not a capture, of a newer format
    version, or if a dataset is missing, has another shape or unit, or makes no sense.
    """
    if not Path(path).is_file():
        raise InputError(f"{path}: no such capture file")
    with opened(path, FORMAT, "capture") as file:
        return _read(file)


def _write(file: h5py.File, capture: Capture) -> None:
    provenance = capture.provenance
    put_attribute(file, "format", FORMAT)
    put_attribute(file, "version", _dotted(VERSION))
    for name in ("source", "software", "created"):
        put_attribute(file, name, getattr(provenance, name))
    put(file, "patterns/shape", np.array(capture.plan.shape, np.int32), "1")
    for name in ("index", "polarity", "basis", "order"):
        put(file, f"patterns/{name}", getattr(capture.plan, name), "1")
    for group in PARTS:
        part = getattr(capture, group)
        if part is not None:
            for name, stored in stored_fields(type(part)):
                value = np.asarray(getattr(part, name))
                dtype = stored.type_of(value)
                on_disk = np.dtype(np.uint8) if dtype.kind == "b" else dtype
                put(file, f"{group}/{name}", value.astype(on_disk), stored.units)
    for name in TEXTS:
        put(file, f"provenance/{name}", getattr(provenance, name), "1")
    if provenance.seed is not None:
        put(file, "provenance/seed", np.int64(provenance.seed), "1")


def _read(file: h5py.File) -> Capture:
    _check_version(get_attribute(file, "version"))
    basis = get_text(file, "patterns/basis")
    if basis != "hadamard":
        raise InputError(f"patterns/basis is {basis!r}; allowed: hadamard")
    shape = get(file, "patterns/shape", "1")
    if shape.shape != (2,):
        raise InputError(f"patterns/shape has shape {shape.shape}, expected (2,)")
    plan = PatternPlan(
        shape=(int(shape[0]), int(shape[1])),
        index=get(file, "patterns/index", "1"),
        polarity=get(file, "patterns/polarity", "1"),
        order=get_text(file, "patterns/order"),
    )
    seed = get(file, "provenance/seed", "1") if "provenance/seed" in file else None
    provenance = Provenance(
        source=get_attribute(file, "source"),
        software=get_attribute(file, "software"),
        created=get_attribute(file, "created"),
        seed=None if seed is None else int(seed.item()),
        **{name: get_text(file, f"provenance/{name}") for name in TEXTS},
    )
    parts: dict[str, Any] = {
        group: None if group in OPTIONAL and group not in file else _read_part(file, group, part)
        for group, part in PARTS.items()
    }
    return Capture(plan=plan, provenance=provenance, **parts)


def _read_part(file: h5py.File, group: str, part: type) -> Any:
    values: dict[str, Any] = {}
    for name, stored in stored_fields(part):
        value = get(file, f"{group}/{name}", stored.units)
        if value.dtype.kind not in "iufb":
            raise InputError(f"{group}/{name} must hold numbers, found {value.dtype}")
        array = value.astype(stored.type_of(value))
        values[name] = array.item() if not stored.axes and array.size == 1 else array
    return part(**values)


def _check(capture: Capture) -> None:
    """Raise InputError unless the parts fit together and their numbers make sense."""
    if capture.provenance.source not in SOURCES:
        raise InputError(f"source is {capture.provenance.source!r}; allowed: {', '.join(SOURCES)}")
    height, width = capture.plan.shape
    sizes = {"exposures": capture.plan.exposures, "height": height, "width": width}
    for group in PARTS:
        part = getattr(capture, group)
        if part is not None:
            for name, stored in stored_fields(type(part)):
                check_value(f"{group}/{name}", np.asarray(getattr(part, name)), stored, sizes)
    if sizes["frames"] < 1:
        raise InputError("buckets/counts holds no frame")
    if capture.spots is not None:
        if sizes["taps"] < 3:
            raise InputError(f"spots/taps has {sizes['taps']} taps; a phase needs at least 3")
        _check_directions(capture.spots.directions)


def _check_directions(directions: Reals) -> None:
    lengths = np.linalg.norm(directions, axis=1)
    if np.abs(lengths - 1).max() > 1e-3 or directions[:, 2].min() <= 0:
        raise InputError(
            "spots/directions must be unit vectors that point forward (z > 0); "
            f"their lengths are {np.round(lengths, 4).tolist()}"
        )


def _check_version(text: str) -> None:
    try:
        major, minor = (int(number) for number in text.split("."))
    except ValueError:
        raise InputError(f"the format version {text!r} is not of the form 1.0") from None
    if (major, minor) > VERSION:
        raise InputError(
            f"written in the newer format version {text}; this software reads up to "
            f"{_dotted(VERSION)}: update it"
        )


def _dotted(version: tuple[int, int]) -> str:
    return ".".join(map(str, version))

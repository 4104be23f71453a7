"""The capture file: one recording, real or simulated (see docs/capture-format.md).

The annotations of the data classes are the file's schema: reading, writing and checking follow
them. Everything geometric is in the projector's optical frame: x right, y down, z forward, origin
at its pinhole. Time-of-flight readings are in `reconstruction.spots`.
"""

import hashlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import h5py
import numpy as np
from numpy.typing import NDArray

from .errors import InputError, nearest
from .files import write_atomically
from .hdf5 import content, get, get_attribute, get_text, opened, put, put_attribute
from .patterns import PatternPlan
from .schema import Stored, check_value, stored_fields
from .spots import METHODS, PatternTaps, Spots

FORMAT = "spisim-capture"
VERSION = (2, 0)

Unit = Literal["electron", "count"]
Readings = Annotated[NDArray[Any], Stored("count", ("frames", "exposures"), "int32 or float64")]
Image = NDArray[np.float32]
Reals = NDArray[np.float64]

FULL_LOAD = 1 - 1e-6
"""Share of the exposure for which a counting detector may be blind: beyond, it tells nothing."""


@dataclass(frozen=True, eq=False)
class Buckets:
    """Single-pixel readings, one per exposure.

    ``counts`` are raw ADC counts, int32 or float64; (counts - offset_counts) * electrons_per_count
    are primary photo-electrons, before any gain. ``saturated`` marks readings that must not be
    used. ``noise_electrons`` is the rms electronics and ADC noise of one exposure;
    ``excess_noise_factor`` the variance of the charge per primary electron (see `Charge`);
    ``dead_time_s`` how long a counting detector is blind after each detection, 0 for one that
    integrates charge; ``baseline_electrons`` what AC coupling takes off each reading, on average:
    its shot noise stays. Times, scale and noise are nan where unknown.
    """

    counts: Readings
    saturated: Annotated[NDArray[np.bool_], Stored("1", ("frames", "exposures"), "bool")]
    exposure_time_s: Annotated[float, Stored("s", sign="positive", nan=True)]
    pattern_period_s: Annotated[float, Stored("s", sign="positive", nan=True)]
    electrons_per_count: Annotated[float, Stored("electron/count", sign="positive", nan=True)]
    offset_counts: Annotated[float, Stored("count")]
    noise_electrons: Annotated[float, Stored("electron", sign="not negative", nan=True)]
    excess_noise_factor: Annotated[float, Stored("1", sign="positive")]
    dead_time_s: Annotated[float, Stored("s", sign="not negative")]
    baseline_electrons: Annotated[float, Stored("electron", sign="not negative")] = 0.0

    @property
    def unit(self) -> Unit:
        """Unit of ``signal``."""
        return "electron" if np.isfinite(self.electrons_per_count) else "count"

    @property
    def signal(self) -> Reals:
        """Light of each exposure (frames, M): electrons, or counts where their scale is unknown.

        What a counting detector missed while it was blind is put back: of N arrivals in the time T
        it detects m = N / (1 + N tau / T), so N = m / (1 - m tau / T), for T much longer than the
        dead time tau (J. W. Mueller, Nucl. Instrum. Methods 112, 47 (1973), non-extended type).
        """
        return np.asarray(self._detected / (1 - np.minimum(self._load, FULL_LOAD)))

    @property
    def variance(self) -> Reals:
        """Variance of ``signal`` (frames, M) from light and electronics; nan where unknown.

        Renewal theory: var(m) = N / (1 + N tau / T)^3 (as for ``signal``), carried to N by
        dN / dm = (1 + N tau / T)^2. Of a difference formed by the recorder the light is not
        known, but is at least its magnitude.
        """
        if self.unit == "count":
            return np.full(self.counts.shape, np.nan)
        light = np.abs(self.signal + self.baseline_electrons)
        if self.dead_time_s > 0:
            light = light * (1 + light * self.dead_time_s / self.exposure_time_s)
        return np.asarray(self.excess_noise_factor * light + self.noise_electrons**2)

    @property
    def usable(self) -> NDArray[np.bool_]:
        """Readings (frames, M) that are neither saturated nor of a detector blind all the time."""
        return np.asarray(~self.saturated & (self._load < FULL_LOAD))

    @property
    def _detected(self) -> Reals:
        scale = self.electrons_per_count if self.unit == "electron" else 1.0
        return np.asarray((self.counts - self.offset_counts) * scale)

    @property
    def _load(self) -> Reals:
        """Share of the exposure for which the detector was blind (frames, M)."""
        if self.dead_time_s == 0:
            return np.zeros(self.counts.shape)
        return np.asarray(self._detected * self.dead_time_s / self.exposure_time_s)


@dataclass(frozen=True, eq=False)
class Optics:
    """Projector pinhole: tangents of the half angles to the outer edges of the pattern."""

    tan_half_width: Annotated[float, Stored("1", sign="positive")]
    tan_half_height: Annotated[float, Stored("1", sign="positive")]


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
    """Where a capture comes from: ``created`` is an ISO time, or empty.

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
    """One recording. Raises InputError if its parts do not fit together.

    Where there are ``pattern_taps``, the buckets hold their sums over the taps.
    """

    plan: PatternPlan
    buckets: Buckets
    spots: Spots | None
    optics: Optics | None
    provenance: Provenance
    truth: Truth | None = None
    pattern_taps: PatternTaps | None = None

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
            readings.append(self.spots.readings)
        if self.pattern_taps is not None:
            readings.append(self.pattern_taps.taps)
        digest = hashlib.sha256()
        for values in readings:
            digest.update(f"{values.shape}".encode())
            digest.update(values.astype(np.float64).tobytes())  # of whichever type the file has
        return digest.hexdigest()


PARTS = ("buckets", "spots", "pattern_taps", "optics", "truth")
SOURCES = ("simulation", "hardware")
TEXTS = ("instrument", "scene", "settings")


def write_capture(capture: Capture, path: str | Path) -> None:
    """Write a capture to HDF5, whole or not at all; equal captures give byte-equal files.

    Raises OSError if the file cannot be written.
    """
    write_atomically(path, content(lambda file: _write(file, capture)))


def read_capture(path: str | Path) -> Capture:
    """Read a capture.

    Raises InputError, naming the file, if it is missing, damaged, not a capture, of another format
    version, or if a dataset is missing, has another shape or unit, or makes no sense.
    """
    if Path(path).is_dir():
        raise InputError(f"{path} is a folder; the name of a capture file is needed")
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
    if capture.spots is not None:
        put(file, "spots/method", capture.spots.method, "1")
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
    optional: dict[str, Any] = {
        group: _read_part(file, group, part) if group in file else None
        for group, part in {"pattern_taps": PatternTaps, "optics": Optics, "truth": Truth}.items()
    }
    return Capture(
        plan=plan,
        provenance=provenance,
        buckets=_read_part(file, "buckets", Buckets),
        spots=_read_part(file, "spots", _method(file)) if "spots" in file else None,
        **optional,
    )


def _method(file: h5py.File) -> type[Spots]:
    method = get_text(file, "spots/method")
    if method not in METHODS:
        raise InputError(f"spots/method is {method!r}: {nearest(method, METHODS)}")
    return METHODS[method]


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
    if capture.buckets.dead_time_s > 0:
        _check_dead_time(capture)
    for readings in (capture.spots, capture.pattern_taps):
        if readings is not None:
            readings.check()


def _check_dead_time(capture: Capture) -> None:
    """Raise InputError unless readings can be corrected for the dead time."""
    dead = f"buckets/dead_time_s is {capture.buckets.dead_time_s:g} s"
    for name in ("exposure_time_s", "electrons_per_count"):
        if not np.isfinite(getattr(capture.buckets, name)):
            raise InputError(f"{dead}; then buckets/{name} must be known, not nan")
    if (capture.plan.polarity == 0).any():
        raise InputError(
            f"{dead}, but patterns/polarity 0 marks readings as differences, which cannot be "
            "corrected for it: store what was counted, or dead_time_s 0"
        )


def _check_version(text: str) -> None:
    try:
        major, minor = (int(number) for number in text.split("."))
    except ValueError:
        raise InputError(f"the format version {text!r} is not of the form 2.0") from None
    if (major, minor) > VERSION:
        raise InputError(
            f"written in the newer format version {text}; this software reads up to "
            f"{_dotted(VERSION)}: update it"
        )
    if major < VERSION[0]:
        raise InputError(
            f"written in the older format version {text}; this software reads "
            f"{_dotted((VERSION[0], 0))} to {_dotted(VERSION)}: record, simulate or import it again"
        )


def _dotted(version: tuple[int, int]) -> str:
    return ".".join(map(str, version))

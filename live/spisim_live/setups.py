"""Setups of a stream, and payloads of its frames (docs/reference/stream-format.md)."""

import math
import zlib
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.errors import InputError
from reconstruction.capture import Frames, Provenance, Setup, check_parts, datasets, read_setup
from reconstruction.capture.model import READING_PARTS
from reconstruction.capture.schema import present_fields

from .framing import MAX_PAYLOAD_BYTES, Kind, Message
from .tables import Arrays, Value, packed, unpacked

MAX_FRAME_BYTES = 2**20
MAX_PIXELS = 2**14
"""Maximum number of pixels of an image: 128 × 128."""
MAX_WEIGHTS = 2**23
"""Maximum pixels of all patterns together, or of those left out if these are fewer: methods compile
matrices of this size and need a few times their 64 MiB."""
FLAGS = "saturated"
TEXT_DEFAULTS = {"source": "hardware", "software": "", "provenance/instrument": ""}
"""Texts that a setup may hold besides a capture's datasets, and their defaults."""

Part = TypeVar("Part")


class StreamSetup:
    """What the frames of a stream share, and how their payloads are read.

    The message holds the datasets of a capture of no frames. Those whose first axis is that of the
    frames, and so has length 0, make up a frame's payload in their order. ``id`` is the CRC-32 of
    the message's payload. Raises InputError for an invalid setup.
    """

    def __init__(self, payload: bytes) -> None:
        self.payload = payload
        self.id = zlib.crc32(payload)
        entries = unpacked(payload)
        self._readings = {
            name: values for name, values in entries.items() if values.shape[:1] == (0,)
        }
        self.frame_bytes = sum(map(_frame_bytes, self._readings.values()))
        tables = Arrays(_with_flags(entries))
        _check_readings(entries, self.frame_bytes)
        _check_pixels(entries)
        self.setup = read_setup(tables)
        _check_patterns(self.setup)
        texts = {
            name: tables.text(name) if name in entries else default
            for name, default in TEXT_DEFAULTS.items()
        }
        if texts["source"] not in ("hardware", "simulation"):
            raise InputError(f"source is {texts['source']!r}; allowed: hardware, simulation")
        self.provenance = Provenance(
            source=texts["source"],  # type: ignore[arg-type]
            software=texts["software"],
            created="",
            instrument=texts["provenance/instrument"],
        )

    @property
    def frame_period_s(self) -> float:
        """Seconds from one frame to the next; nan if unknown."""
        return frame_period_s(self.setup)

    def frames(self, payload: bytes, number: int) -> Frames:
        """The frame of a number; raises InputError unless its readings fit this setup."""
        if len(payload) != self.frame_bytes:
            raise InputError(f"a frame of {len(payload)} bytes; its setup has {self.frame_bytes}")
        values: dict[str, Value] = {}
        at = 0
        for name, empty in self._readings.items():
            shape = (1, *empty.shape[1:])
            values[name] = np.frombuffer(payload, empty.dtype, math.prod(shape), at).reshape(shape)
            at += _frame_bytes(empty)
        setup = self.setup
        parts = [(group, getattr(setup, group)) for group in READING_PARTS]
        frames = Frames(
            number, **{group: part and _filled(part, group, values) for group, part in parts}
        )
        check_parts(frames)
        return frames


def length_error(message: Message, length: int, stream: StreamSetup | None) -> str | None:
    """Why a message of a ``stream`` cannot have this length, None if it can."""
    setup, frame = message.kind == Kind.SETUP, message.kind == Kind.FRAME
    if stream is not None and message.setup == stream.id and (setup or frame):
        expected = len(stream.payload) if setup else stream.frame_bytes
        if length != expected:
            return (
                f"a {Kind(message.kind).name.lower()} of {length} bytes; it should have {expected}"
            )
    maximum = MAX_PAYLOAD_BYTES if setup else MAX_FRAME_BYTES
    return f"a message of {length} bytes; at most {maximum}" if length > maximum else None


def frame_period_s(setup: Setup) -> float:
    """Seconds from one frame of a recording to the next; nan if unknown."""
    return setup.buckets.pattern_period_s * setup.plan.exposures


def setup_payload(setup: Setup, provenance: Provenance | None = None) -> bytes:
    """Payload of a setup message."""
    entries: dict[str, Any] = {}
    if provenance is not None:
        entries["source"], entries["software"] = provenance.source, provenance.software
        entries["provenance/instrument"] = provenance.instrument
    entries |= {name: value for name, value, _ in datasets(setup.plans, setup)}
    return packed(entries)


def frame_payload(frame: Frames) -> bytes:
    """Payload of a frame of the setup of `setup_payload`."""
    parts = [part for group in READING_PARTS if (part := getattr(frame, group)) is not None]
    return b"".join(
        _bytes(stored.converted(name, getattr(part, name)))
        for part in parts
        for name, stored in present_fields(part)
        if stored.by_frame
    )


def _bytes(values: NDArray[Any]) -> bytes:
    return values.astype(values.dtype.newbyteorder("<"), copy=False).tobytes()


def _check_readings(entries: Mapping[str, Value], frame_bytes: int) -> None:
    for name in ("buckets/counts", "spots/taps", "spots/counts", "pattern_taps/taps"):
        if name in entries and entries[name].shape[:1] != (0,):
            raise InputError(f"{name} has shape {entries[name].shape}; a setup has 0 frames")
    if frame_bytes > MAX_FRAME_BYTES:
        raise InputError(f"a frame of {frame_bytes} bytes; at most {MAX_FRAME_BYTES}")


def _check_pixels(entries: Mapping[str, Value]) -> None:
    """Check the size before anything is built; other errors of the shape come later."""
    sides = entries.get("patterns/shape")
    if sides is not None and sides.dtype.kind in "iuf" and sides.size == 2:
        height, width = (float(side) for side in sides.ravel())
        if height * width > MAX_PIXELS:
            raise InputError(
                f"patterns/shape is {height:g} x {width:g}; a stream has at most {MAX_PIXELS} "
                "pixels"
            )


def _check_patterns(setup: Setup) -> None:
    """Check the number of patterns of each plan."""
    for plan in setup.plans:
        weights = min(plan.sampled, abs(plan.pixels - plan.sampled)) * plan.pixels
        if weights > MAX_WEIGHTS:
            raise InputError(
                f"patterns/index has {plan.sampled} patterns of {plan.pixels} pixels; a stream may "
                f"have {MAX_WEIGHTS // plan.pixels} of that size, or all but as many"
            )


def _frame_bytes(empty: Value) -> int:
    """Bytes per frame of an array without frames."""
    return math.prod(empty.shape[1:]) * empty.dtype.itemsize


def _filled(part: Part, group: str, values: Mapping[str, Value]) -> Part:
    """Fill a part with the readings of a frame; missing flags mean not saturated."""
    filled: dict[str, Any] = {}
    for name, stored in present_fields(part):
        if stored.by_frame:
            where = f"{group}/{name}"
            empty = getattr(part, name)
            value = values.get(where)
            if value is None:
                value = np.zeros((1, *empty.shape[1:]), empty.dtype)
            filled[name] = stored.converted(where, value)
    return replace(part, **filled)  # type: ignore[type-var]


def _with_flags(entries: Mapping[str, Value]) -> dict[str, Value]:
    """Add flags of saturation where they are missing."""
    complete = dict(entries)
    for group, readings in (("buckets", "counts"), ("spots", ""), ("pattern_taps", "taps")):
        flags = f"{group}/{FLAGS}"
        names = [f"{group}/{readings}"] if readings else ["spots/taps", "spots/counts"]
        for name in names:
            if name in complete and flags not in complete:
                shape = complete[name].shape
                complete[flags] = np.zeros(shape[:2] if name == "spots/counts" else shape, np.uint8)
    return complete

"""MCAP files (mcap.dev) of ROS 2 messages, as rosbag2 plays them."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np

from reconstruction.base.errors import InputError
from reconstruction.base.files import mark
from reconstruction.exports import Shot
from reconstruction.exports.export import KIND

from .messages import Message, frame_messages, map_messages, static_messages

LATCHED_QOS = """- history: keep_last
  depth: 1
  reliability: reliable
  durability: transient_local
  deadline: {sec: 9223372036, nsec: 854775807}
  lifespan: {sec: 9223372036, nsec: 854775807}
  liveliness: automatic
  liveliness_lease_duration: {sec: 9223372036, nsec: 854775807}
  avoid_ros_namespace_conventions: false
"""
"""Quality of service with which rosbag2 also serves late subscribers."""
MAP_PERIOD_NS = 95_000_000
"""Minimum time between frames whose image, depth map and cloud are written: ten a second, with room
for jitter. Noise does not compress; all frames would take 10 MB a second."""
MISSING = (
    "MCAP files need mcap, zstandard and rosbags ({name} is missing): "
    "pip install './reconstruction[ros]' or 'spisim[ros]'"
)


class Libraries(NamedTuple):
    """Writer of the container, its compression, and message types."""

    writer: Any
    compression: Any
    types: Any


def libraries() -> Libraries:
    """Import the libraries; raises InputError if they are not installed."""
    try:
        import zstandard  # noqa: F401 -- used by the writer
        from mcap.writer import CompressionType, Writer
        from rosbags.typesys import Stores, get_typestore
    except ModuleNotFoundError as error:
        raise InputError(MISSING.format(name=error.name)) from None
    return Libraries(Writer, CompressionType.ZSTD, get_typestore(Stores.ROS2_JAZZY))


class McapFile:
    """A file written message by message, with the definitions of ROS 2 Jazzy.

    Raises InputError without the libraries, OSError if the file cannot be written.
    """

    def __init__(self, path: Path) -> None:
        writer, compression, self._types = libraries()
        self._file: IO[bytes] = path.open("wb")
        self._writer = writer(self._file, compression=compression)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._sequence: dict[str, int] = {}
        self._map_ns: int | None = None  # stamp of the last frame with maps
        self._writer.start(profile="ros2", library="spisim")
        self._writer.add_metadata(mark(KIND), {})
        self._file.flush()  # a killed run's file must show whose it is

    def write_frame(self, shot: Shot, log_ns: int, *, begins: bool) -> None:
        """Write the messages of a frame, and at the beginning of a recording its static ones.

        Image, depth map and cloud are left out within `MAP_PERIOD_NS` of the last ones, unless a
        recording begins.
        """
        if begins:
            self.write(static_messages(shot), log_ns)
        self.write(frame_messages(shot), log_ns)
        last_ns = self._map_ns
        if begins or last_ns is None or not 0 < shot.stamp_ns - last_ns < MAP_PERIOD_NS:
            self.write(map_messages(shot), log_ns)
            self._map_ns = shot.stamp_ns

    def write(self, messages: Iterable[Message], log_ns: int) -> None:
        """Write messages received at a time, in nanoseconds since 1970 or since the beginning."""
        for message in messages:
            channel = self._channel(message)
            sequence = self._sequence[message.topic] = self._sequence.get(message.topic, -1) + 1
            made = _made(self._types, message.type, message.fields)
            data = bytes(self._types.serialize_cdr(made, message.type))
            self._writer.add_message(channel, log_ns, data, log_ns, sequence)

    def close(self) -> None:
        """Write the index and close the file."""
        if not self._file.closed:
            try:
                self._writer.finish()
            finally:
                self._file.close()

    def _channel(self, message: Message) -> int:
        if message.type not in self._schemas:
            text, _ = self._types.generate_msgdef(message.type, ros_version=2)
            schema = self._writer.register_schema(message.type, "ros2msg", text.encode())
            self._schemas[message.type] = schema
        if message.topic not in self._channels:
            schema = self._schemas[message.type]
            quality = {"offered_qos_profiles": LATCHED_QOS if message.latched else ""}
            channel = self._writer.register_channel(message.topic, "cdr", schema, quality)
            self._channels[message.topic] = channel
        return self._channels[message.topic]


def _made(types: Any, kind: str, fields: Mapping[str, Any]) -> Any:
    """Build a message of the library's classes."""
    _, definitions = types.fielddefs[kind]
    values = {name: _value(types, kind, fields[name]) for name, kind in definitions}
    return types.types[kind](**values)


def _value(types: Any, definition: Any, value: Any) -> Any:
    """Build a field, defined by (1, (base, _)), (2, name), or (3 or 4, (definition, length))."""
    node, detail = int(definition[0]), definition[1]
    if node == 1:
        return value
    if node == 2:
        return _made(types, detail, value)
    inner = detail[0]
    if int(inner[0]) == 2:
        return [_made(types, inner[1], each) for each in value]
    if isinstance(value, bytes):
        return np.frombuffer(value, np.uint8)
    return np.array(value, dtype=inner[1][0])

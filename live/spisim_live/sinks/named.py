"""Sinks by the argument of ``--to``."""

import sys
from collections.abc import Sequence
from pathlib import Path

from reconstruction.base.errors import InputError

from ..links import NewFile, is_link, outlet_to
from ..mavlink import is_mavlink, mavlink_outlet
from .latest import LatestResult
from .lines import JsonLines, LinesFile
from .mavlink import MavlinkSink
from .mcap import McapRecord
from .messages import MessageSink
from .records import CaptureRecord, StreamRecord
from .sink import Sink
from .window import WindowSink

WINDOW = "window"
STREAM = ".stream"
MCAP = ".mcap"
ENDINGS = {
    ".jsonl": "results, a line each",
    ".h5 or .hdf5": "captures of the frames",
    STREAM: "the frames as they came",
    MCAP: "results as messages of ROS 2",
}


def sink_to(name: str, read: Sequence[Path] = (), *, overwrite: bool = False) -> Sink:
    """Sink of a name, that replaces no file ``read``; raises InputError for an unknown one."""
    if name == "-":
        return JsonLines(lambda: sys.stdout)
    if name == WINDOW:
        return WindowSink()
    if is_mavlink(name):
        return MavlinkSink(mavlink_outlet(name))
    if is_link(name):
        return MessageSink(outlet_to(name))
    path = Path(name)
    if path.suffix.lower() in (".h5", ".hdf5"):
        return CaptureRecord(path, read, overwrite=overwrite)
    if path.suffix == STREAM:
        return StreamRecord(NewFile(path), read, overwrite=overwrite)
    if path.suffix == MCAP:
        return McapRecord(path, read, overwrite=overwrite)
    if path.suffix == ".jsonl":
        return LinesFile(path, read, overwrite=overwrite)
    if path.suffix and not path.is_dir():
        available = ", ".join(f"{ending} ({what})" for ending, what in ENDINGS.items())
        raise InputError(
            f"{name}: unknown extension {path.suffix!r}; allowed: {available}, "
            "a folder, an address, mavlink:CONNECTION, window or -"
        )
    return LatestResult(path, read, overwrite=overwrite)

"""MAVLink connections as pymavlink has them: udp:14550, udpout:HOST:PORT, /dev/ttyACM0,57600."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from reconstruction.base.errors import InputError, nearest

from ..links import Outlet, Source
from ..links.serial_port import SerialPort
from ..links.sockets import Tcp, TcpListen, Udp, UdpListen

PREFIX = "mavlink:"
"""Begins the name of a sink."""
TLOG = ".tlog"
DEFAULT_BAUD = 115_200
SOURCES = {"udp": UdpListen, "udpin": UdpListen, "tcp": Tcp, "tcpin": TcpListen}
OUTLETS = {"udpout": Udp, "tcp": Tcp, "tcpin": TcpListen}
CALLING = ("tcp", "udpout")
"""Kinds that need a host; others listen on all interfaces without one."""


def is_mavlink(name: str) -> bool:
    """Whether the name of a sink is that of a MAVLink connection."""
    return name.startswith(PREFIX)


def mavlink_source(text: str) -> Source:
    """Return a source of MAVLink's bytes; raises InputError for another connection."""
    return _link(text, SOURCES, text)


def mavlink_outlet(name: str) -> Outlet:
    """Return the outlet of a sink's name; raises InputError for another connection."""
    return _link(name.removeprefix(PREFIX), OUTLETS, name)


def _link(text: str, kinds: Mapping[str, Any], name: str) -> Any:
    if text.startswith("/dev/"):
        device, _, baud = text.partition(",")
        if baud and not (baud.isascii() and baud.isdigit() and int(baud)):
            raise InputError(f"{name}: baud is {baud!r}, must be a whole number, as in 57600")
        return SerialPort(name, device, int(baud or DEFAULT_BAUD))
    kind, _, endpoint = text.partition(":")
    if kind not in kinds:
        more = f", a {TLOG} file" if kinds is SOURCES else ""
        raise InputError(
            f"{name}: unknown kind of MAVLink connection {kind!r}: {nearest(kind, kinds)}, "
            f"/dev/DEVICE,BAUD{more}"
        )
    host, _, port = endpoint.rpartition(":")
    valid = port.isascii() and port.isdigit() and 0 <= int(port) < 2**16
    if not valid or (kind in CALLING and not host):
        form = "HOST:PORT" if kind in CALLING else "PORT or HOST:PORT"
        raise InputError(f"{name}: after {kind}: comes {form}, as in {kind}:{_example(kind)}")
    return kinds[kind](name, host.strip("[]"), int(port))


def _example(kind: str) -> str:
    return "192.168.0.10:14550" if kind in CALLING else "14550"


def is_log(text: str) -> bool:
    """Whether poses come from a recording of a ground station."""
    return Path(text).suffix.lower() == TLOG

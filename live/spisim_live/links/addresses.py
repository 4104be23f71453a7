"""Addresses: tcp://host:port, tcp-listen://:port, udp://, serial:///dev/ttyUSB0, -, a file."""

from pathlib import Path
from urllib.parse import parse_qs, urlsplit

from reconstruction.base.errors import InputError, nearest

from .files import NewFile, Stdin, Stdout, StreamFile
from .link import Outlet, Source
from .serial_port import SerialPort
from .sockets import Tcp, TcpListen, Udp, UdpListen

SCHEMES = ("tcp", "tcp-listen", "udp", "serial")
DEFAULT_BAUD = 921_600


def is_link(address: str) -> bool:
    """Whether an address is not a file name; raises InputError for an unknown scheme."""
    scheme, separator, _ = address.partition("://")
    if separator and scheme not in SCHEMES:
        raise InputError(f"{address}: unknown scheme {scheme!r}: {nearest(scheme, SCHEMES)}")
    return address == "-" or bool(separator)


def source_at(address: str, *, followed: bool = False) -> Source:
    """Source at an address; a file is ``followed`` as it grows. Raises InputError."""
    if address == "-":
        return Stdin(address)
    if not is_link(address):
        return StreamFile(Path(address), followed=followed)
    scheme = address.partition("://")[0]
    if scheme == "serial":
        return _serial(address)
    kinds = {"tcp": Tcp, "tcp-listen": TcpListen, "udp": UdpListen}
    return kinds[scheme](address, *_endpoint(address, listens=scheme != "tcp"))


def outlet_to(address: str) -> Outlet:
    """Outlet to an address. Raises InputError."""
    if address == "-":
        return Stdout(address)
    if not is_link(address):
        return NewFile(Path(address))
    scheme = address.partition("://")[0]
    if scheme == "serial":
        return _serial(address)
    kinds = {"tcp": Tcp, "tcp-listen": TcpListen, "udp": Udp}
    return kinds[scheme](address, *_endpoint(address, listens=scheme == "tcp-listen"))


def _endpoint(address: str, *, listens: bool) -> tuple[str, int]:
    try:
        split = urlsplit(address)
        host, port = split.hostname or "", split.port
    except ValueError:
        port = None
    if port is None or not (host or listens):
        what, example = ("port", "") if listens else ("host and port", "192.168.0.10")
        raise InputError(
            f"{address} lacks a {what}, 0 to 65535, as in {address.partition('://')[0]}://"
            f"{example}:5800"
        )
    return host, port


def _serial(address: str) -> SerialPort:
    split = urlsplit(address)
    query = parse_qs(split.query)
    unknown = set(query) - {"baud"}
    if unknown:
        name = min(unknown)
        raise InputError(f"{address}: unknown option {name!r}: {nearest(name, ['baud'])}")
    baud = query.get("baud", [str(DEFAULT_BAUD)])[0]
    if not baud.isascii() or not baud.isdigit() or not int(baud):
        raise InputError(f"{address}: baud is {baud!r}, must be a whole number, as in baud=921600")
    if not split.path or split.netloc:
        raise InputError(f"{address} lacks a device, as in serial:///dev/ttyUSB0?baud=921600")
    return SerialPort(address, split.path, int(baud))

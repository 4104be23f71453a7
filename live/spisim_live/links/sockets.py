"""TCP, connecting or listening, and UDP."""

import select
import socket
from contextlib import suppress
from errno import EADDRINUSE
from typing import Any

from reconstruction.base.errors import InputError

from .link import PIECE_BYTES, Link, Outlet, Source

PATIENCE_S = 1.0
"""Timeout of a connection attempt."""
STALLED_S = 10.0
"""Time without progress after which the other side of a connection is taken to be gone."""
KEEPALIVE = {"TCP_KEEPIDLE": 2, "TCP_KEEPALIVE": 2, "TCP_KEEPINTVL": 1, "TCP_KEEPCNT": 3} | {
    "TCP_USER_TIMEOUT": round(1e3 * STALLED_S)
}
"""Socket options, where available, that detect a vanished machine; s and ms."""
MAX_UNSENT_BYTES = 2**17
"""Maximum unsent bytes: more would arrive late, and hide that nobody reads."""
DATAGRAM_BYTES = 1200
"""Size that passes every path whole: IPv6's 1280 bytes (RFC 8200, section 5) less headers."""


class _SocketLink(Link):
    """A link with a socket, and the endpoint that it connects to or listens at."""

    def __init__(self, address: str, host: str, port: int) -> None:
        super().__init__(address)
        self._endpoint = (host, port)
        self._socket: socket.socket | None = None

    def close(self) -> None:
        _close(self._socket)
        self._socket = None


class Tcp(_SocketLink, Source, Outlet):
    """TCP client."""

    def open(self) -> None:
        _close(self._socket)
        self._take(socket.create_connection(self._endpoint, PATIENCE_S))

    def receive(self, timeout_s: float) -> bytes:
        connected = _required(self._socket)
        if not _ready(connected, timeout_s):
            return b""
        content = connected.recv(PIECE_BYTES)
        if not content:
            raise ConnectionResetError("the other side has closed the connection")
        return content

    def send(self, content: bytes) -> None:
        connected, rest = _required(self._socket), memoryview(content)
        while rest:
            try:
                rest = rest[connected.send(rest) :]
            except TimeoutError:
                raise TimeoutError(f"the other side has read nothing for {STALLED_S:g} s") from None

    def _take(self, connected: socket.socket) -> None:
        connected.settimeout(STALLED_S)
        connected.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        options = KEEPALIVE | {"TCP_NODELAY": 1, "TCP_NOTSENT_LOWAT": MAX_UNSENT_BYTES}
        for name, value in options.items():
            if hasattr(socket, name):
                connected.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)
        self.sender = _address_text(connected.getpeername())
        self._socket = connected


class TcpListen(Tcp):
    """TCP server for one client at a time."""

    def __init__(self, address: str, host: str, port: int) -> None:
        super().__init__(address, host, port)
        self._listener: socket.socket | None = None

    @property
    def port(self) -> int:
        """Listening port, which the system chooses for port 0."""
        return int(_required(self._listener).getsockname()[1])

    def check(self) -> None:
        if self._listener is None:
            self._listener = _bound(self.address, *self._endpoint, socket.SOCK_STREAM)
            self._listener.listen()

    def open(self) -> None:
        _close(self._socket)
        self.check()
        listener = _required(self._listener)
        listener.settimeout(PATIENCE_S)
        while True:
            try:
                called = listener.accept()[0]
            except TimeoutError:
                raise TimeoutError("nobody has connected yet") from None
            with suppress(OSError):  # this one has gone: the next
                self._take(called)
                return
            _close(called)

    @property
    def wanted(self) -> bool:
        """Whether another client has called."""
        return self._listener is not None and bool(select.select([self._listener], [], [], 0)[0])

    def close(self) -> None:
        super().close()
        _close(self._listener)
        self._listener = None


class UdpListen(_SocketLink, Source):
    """Datagrams received at a port."""

    forgeable = True

    @property
    def port(self) -> int:
        """Listening port, which the system chooses for port 0."""
        return int(_required(self._socket).getsockname()[1])

    def check(self) -> None:
        if self._socket is None:
            self._socket = _bound(self.address, *self._endpoint, socket.SOCK_DGRAM)

    def open(self) -> None:
        self.check()

    def receive(self, timeout_s: float) -> bytes:
        bound = _required(self._socket)
        if not _ready(bound, timeout_s):
            return b""
        content, sender = bound.recvfrom(PIECE_BYTES)
        self.sender = _address_text(sender)
        return content


class Udp(_SocketLink, Outlet):
    """Datagrams to an endpoint, whether anybody listens there or not."""

    def open(self) -> None:
        self.close()
        family, kind, _, _, endpoint = socket.getaddrinfo(*self._endpoint, type=socket.SOCK_DGRAM)[
            0
        ]
        self._socket = socket.socket(family, kind)
        self._socket.connect(endpoint)

    def send(self, content: bytes) -> None:
        connected = _required(self._socket)
        for at in range(0, len(content), DATAGRAM_BYTES):
            with suppress(ConnectionRefusedError):
                connected.send(content[at : at + DATAGRAM_BYTES])


def _ready(opened: socket.socket, timeout_s: float) -> bool:
    """Whether anything can be read within the timeout.

    Another thread may send meanwhile, and would share a timeout of the socket.
    """
    try:
        return bool(select.select([opened], [], [], timeout_s)[0])
    except ValueError:
        raise ConnectionResetError("the connection is closed") from None


def _address_text(endpoint: tuple[Any, ...]) -> str:
    """Format the address of a socket."""
    host, port = endpoint[:2]
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def _required(opened: socket.socket | None) -> socket.socket:
    if opened is None:
        raise ConnectionResetError("the connection is closed")
    return opened


def _close(opened: socket.socket | None) -> None:
    if opened is not None:
        with suppress(OSError):
            opened.shutdown(socket.SHUT_RDWR)  # wakes waiting threads
        opened.close()


def _bound(address: str, host: str, port: int, kind: socket.SocketKind) -> socket.socket:
    """A bound socket; raises InputError if it cannot be bound."""
    bound: socket.socket | None = None
    try:
        family, _, _, _, endpoint = socket.getaddrinfo(
            host or None, port, socket.AF_UNSPEC if host else socket.AF_INET, kind,
            flags=socket.AI_PASSIVE,
        )[0]  # fmt: skip
        bound = socket.socket(family, kind)
        if kind is socket.SOCK_STREAM:
            bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.bind(endpoint)
    except OSError as error:
        _close(bound)
        why = (error.strerror or str(error)).lower()
        hint = "; end its user, or choose another" if error.errno == EADDRINUSE else ""
        raise InputError(f"{address}: cannot listen at port {port}: {why}{hint}") from None
    return bound

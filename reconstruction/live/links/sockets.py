"""TCP, to an address or from whoever calls, and UDP."""

import select
import socket
from contextlib import suppress
from errno import EADDRINUSE

from ...errors import InputError
from .link import PIECE_BYTES, Outlet, Source

PATIENCE_S = 1.0
"""For a connection to come about."""
DATAGRAM_BYTES = 1200
"""What passes every path in one piece: the 1280 bytes of IPv6 (RFC 8200, section 5), less headers.
"""


class Tcp(Source, Outlet):
    """Connects to a place."""

    def __init__(self, address: str, host: str, port: int) -> None:
        super().__init__(address)
        self._place = (host, port)
        self._socket: socket.socket | None = None

    def open(self) -> None:
        _close(self._socket)
        self._take(socket.create_connection(self._place, PATIENCE_S))

    def receive(self, timeout_s: float) -> bytes:
        content = _received(_required(self._socket), timeout_s)
        if content == b"":
            raise ConnectionResetError("the other side has closed the connection")
        return content or b""

    def send(self, content: bytes) -> None:
        _required(self._socket).sendall(content)

    def close(self) -> None:
        _close(self._socket)
        self._socket = None

    def _take(self, connected: socket.socket) -> None:
        connected.settimeout(None)
        connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket = connected


class TcpListen(Tcp):
    """Waits to be called, by one at a time."""

    def __init__(self, address: str, host: str, port: int) -> None:
        super().__init__(address, host, port)
        self._listener: socket.socket | None = None

    @property
    def port(self) -> int:
        """The port that is listened at, which the system chooses for port 0."""
        return int(_required(self._listener).getsockname()[1])

    def check(self) -> None:
        if self._listener is None:
            self._listener = _bound(self.address, *self._place, socket.SOCK_STREAM)
            self._listener.listen()

    def open(self) -> None:
        _close(self._socket)
        self.check()
        listener = _required(self._listener)
        listener.settimeout(PATIENCE_S)
        try:
            self._take(listener.accept()[0])
        except TimeoutError:
            raise TimeoutError("nobody has called yet") from None

    def close(self) -> None:
        super().close()
        _close(self._listener)
        self._listener = None


class UdpListen(Source):
    """Datagrams that come to a port."""

    def __init__(self, address: str, host: str, port: int) -> None:
        super().__init__(address)
        self._place = (host, port)
        self._socket: socket.socket | None = None

    @property
    def port(self) -> int:
        """The port that is listened at, which the system chooses for port 0."""
        return int(_required(self._socket).getsockname()[1])

    def check(self) -> None:
        if self._socket is None:
            self._socket = _bound(self.address, *self._place, socket.SOCK_DGRAM)

    def open(self) -> None:
        self.check()

    def receive(self, timeout_s: float) -> bytes:
        return _received(_required(self._socket), timeout_s) or b""

    def close(self) -> None:
        _close(self._socket)
        self._socket = None


class Udp(Outlet):
    """Datagrams to a place, whether anybody listens there or not."""

    def __init__(self, address: str, host: str, port: int) -> None:
        super().__init__(address)
        self._place = (host, port)
        self._socket: socket.socket | None = None

    def open(self) -> None:
        self.close()
        family, kind, _, _, place = socket.getaddrinfo(*self._place, type=socket.SOCK_DGRAM)[0]
        self._socket = socket.socket(family, kind)
        self._socket.connect(place)

    def send(self, content: bytes) -> None:
        connected = _required(self._socket)
        for at in range(0, len(content), DATAGRAM_BYTES):
            with suppress(ConnectionRefusedError):
                connected.send(content[at : at + DATAGRAM_BYTES])

    def close(self) -> None:
        _close(self._socket)
        self._socket = None


def _received(connected: socket.socket, timeout_s: float) -> bytes | None:
    """What has come, None if nothing has for so long.

    Another thread may send meanwhile: a timeout of the socket would be that of both.
    """
    try:
        ready = select.select([connected], [], [], timeout_s)[0]
    except ValueError:
        raise ConnectionResetError("the connection is closed") from None
    return connected.recv(PIECE_BYTES) if ready else None


def _required(opened: socket.socket | None) -> socket.socket:
    if opened is None:
        raise ConnectionResetError("the connection is closed")
    return opened


def _close(opened: socket.socket | None) -> None:
    if opened is not None:
        with suppress(OSError):
            opened.shutdown(socket.SHUT_RDWR)  # wakes whoever waits
        opened.close()


def _bound(address: str, host: str, port: int, kind: socket.SocketKind) -> socket.socket:
    """A socket that is bound; InputError where it cannot be."""
    bound: socket.socket | None = None
    try:
        family, _, _, _, place = socket.getaddrinfo(
            host or None, port, socket.AF_UNSPEC if host else socket.AF_INET, kind,
            flags=socket.AI_PASSIVE,
        )[0]  # fmt: skip
        bound = socket.socket(family, kind)
        if kind is socket.SOCK_STREAM:
            bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.bind(place)
    except OSError as error:
        _close(bound)
        why = (error.strerror or str(error)).lower()
        hint = "; end what uses it, or name another" if error.errno == EADDRINUSE else ""
        raise InputError(f"{address}: cannot listen at port {port}: {why}{hint}") from None
    return bound

"""Links: bytes go through, a broken one opens again, and what is in the way is named."""

import os
import socket
import sys
import threading
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from reconstruction import InputError, write_capture
from spisim_live import CaptureSource, Parser
from spisim_live.links import Ended, outlet_to, source_at
from spisim_live.links import serial_port as serial_module
from spisim_live.links.sockets import DATAGRAM_BYTES, TcpListen, UdpListen
from streams import Clock, film, messages

SAFETY_S = 60.0


def all_of(source, size):
    content = b""
    while len(content) < size:
        content += source.receive(SAFETY_S)
    return content


@pytest.fixture
def listening():
    source = source_at("tcp-listen://127.0.0.1:0")
    source.check()
    yield source
    source.close()


def calling(port):
    outlet = outlet_to(f"tcp://127.0.0.1:{port}")
    outlet.open()
    return outlet


def test_tcp_carries_bytes_and_its_end_is_a_break_that_can_be_mended(listening):
    outlet = calling(listening.port)
    listening.open()
    sending = threading.Thread(target=outlet.send, args=(b"x" * 300_000,))
    sending.start()
    assert all_of(listening, 300_000) == b"x" * 300_000
    sending.join(SAFETY_S)
    outlet.close()
    with pytest.raises(ConnectionError, match="closed"):
        listening.receive(SAFETY_S)
    again = calling(listening.port)
    listening.open()
    again.send(b"again")
    assert all_of(listening, 5) == b"again"
    assert listening.receive(0) == b""
    again.close()


def test_a_close_wakes_who_waits_for_a_stalled_reader(listening):
    outlet = calling(listening.port)
    listening.open()
    failed = threading.Event()

    def send():
        try:
            while True:
                outlet.send(b"x" * 2**20)
        except OSError:
            failed.set()

    sending = threading.Thread(target=send)
    sending.start()
    assert listening.receive(SAFETY_S)  # it has begun
    outlet.close()
    assert failed.wait(SAFETY_S)
    sending.join(SAFETY_S)


def test_who_takes_nothing_is_gone(listening, monkeypatch):
    """Or else it would have the only place for ever."""
    monkeypatch.setattr("spisim_live.links.sockets.STALLED_S", 0.1)
    stalled = calling(listening.port)
    listening.open()
    assert not listening.wanted
    with pytest.raises(TimeoutError, match=r"has read nothing for 0\.1 s"):
        listening.send(b"x" * 2**24)
    other = calling(listening.port)
    assert listening.wanted
    listening.open()
    other.send(b"here")
    assert all_of(listening, 4) == b"here"
    assert listening.sender.startswith("127.0.0.1:")
    for each in (stalled, other):
        each.close()


def test_a_machine_that_vanishes_is_noticed(listening):
    outlet = calling(listening.port)
    listening.open()
    for each in (outlet._socket, listening._socket):
        assert each.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
    outlet.close()


def test_a_port_in_use_is_told(listening):
    other = TcpListen("tcp-listen://127.0.0.1:7", "127.0.0.1", listening.port)
    with pytest.raises(InputError, match=r"cannot listen at port .* in use; end its user"):
        other.check()
    first = UdpListen("udp://", "127.0.0.1", 0)
    first.check()
    with pytest.raises(InputError, match="cannot listen at port"):
        UdpListen("udp://", "127.0.0.1", first.port).check()
    first.close()


def test_nobody_who_listens_is_a_break(listening):
    port = listening.port
    listening.close()
    with pytest.raises(OSError, match="refused"):
        calling(port)


def test_udp_carries_messages_in_pieces(capture):
    source = source_at("udp://127.0.0.1:0")
    source.check()
    source.open()
    outlet = outlet_to(f"udp://127.0.0.1:{source.port}")
    outlet.open()
    content = messages(film(capture, 2))
    assert len(content[0]) > 2 * DATAGRAM_BYTES
    parser = Parser()
    result = []
    for each in content:
        outlet.send(each)
        got = 0
        while got < len(each):
            piece = source.receive(SAFETY_S)
            got += len(piece)
            result += parser.feed(piece)
    assert [each.kind for each in result] == [1, 2, 2, 3]
    assert source.sender == f"127.0.0.1:{outlet._socket.getsockname()[1]}"
    source.close()
    outlet.close()


def test_a_pipe_ends_where_it_ends(monkeypatch):
    reading, writing = os.pipe()
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(fileno=lambda: reading))
    source = source_at("-")
    source.open()
    assert source.receive(0) == b""
    os.write(writing, b"abc")
    assert source.receive(SAFETY_S) == b"abc"
    os.close(writing)
    with pytest.raises(Ended):
        source.receive(SAFETY_S)
    os.close(reading)


def test_a_file_ends_or_is_followed(tmp_path):
    path = tmp_path / "flight.stream"
    with pytest.raises(InputError, match="no such stream or capture file"):
        source_at(str(path)).check()
    outlet = outlet_to(str(path))
    outlet.open()
    outlet.send(b"abc")
    once, followed = source_at(str(path)), source_at(str(path), followed=True)
    for source in (once, followed):
        source.open()
        assert source.receive(0) == b"abc"
    with pytest.raises(Ended):
        once.receive(0)
    assert followed.receive(0) == b""
    outlet.send(b"def")
    assert followed.receive(0) == b"def"
    for link in (once, followed, outlet):
        link.close()


def test_a_capture_is_a_stream_and_may_grow(capture, tmp_path):
    path = tmp_path / "flight.h5"
    long = film(capture, 5)

    def write(frames):
        write_capture(film_of(long, frames), path)

    write(2)
    source = CaptureSource(path, followed=True, wait=Clock().wait)
    source.check()
    source.open()
    text = b"".join(source.receive(0) for _ in range(3))
    assert source.receive(0) == b""
    write(5)
    text += b"".join(source.receive(0) for _ in range(3))
    assert source.receive(0) == b""
    result = Parser().feed(text)
    assert [(each.kind, each.number) for each in result] == [(1, 0), *((2, n) for n in range(5))]
    sent = [each for each in Parser().feed(b"".join(messages(long))) if each.kind == 2]
    assert [each.payload for each in result[1:]] == [each.payload for each in sent]
    write(1)
    with pytest.raises(InputError, match="has become shorter"):
        source.receive(0)
    once = CaptureSource(path, followed=False, wait=Clock().wait)
    once.open()
    assert once.receive(0)
    assert once.receive(0)
    with pytest.raises(Ended):
        once.receive(0)


def film_of(capture, frames):
    readings = capture.batch(0, frames)
    return replace(capture, buckets=readings.buckets, spots=readings.spots)


class Port:
    """What pySerial gives."""

    def __init__(self, device, baud):
        self.device, self.baud = device, baud
        self.content = b"abcdef"
        self.sent = b""

    in_waiting = property(lambda self: len(self.content))

    def read(self, size):
        taken, self.content = self.content[:size], self.content[size:]
        return taken

    def write(self, content):
        self.sent += content

    def close(self):
        self.content = b""


@pytest.fixture
def device(tmp_path):
    path = tmp_path / "ttyUSB0"
    path.touch()
    return path


def test_a_serial_port_carries_bytes(device, monkeypatch):
    monkeypatch.setitem(sys.modules, "serial", SimpleNamespace(Serial=Port))
    link = source_at(f"serial://{device}?baud=115200")
    link.check()
    link.open()
    assert (link._port.device, link._port.baud) == (str(device), 115_200)
    assert link.receive(0.05) == b"abcdef"
    assert link.receive(0.05) == b""
    link.send(b"xyz")
    assert link._port.sent == b"xyz"
    link.close()
    with pytest.raises(OSError, match="closed"):
        link.receive(0)


def test_what_is_in_the_way_of_a_serial_port_is_told(device, monkeypatch):
    link = source_at(f"serial://{device}")
    monkeypatch.setitem(sys.modules, "serial", None)
    with pytest.raises(InputError, match=r"serial ports need pySerial: pip install"):
        link.check()
    monkeypatch.setitem(sys.modules, "serial", SimpleNamespace(Serial=Port))
    monkeypatch.setattr(serial_module.os, "access", lambda *_: False)
    device.chmod(0o660)
    monkeypatch.setattr(serial_module, "_group", lambda device: "dialout")
    with pytest.raises(InputError, match=f"no permission for {device}: join its group with sudo"):
        link.check()
    device.chmod(0o600)
    with pytest.raises(InputError, match=r"its group dialout has no access: sudo chmod a\+rw"):
        link.check()
    device.unlink()
    monkeypatch.setattr(serial_module, "_ports", lambda: [Path("/dev/ttyACM3")])
    with pytest.raises(InputError, match=r"no such device .*ttyUSB0; available: /dev/ttyACM3"):
        link.check()


def test_hosts_may_be_of_either_kind():
    assert source_at("tcp://[::1]:5800")._endpoint == ("::1", 5800)
    assert source_at("tcp-listen://:5800")._endpoint == ("", 5800)
    with socket.socket(socket.AF_INET) as taken:
        taken.bind(("", 0))
        with pytest.raises(InputError, match="in use"):
            source_at(f"tcp-listen://:{taken.getsockname()[1]}").check()

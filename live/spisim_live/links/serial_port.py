"""Serial ports, with pySerial."""

import os
import stat
from pathlib import Path
from typing import Any

from reconstruction.base.errors import InputError

from .link import PIECE_BYTES, Outlet, Source


class SerialPort(Source, Outlet):
    """A serial device such as /dev/ttyUSB0: 8 bits, no parity, 1 stop bit."""

    def __init__(self, address: str, device: str, baud: int) -> None:
        super().__init__(address)
        self._device = device
        self._baud = baud
        self._port: Any = None

    def check(self) -> None:
        _library()
        device = Path(self._device)
        if not device.exists():
            ports = ", ".join(map(str, _ports())) or "none"
            raise InputError(f"{self.address}: no such device {device}; available: {ports}")
        if not os.access(device, os.R_OK | os.W_OK):
            raise InputError(f"{self.address}: no permission for {device}: {_remedy(device)}")

    def open(self) -> None:
        self.close()
        self._port = _library().Serial(self._device, self._baud)

    def receive(self, timeout_s: float) -> bytes:
        port = self._required
        port.timeout = timeout_s
        return bytes(port.read(min(max(port.in_waiting, 1), PIECE_BYTES)))

    def send(self, content: bytes) -> None:
        self._required.write(content)

    def close(self) -> None:
        if self._port is not None:
            self._port.close()
            self._port = None

    @property
    def _required(self) -> Any:
        if self._port is None:
            raise ConnectionResetError("the port is closed")
        return self._port


def _library() -> Any:
    try:
        import serial
    except ModuleNotFoundError:
        raise InputError(
            "serial ports need pySerial: pip install './reconstruction[serial]'"
        ) from None
    return serial


def _ports() -> list[Path]:
    names = ("ttyUSB*", "ttyACM*", "ttyAMA*", "tty.usb*", "cu.usb*")
    return sorted(port for name in names for port in Path("/dev").glob(name))


def _remedy(device: Path) -> str:
    """How to get access: by joining its group, unless the group is root or has no access."""
    group, allowed = _group(device), stat.S_IRGRP | stat.S_IWGRP
    if group == "root" or device.stat().st_mode & allowed != allowed:
        return f"its group {group} has no access: sudo chmod a+rw {device}, or a udev rule"
    return f"join its group with sudo usermod -aG {group} $USER, and log in again"


def _group(device: Path) -> str:
    try:
        return device.group()
    except KeyError:
        return "dialout"

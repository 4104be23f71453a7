"""Linear pictures at 1550 nm: the red channel of OpenEXR and Radiance RGBE (.hdr) files.

RGBE: https://radsite.lbl.gov/radiance/refer/filefmts.pdf
"""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from reconstruction.base.errors import InputError

#: Names of the red or grey channel; the first one present is read.
RED = ("R", "r", "red", "Y", "L")
MAX_PIXELS = 2**26
MAGIC = (b"#?RADIANCE", b"#?RGBE")
#: Widths of run-length encoded rows.
PACKED = (8, 32767)
#: A count byte above this repeats the next byte (count - REPEAT) times.
REPEAT = 128


def read_exr_red(path: Path) -> NDArray[np.float32]:
    """Linear red or grey (h, w), with 0 for non-finite pixels; InputError if it cannot be read."""
    try:
        with OpenEXR.File(str(path), separate_channels=True, header_only=True) as file:
            low, high = file.header()["dataWindow"]
        if int(np.prod(np.subtract(high, low) + 1.0)) > MAX_PIXELS:
            raise InputError(f"{path.name}: at most {MAX_PIXELS:,} pixels are read")
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels = file.channels()
            name = next((each for each in RED if each in channels), next(iter(channels)))
            red = np.array(channels[name].pixels, dtype=np.float32)
    except InputError:
        raise
    except Exception:  # the library raises exceptions of many kinds
        raise InputError(f"{path.name}: cannot be read as OpenEXR") from None
    if red.ndim != 2 or not red.size:
        raise InputError(f"{path.name}: holds no single-channel or RGB picture")
    return np.where(np.isfinite(red), red, 0).astype(np.float32)


def read_hdr_red(path: Path) -> NDArray[np.float32]:
    """Linear red (h, w), top row first; InputError if the file cannot be read."""
    data = path.read_bytes()
    head, gap, rest = data.partition(b"\n\n")
    size = re.match(rb"-Y (\d{1,7}) \+X (\d{1,7})\n", rest)
    if not data.startswith(MAGIC) or not gap or size is None:
        raise InputError(f"{path.name}: cannot be read as Radiance HDR with its top row first")
    if b"xyze" in head:
        raise InputError(f"{path.name}: holds XYZ colours, which are not read: save it as RGBE")
    height, width = int(size[1]), int(size[2])
    if not 0 < height * width <= MAX_PIXELS:
        raise InputError(f"{path.name}: {width} × {height} pixels; at most {MAX_PIXELS:,} are read")
    rgbe = _rows(rest[size.end() :], height, width, path)
    scale = np.ldexp(np.float32(1), rgbe[:, 3].astype(int) - 136)
    return np.where(rgbe[:, 3] > 0, rgbe[:, 0] * scale, 0).astype(np.float32)


def _rows(data: bytes, height: int, width: int, path: Path) -> NDArray[np.uint8]:
    """Red, green, blue and exponent (h, 4, w)."""
    mark = bytes((2, 2, width >> 8, width & 255))
    if not PACKED[0] <= width <= PACKED[1] or not data.startswith(mark):
        if len(data) < 4 * width * height:
            raise InputError(f"{path.name}: is truncated, or has an unsupported encoding")
        plain = np.frombuffer(data, np.uint8, 4 * width * height)
        return plain.reshape(height, width, 4).transpose(0, 2, 1)
    rows = np.empty((height, 4 * width), np.uint8)
    at = 0
    for row in rows:
        if data[at : at + 4] != mark:
            raise InputError(f"{path.name}: is truncated or damaged")
        at = _unpack(data, at + 4, row, width, path)
    return rows.reshape(height, 4, width)


def _unpack(data: bytes, at: int, row: NDArray[np.uint8], width: int, path: Path) -> int:
    """Decode one row (4 w,) from an offset on and return the offset of the next one."""
    filled = 0
    while filled < len(row):
        count = data[at] if at < len(data) else 0
        repeats = count > REPEAT
        count -= REPEAT if repeats else 0
        taken = 1 if repeats else count
        values = data[at + 1 : at + 1 + taken]
        within = filled % width + count <= width  # a run never crosses channels
        if not count or len(values) < taken or not within:
            raise InputError(f"{path.name}: is truncated or damaged")
        row[filled : filled + count] = np.frombuffer(values, np.uint8)
        filled += count
        at += 1 + taken
    return at


#: Linear red (h, w) of a file, by suffix.
LINEAR: dict[str, Callable[[Path], NDArray[np.float32]]] = {
    ".exr": read_exr_red,
    ".hdr": read_hdr_red,
}

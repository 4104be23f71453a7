"""PNG files (ISO/IEC 15948) of colours, without a library of pictures."""

import struct
import zlib

import numpy as np
from numpy.typing import NDArray

UP = 2
"""Filter of a row: what it differs by from the one above, which is nothing in enlarged pixels."""


def png(colours: NDArray[np.uint8], software: str) -> bytes:
    """The file of a picture (H, W, 3); ``software`` tells in it who made it."""
    height, width, _ = colours.shape
    rows = colours.reshape(height, -1)
    filtered = np.empty((height, 1 + 3 * width), np.uint8)
    filtered[:, 0] = UP
    filtered[0, 1:] = rows[0]
    filtered[1:, 1:] = rows[1:] - rows[:-1]  # modulo 256
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = (
        (b"IHDR", header),
        (b"tEXt", b"Software\0" + software.encode("latin-1")),
        (b"IDAT", zlib.compress(filtered.tobytes(), 6)),
        (b"IEND", b""),
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(*each) for each in chunks)


def _chunk(kind: bytes, content: bytes) -> bytes:
    checksum = zlib.crc32(kind + content)
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", checksum)

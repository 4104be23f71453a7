"""PNG files (ISO/IEC 15948) of colours and of 16-bit grey, without an image library."""

import struct
import zlib

import numpy as np
from numpy.typing import NDArray

UP = 2
"""Filter of a row: its difference from the row above, which is zero in enlarged pixels."""


def png(values: NDArray[np.uint8] | NDArray[np.uint16], software: str) -> bytes:
    """PNG file of colours (H, W, 3) of 8 bits or grey levels (H, W) of 16 bits, by ``software``."""
    height, width = values.shape[:2]
    depth, colour_type = (8, 2) if values.ndim == 3 else (16, 0)
    rows = values.astype(values.dtype.newbyteorder(">")).view(np.uint8).reshape(height, -1)
    filtered = np.empty((height, 1 + rows.shape[1]), np.uint8)
    filtered[:, 0] = UP
    filtered[0, 1:] = rows[0]
    filtered[1:, 1:] = rows[1:] - rows[:-1]  # modulo 256
    header = struct.pack(">IIBBBBB", width, height, depth, colour_type, 0, 0, 0)
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

"""Files as bad disks and broken transfers leave them."""

from collections.abc import Iterator

import numpy as np


def damaged(content: bytes, copies: int) -> Iterator[bytes]:
    """Copies of a file in each of which 1 to 20 bits behind the signature are flipped."""
    for seed in range(copies):
        rng = np.random.default_rng(seed)
        copy = bytearray(content)
        for position in rng.integers(8, len(copy), 1 + seed % 20):
            copy[position] ^= 1 << rng.integers(8)
        yield bytes(copy)


def refusals(path, read, error, copies=100) -> list[str]:
    """What `read` says about damaged copies of a file, all but those that it can still read."""
    content, messages = path.read_bytes(), []
    for copy in damaged(content, copies):
        path.write_bytes(copy)
        try:
            read(path)
        except error as refusal:
            messages.append(str(refusal))
    return messages

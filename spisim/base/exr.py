"""OpenEXR files."""

import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from reconstruction.base.files import mark, write_atomically


def write_exr(
    path: str | Path,
    kind: str,
    channels: Mapping[str, NDArray[np.floating]],
    attributes: Mapping[str, str] | None = None,
) -> None:
    """Write (H, W) channels as float32, with the `kind` of the file and text attributes.

    The file appears whole or not at all. Raises OSError where it cannot be written.
    """
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    maker = {"Software": mark(kind)}  # precedes all other names
    pixels = {name: np.ascontiguousarray(image, np.float32) for name, image in channels.items()}
    with tempfile.TemporaryDirectory() as folder:
        draft = Path(folder) / "draft.exr"  # OpenEXR writes to paths only
        OpenEXR.File(header | maker | dict(attributes or {}), pixels).write(str(draft))
        write_atomically(path, draft.read_bytes())

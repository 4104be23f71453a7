"""Pictures of linear light, by their suffix."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spisim.base.config.exr import read_exr_red
from spisim.base.config.hdr import read_hdr_red

#: Linear red (h, w) of a file, by suffix.
LINEAR: dict[str, Callable[[Path], NDArray[np.float32]]] = {
    ".exr": read_exr_red,
    ".hdr": read_hdr_red,
}

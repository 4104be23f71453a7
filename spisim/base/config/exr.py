"""Pictures in OpenEXR files, as far as 1550 nm asks: their red."""

from pathlib import Path

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from reconstruction.base.errors import InputError

#: Channels that tell red, the first that is there.
RED = ("R", "r", "red", "Y", "L")
MAX_PIXELS = 2**26


def read_exr_red(path: Path) -> NDArray[np.float32]:
    """Linear red, or grey, (h, w), as far as finite; InputError for what cannot be read."""
    try:
        with OpenEXR.File(str(path), separate_channels=True, header_only=True) as file:
            low, high = file.header()["dataWindow"]
        if int(np.prod(np.subtract(high, low) + 1.0)) > MAX_PIXELS:
            raise InputError(f"{path.name}: more than {MAX_PIXELS:,} pixels are not read")
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels = file.channels()
            name = next((each for each in RED if each in channels), next(iter(channels)))
            red = np.array(channels[name].pixels, dtype=np.float32)
    except InputError:
        raise
    except Exception:  # whatever the library runs into
        raise InputError(f"{path.name}: cannot be read as OpenEXR") from None
    if red.ndim != 2 or not red.size:
        raise InputError(f"{path.name}: holds no picture of one or three colours")
    return np.where(np.isfinite(red), red, 0).astype(np.float32)

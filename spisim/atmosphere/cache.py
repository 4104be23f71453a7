"""Mie results of custom size distributions, cached between runs."""

import hashlib
import io
import logging
import os
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TypeAlias

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from reconstruction.base.files import write_atomically

Arrays: TypeAlias = Mapping[str, Floats]

logger = logging.getLogger(__name__)


def cache_folder() -> Path:
    """Folder of the results: `SPISIM_CACHE`, or the user's cache folder."""
    if own := os.environ.get("SPISIM_CACHE"):
        return Path(own)
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "spisim"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "spisim"


def cached(key: str, make: Callable[[], Arrays]) -> Arrays:
    """What `make` returns, from the cache if possible; a damaged cache only costs time."""
    try:
        path = cache_folder() / f"mie-{hashlib.sha256(key.encode()).hexdigest()[:24]}.npz"
    except RuntimeError:  # no home folder
        return make()
    # Results from a damaged file are computed again.
    with suppress(Exception), path.open("rb") as opened, np.load(opened) as file:
        if str(file["key"]) == key:
            return {name: file[name] for name in file.files if name != "key"}
    began = time.perf_counter()
    made = make()
    logger.info("Mie theory of custom droplets: %.1f s", time.perf_counter() - began)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, key=np.array(key), **dict(made))
    with suppress(OSError, InputError):
        write_atomically(path, buffer.getvalue())
    return made

"""Photon counts of a single-pixel camera with a mirror array, one NPY file a recording.

``DATE_SCENE_PATTERNS_EXPOSURE[_...].npy`` holds counts of each pattern and its complement in turn,
(K, 2) or (2K,), for all K = N rows of the Hadamard matrix of a square image in natural order, so
that the first pair is all on and all off. The exposure is in microseconds.
"""

import re
from pathlib import Path

import numpy as np

from reconstruction.base.errors import InputError, naming
from reconstruction.capture.importers import ProgramRecording, load_array
from reconstruction.operators import make_plan

NAME = re.compile(r"\d{6}_\d+_(?P<patterns>\d{1,8})_(?P<exposure_us>\d{1,9})(_\d+)*\.npy")
MAX_US = 10_000_000
"""Longer exposures of a single pattern are a mistaken unit."""


class PhotonCounts:
    """The files of this camera."""

    def recognises(self, path: Path) -> bool:
        """Whether a file is of this format, by its name."""
        return NAME.fullmatch(path.name) is not None

    def load(self, path: Path, band_nm: tuple[float, float] | None = None) -> ProgramRecording:
        """Load a file; raises InputError if it is invalid, or a band is asked for."""
        match = NAME.fullmatch(path.name)
        if match is None:
            raise InputError(f"{path}: not named DATE_SCENE_PATTERNS_EXPOSURE.npy")
        counts = load_array(path)
        with naming(path):
            if band_nm is not None:
                raise InputError("--band-nm: this camera counts photons of all wavelengths")
            patterns, exposure_us = int(match["patterns"]), int(match["exposure_us"])
            side = int(np.sqrt(patterns))
            if patterns < 4 or side * side != patterns or side & (side - 1):
                raise InputError(
                    f"named for {patterns} patterns, must be those of a square image whose side is "
                    "a power of two, such as 1024"
                )
            if not 1 <= exposure_us <= MAX_US:
                raise InputError(f"named for {exposure_us} us; allowed: 1 to {MAX_US}")
            if counts.shape not in ((patterns, 2), (2 * patterns,)):
                raise InputError(
                    f"holds counts of shape {counts.shape}, expected {(patterns, 2)} or "
                    f"{(2 * patterns,)}: a pattern and its complement in turn"
                )
            readings = counts.reshape(1, -1)
            if (readings < 0).any() or (readings != np.floor(readings)).any():
                raise InputError("holds values that are no counts: whole numbers from 0")
            if readings[0, 0] <= readings[0, 1]:
                raise InputError(
                    f"the first pair is {readings[0, 0]:g} and {readings[0, 1]:g}, must be all on "
                    "and all off"
                )
            plan = make_plan((side, side), order="natural", polarity="differential")
        about = {
            "electrons_per_count": 1.0,
            "noise_electrons": 0.0,
            "exposure_time_s": exposure_us * 1e-6,
            "pattern_period_s": exposure_us * 1e-6,
        }
        return ProgramRecording(readings, plan, about)


RECORDING = PhotonCounts()

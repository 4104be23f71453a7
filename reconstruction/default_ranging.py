"""Ranges by the default method, for callers who need nothing else of a frame."""

import hashlib
from contextlib import suppress
from functools import lru_cache

import numpy as np

from .base.errors import InputError
from .capture import Recording, Setup, datasets
from .chosen_methods import USUAL_IMAGES
from .ranging import Ranges
from .reconstructor import Reconstructor


def default_ranges(recording: Recording, frame: int = 0) -> Ranges | None:
    """Default ranges of one frame, equal to those of `reconstruct`; None if there are none."""
    setup = recording.setup
    try:
        return _ranging_alone(SetupKey(setup))(recording.batch(frame, frame + 1)).ranges
    except InputError:
        return None


class SetupKey:
    """A setup that equals others of the same content."""

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        digest = hashlib.sha256()
        for name, value, _ in datasets(setup.plans, setup):
            digest.update(f"{name} {np.shape(value)} ".encode())
            digest.update(value.encode() if isinstance(value, str) else np.asarray(value).tobytes())
        self._digest = digest.digest()

    def __hash__(self) -> int:
        return hash(self._digest)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, SetupKey) and self._digest == other._digest


@lru_cache(maxsize=2)
def _ranging_alone(key: SetupKey) -> Reconstructor:
    """Only the ranging, and the image that it uses."""
    for name in USUAL_IMAGES:
        with suppress(InputError):
            return Reconstructor(key.setup, image=name, depth=())
    return Reconstructor(key.setup, depth=())

"""Recordings of other programs, which packages add by entry points."""

from pathlib import Path
from typing import NamedTuple, Protocol

from ...base.arrays import Floats
from ...base.registry import Registry
from ...operators import PatternPlan
from ..spots import Spots


class ProgramRecording(NamedTuple):
    """Readings (frames, M), their plan, detector properties as in `ABOUT`, and spots, if any.

    A recording of spots alone has `NO_PATTERN`.
    """

    readings: Floats
    plan: PatternPlan
    about: dict[str, float]
    spots: Spots | None = None


class RecordingFormat(Protocol):
    """The files of a program."""

    def recognises(self, path: Path) -> bool:
        """Whether a file is of this format, by its name."""

    def load(self, path: Path, band_nm: tuple[float, float] | None = None) -> ProgramRecording:
        """Load a file, summed over a band of wavelengths if it has several, by default all.

        Raises InputError if a file is missing or invalid.
        """


RECORDINGS: Registry[RecordingFormat] = Registry(
    "format of recordings", attribute="RECORDING", group="reconstruction.recordings"
)


def program_of(path: Path) -> RecordingFormat | None:
    """Format of a file; None if no program is known to write such a file."""
    return next((form for _, form in RECORDINGS.loadable() if form.recognises(path)), None)

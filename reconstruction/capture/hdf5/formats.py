"""Format name and version of a file."""

from typing import NamedTuple

from ...base.errors import InputError

Version = tuple[int, int]

SEALED_SINCE = (3, 1)
"""First version whose files have a digest."""


class Format(NamedTuple):
    """A file format and its readable versions.

    ``kind`` is its name in messages, ``remedy`` the advice for files older than ``oldest``.
    """

    name: str
    kind: str
    oldest: Version
    version: Version
    remedy: str

    def checked_version(self, text: str) -> Version:
        """Parse the version of a file; raises InputError if it is not readable."""
        newest, oldest = dotted(self.version), dotted(self.oldest)
        try:
            major, minor = (int(number) for number in text.split("."))
        except ValueError:
            raise InputError(f"the format version {text!r} is not of the form {newest}") from None
        if (major, minor) > self.version:
            raise InputError(
                f"written in the newer format version {text}; this software reads up to {newest}: "
                "update it"
            )
        if (major, minor) < self.oldest:
            raise InputError(
                f"written in the older format version {text}; this software reads {oldest} to "
                f"{newest}: {self.remedy}"
            )
        return major, minor


def dotted(version: Version) -> str:
    """Format a version, as in ``3.1``."""
    return ".".join(map(str, version))

"""What a file says it is, and in which version."""

from typing import NamedTuple

from ...base.errors import InputError

Version = tuple[int, int]

SEALED_SINCE = (3, 1)
"""Files of this version and later have a digest."""


class Format(NamedTuple):
    """A format, and the versions of it that are read.

    ``kind`` is how messages call it, ``remedy`` what helps where a file is older than ``oldest``.
    """

    name: str
    kind: str
    oldest: Version
    version: Version
    remedy: str

    def checked_version(self, text: str) -> Version:
        """Version of a file, as it tells it; InputError if it is not read."""
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
    """As in ``3.1``."""
    return ".".join(map(str, version))

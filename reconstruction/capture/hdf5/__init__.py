"""Self-describing HDF5 files: a format name, a unit with every dataset, a digest of the content."""

from .formats import Format
from .opening import opened, surveyed
from .reading import Contents, Dataset, Readable, Tables
from .sizes import MAX_UNPACKED_BYTES, NUMBER_BYTES, check_sizes
from .writing import content, create, put, put_attribute, put_format, write_in_place

__all__ = [
    "MAX_UNPACKED_BYTES",
    "NUMBER_BYTES",
    "Contents",
    "Dataset",
    "Format",
    "Readable",
    "Tables",
    "check_sizes",
    "content",
    "create",
    "opened",
    "put",
    "put_attribute",
    "put_format",
    "surveyed",
    "write_in_place",
]

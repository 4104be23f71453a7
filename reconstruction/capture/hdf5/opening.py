"""Opening of untrusted files, surveyed and checked before anything is read."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py

from ...base.errors import InputError, naming
from .formats import SEALED_SINCE, Format
from .reading import Contents, undamaged
from .sealing import is_sealed
from .sizes import check_sizes
from .survey import survey


@contextmanager
def opened(path: str | Path, form: Format) -> Iterator[Contents]:
    """Open a file of a format.

    Raises InputError, which names the file, if its format, version or digest is wrong, it is too
    large, or as `survey` and `Contents` raise.
    """
    with naming(path):
        sealed = is_sealed(path)
        with surveyed(path) as (file, datasets):
            with undamaged():
                check_sizes(datasets, Path(path).stat().st_size)
            contents = Contents(file, datasets)
            _check_format(contents, form)
            version = contents.attribute("version")
            contents.version = form.checked_version(version)
            if contents.version >= SEALED_SINCE and not sealed:
                raise InputError(
                    f"written in format version {version}, but without its digest: damaged, or "
                    "changed since"
                )
            yield contents


@contextmanager
def surveyed(path: str | Path) -> Iterator[tuple[h5py.File, dict[str, h5py.Dataset]]]:
    """Open any HDF5 file with its datasets by path; raises InputError as `survey`."""
    with undamaged():
        file = h5py.File(path, "r")
    try:
        with undamaged():
            datasets = survey(file)
        yield file, datasets
    finally:
        with undamaged():
            file.close()


def _check_format(contents: Contents, form: Format) -> None:
    if not contents.has_attribute("format"):
        raise InputError(f"an HDF5 file, but not a {form.kind} (attribute 'format' is missing)")
    text = contents.attribute("format")
    if text != form.name:
        raise InputError(
            f"an HDF5 file, but not a {form.kind} (attribute 'format' is {text!r}, not "
            f"{form.name!r})"
        )

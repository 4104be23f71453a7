"""The manifest of a data set: an SQLite file with one row per attempted sample.

Only the process that runs the data set writes it; it can be read at any time.
"""

import errno
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any, Self

from reconstruction.base.errors import InputError
from reconstruction.base.files import write_atomically
from spisim.dataset.database import check_file, check_tables
from spisim.dataset.folder import SIDECARS, Layout
from spisim.dataset.records import (
    DIED,
    INSERT,
    SCHEMA,
    SCHEMA_VERSION,
    SELECT,
    Outcome,
    Record,
    meta_of,
    record_of,
    row_of,
    values_of,
)

#: Time to wait for a reader that locks the file.
PATIENCE_S = 60.0
DAMAGED = "not a manifest of this version, or damaged"
#: Attempts at a sample that kills its worker, unless more are asked for.
MAX_DEATHS = 2


class DamagedManifest(InputError):
    """The file is not a usable manifest; it can be rebuilt."""


class Manifest:
    """An open manifest, used as a context manager. Failure to write it raises OSError."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._connection = sqlite3.connect(path, timeout=PATIENCE_S)

    @classmethod
    def create(cls, path: Path, meta: Mapping[str, str]) -> Self:
        """Create a manifest with this content of the table `meta`, besides the schema version.

        The file appears whole or not at all.
        """
        with closing(sqlite3.connect(":memory:")) as connection:
            connection.executescript(SCHEMA)
            _put_meta(connection, {"schema_version": str(SCHEMA_VERSION), **meta})
            connection.commit()
            write_atomically(path, connection.serialize())
        return cls(path)

    @classmethod
    def open(cls, path: Path) -> Self:
        """Open an existing manifest. Raises DamagedManifest if it is not usable."""
        try:
            check_file(path)
            manifest = cls(path)
        except ValueError as error:
            raise DamagedManifest(f"{path}: {DAMAGED} ({error})") from None
        try:
            _content(manifest._connection)
        except (sqlite3.Error, ValueError) as error:
            manifest._connection.close()
            if getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_BUSY:
                raise InputError(f"{path}: locked by another program") from None
            raise DamagedManifest(f"{path}: {DAMAGED} ({error})") from None
        return manifest

    @contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        """A transaction."""
        try:
            with self._connection:
                yield self._connection
        except sqlite3.OperationalError as error:
            full = error.sqlite_errorcode == sqlite3.SQLITE_FULL
            number = errno.ENOSPC if full else errno.EIO
            raise OSError(number, str(error), str(self.path)) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self._connection.close()

    @property
    def meta(self) -> dict[str, str]:
        """Content of the table `meta`."""
        return meta_of(self._connection)

    def note(self, meta: Mapping[str, str]) -> None:
        """Replace some entries of the table `meta`."""
        with self._writing() as connection:
            _put_meta(connection, meta)

    def record(self, *outcomes: Outcome) -> None:
        """Replace the outcomes of samples, all or none, and count the attempts."""
        rows = [row_of(outcome, self.attempts(outcome.index) + 1) for outcome in outcomes]
        with self._writing() as connection:
            connection.executemany(INSERT, rows)

    def keep(self, *records: Record) -> None:
        """Add records of another manifest."""
        rows = [values_of(asdict(record)) for record in records]
        with self._writing() as connection:
            connection.executemany(INSERT, rows)

    def forget(self, index: int) -> None:
        """Remove the row of a sample."""
        with self._writing() as connection:
            connection.execute('DELETE FROM samples WHERE "index" = ?', (index,))

    def attempts(self, index: int) -> int:
        """Return the number of attempts at a sample."""
        query = 'SELECT attempts FROM samples WHERE "index" = ?'
        (count,) = self._connection.execute(query, (index,)).fetchone() or (0,)
        return int(count)

    def files(self) -> dict[int, dict[str, Mapping[str, Any]]]:
        """Return `bytes` and `sha256` of all files of finished samples, by index and path."""
        records = filter(lambda record: record.done, _records(self._connection))
        return {
            record.index: {
                str(record.file): {"bytes": record.bytes, "sha256": record.sha256},
                **record.sidecars,
            }
            for record in records
        }

    def indices(self) -> set[int]:
        """Return the indices of attempted samples."""
        return {index for (index,) in self._connection.execute('SELECT "index" FROM samples')}

    def counts(self) -> dict[str, int]:
        """Return the numbers of samples done and failed."""
        query = "SELECT status, COUNT(*) FROM samples GROUP BY status"
        return {"done": 0, "failed": 0, **dict(self._connection.execute(query))}

    def to_do(self, samples: int, *, failed_too: bool = False) -> list[int]:
        """Return indices below `samples` not attempted yet, or that may be attempted again."""
        query = (
            "SELECT \"index\" FROM samples WHERE status = 'done' OR NOT ?"
            " AND NOT (substr(error, 1, ?) = ? AND attempts < ?)"
        )
        arguments = (failed_too, len(DIED), DIED, MAX_DEATHS)
        settled = {index for (index,) in self._connection.execute(query, arguments)}
        return [index for index in range(samples) if index not in settled]

    def failures(self) -> dict[int, str]:
        """Return the reasons of failed samples by index."""
        query = 'SELECT "index", error FROM samples WHERE status = \'failed\' ORDER BY "index"'
        return dict(self._connection.execute(query))


def read_manifest(folder: Path) -> tuple[dict[str, str], tuple[Record, ...]]:
    """Read a manifest: the table `meta`, and the records of samples in order of their index.

    The file is not changed, because a run may be using it. Raises InputError if there is none, or
    it is damaged or of another version.
    """
    layout = Layout(folder)
    path = layout.own(layout.manifest)
    if not path.is_file():
        raise InputError(
            f"{folder}: not a data set ({path.name} is missing); "
            "`spisim dataset PLAN -o DIR` makes one"
        )
    try:
        check_file(path)
        address = f"{path.resolve().as_uri()}?mode=ro"
        with closing(sqlite3.connect(address, uri=True)) as database:
            return _content(database)
    except (sqlite3.Error, ValueError) as error:
        raise InputError(
            f"{path}: {DAMAGED} ({error}); run the plan again to rebuild it from the samples"
        ) from None


def _content(connection: sqlite3.Connection) -> tuple[dict[str, str], tuple[Record, ...]]:
    """Read a whole manifest. Raises sqlite3.Error or ValueError if it is invalid."""
    check_tables(connection, SCHEMA)
    meta = meta_of(connection)
    records = tuple(_records(connection))
    for record in records:
        if record.index >= int(meta["samples"]) or not _names_its_files(record):
            raise ValueError(f"the files of sample {record.index} are invalid")
    return meta, records


def _records(connection: sqlite3.Connection) -> Iterator[Record]:
    return map(record_of, connection.execute(f'{SELECT} ORDER BY "index"'))


def _names_its_files(record: Record) -> bool:
    """Return whether a record names only files that a run writes for its sample."""
    capture = Layout(Path()).capture(record.index)
    beside = {capture.with_suffix(suffix).as_posix() for suffix in SIDECARS}
    expected = capture.as_posix() if record.done else None
    return record.file == expected and record.sidecars.keys() <= (beside if record.done else set())


def _put_meta(connection: sqlite3.Connection, meta: Mapping[str, str]) -> None:
    connection.executemany("INSERT OR REPLACE INTO meta VALUES (?, ?)", meta.items())

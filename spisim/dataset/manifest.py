"""The manifest of a data set: one row for every sample that was tried, in an SQLite file.

Only the process that runs the data set writes it; anyone may read it meanwhile.
"""

import errno
import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Self

from reconstruction.errors import InputError
from spisim.dataset.folder import Layout
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
)

#: Seconds to wait for a reader that holds the file.
PATIENCE_S = 60.0
DAMAGED = "not a manifest of this version, or damaged"
#: Samples that took their worker with them are tried this often of their own accord.
MAX_DEATHS = 2


class DamagedManifest(InputError):
    """A file is no manifest, or none that this software knows; it can be made anew."""


class Manifest:
    """An open manifest. Use it as a context manager.

    Whatever keeps it from being written is an OSError.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._connection = sqlite3.connect(path, timeout=PATIENCE_S)

    @classmethod
    def create(cls, path: Path, meta: Mapping[str, str]) -> Self:
        """New manifest; `meta` as the columns of its table, besides the schema's version."""
        manifest = cls(path)
        with manifest._writing() as connection:
            connection.executescript(f"BEGIN; {SCHEMA}")
            _put_meta(connection, {"schema_version": str(SCHEMA_VERSION), **meta})
        return manifest

    @classmethod
    def open(cls, path: Path) -> Self:
        """Manifest that is there. Raises DamagedManifest where it is none that can be used."""
        manifest = cls(path)
        try:
            manifest._check()
        except (sqlite3.DatabaseError, ValueError, TypeError) as error:
            manifest._connection.close()
            if getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_BUSY:
                raise InputError(f"{path}: another program holds it for writing") from None
            raise DamagedManifest(f"{path}: {DAMAGED} ({error})") from None
        return manifest

    def _check(self) -> None:
        (state,) = self._connection.execute("PRAGMA quick_check(1)").fetchone()
        if state != "ok":
            raise ValueError(state)
        meta_of(self._connection)
        for row in self._connection.execute(SELECT):
            record_of(row)

    @contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        """A transaction: all of it or nothing."""
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
        """What is known of the data set as a whole."""
        return meta_of(self._connection)

    def note(self, meta: Mapping[str, str]) -> None:
        """Replace some of what is known of the data set as a whole."""
        with self._writing() as connection:
            _put_meta(connection, meta)

    def record(self, outcome: Outcome) -> None:
        """Put an outcome in place of the sample's last, and count the attempt."""
        row = row_of(outcome, self.attempts(outcome.index) + 1)
        with self._writing() as connection:
            connection.execute(INSERT, row)

    def forget(self, index: int) -> None:
        """Remove a sample's row."""
        with self._writing() as connection:
            connection.execute('DELETE FROM samples WHERE "index" = ?', (index,))

    def attempts(self, index: int) -> int:
        """How often a sample was tried."""
        query = 'SELECT attempts FROM samples WHERE "index" = ?'
        (count,) = self._connection.execute(query, (index,)).fetchone() or (0,)
        return int(count)

    def files(self) -> dict[int, dict[str, int]]:
        """Size of every file of every sample that is done, by index and path."""
        query = "SELECT \"index\", file, bytes, sidecars FROM samples WHERE status = 'done'"
        return {
            index: {file: size}
            | {name: told["bytes"] for name, told in json.loads(sidecars).items()}
            for index, file, size, sidecars in self._connection.execute(query)
        }

    def indices(self) -> set[int]:
        """Samples that were tried."""
        return {index for (index,) in self._connection.execute('SELECT "index" FROM samples')}

    def counts(self) -> dict[str, int]:
        """Number of samples done and failed."""
        query = "SELECT status, COUNT(*) FROM samples GROUP BY status"
        return {"done": 0, "failed": 0, **dict(self._connection.execute(query))}

    def to_do(self, samples: int, *, failed_too: bool = False) -> list[int]:
        """Indices below `samples` not tried yet, or that took their worker with them, but once."""
        query = (
            "SELECT \"index\" FROM samples WHERE status = 'done' OR NOT ?"
            " AND NOT (substr(error, 1, ?) = ? AND attempts < ?)"
        )
        arguments = (failed_too, len(DIED), DIED, MAX_DEATHS)
        settled = {index for (index,) in self._connection.execute(query, arguments)}
        return [index for index in range(samples) if index not in settled]

    def failures(self) -> dict[int, str]:
        """Reasons of the samples that failed, by index."""
        query = 'SELECT "index", error FROM samples WHERE status = \'failed\' ORDER BY "index"'
        return dict(self._connection.execute(query))


def read_manifest(folder: Path) -> tuple[dict[str, str], tuple[Record, ...]]:
    """What the manifest says of the data set, and of its samples in order of their index.

    It is left as it is: a run may be under way. Raises InputError where there is none, where it is
    damaged or of another version.
    """
    path = Layout(folder).manifest
    if not path.is_file():
        raise InputError(
            f"{folder}: no data set there ({path.name} is missing); "
            "spisim dataset PLAN -o DIR makes one"
        )
    try:
        address = f"{path.resolve().as_uri()}?mode=ro"
        with closing(sqlite3.connect(address, uri=True)) as database:
            meta = meta_of(database)
            rows = database.execute(f'{SELECT} ORDER BY "index"')
            return meta, tuple(map(record_of, rows))
    except (sqlite3.Error, ValueError, TypeError) as error:
        raise InputError(
            f"{path}: {DAMAGED} ({error}); run the plan again: it is then written anew from the "
            "samples"
        ) from None


def _put_meta(connection: sqlite3.Connection, meta: Mapping[str, str]) -> None:
    connection.executemany("INSERT OR REPLACE INTO meta VALUES (?, ?)", meta.items())

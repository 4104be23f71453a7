"""The manifest of a data set: one row for every sample that was tried, in an SQLite file.

Only the process that runs the data set writes it.
"""

from __future__ import annotations

import errno
import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, fields
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Self

from reconstruction.errors import InputError

SCHEMA_VERSION = 1
#: Seconds to wait for a reader that holds the file.
PATIENCE_S = 60.0
#: How the reason begins where a sample took its worker with it.
DIED = "worker "
#: Samples that took their worker with them are tried this often of their own accord.
MOST_DEATHS = 2

#: Status of an outcome that is no outcome yet: the sample waits for space. Never recorded.
NO_SPACE = "no space"

SCHEMA = """
CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE samples (
    "index" INTEGER PRIMARY KEY,
    status TEXT NOT NULL CHECK (status IN ('done', 'failed')),
    scene TEXT,
    parameters TEXT,
    file TEXT,
    bytes INTEGER,
    sha256 TEXT,
    sidecars TEXT,
    seconds REAL,
    stage_seconds TEXT,
    peak_memory_mb REAL,
    attempts INTEGER NOT NULL,
    error TEXT,
    finished TEXT,
    warnings TEXT
);
"""


@dataclass(frozen=True)
class Outcome:
    """How it went with one sample; plain values only, as they stand in the manifest.

    Paths are relative to the data set's folder. `sidecars` tells the size and SHA-256 of each file
    beside the capture. `peak_memory_mb` is the most that the process held so far.
    """

    index: int
    status: str  # done, failed or NO_SPACE
    scene: str | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)
    file: str | None = None
    bytes: int | None = None
    sha256: str | None = None
    sidecars: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    seconds: float | None = None
    stage_seconds: Mapping[str, float] = field(default_factory=dict)
    peak_memory_mb: float | None = None
    error: str | None = None
    warnings: tuple[str, ...] = ()

    @property
    def done(self) -> bool:
        """Whether its files are there."""
        return self.status == "done"


def failure(index: int, reason: str) -> Outcome:
    """Outcome of a sample of which nothing but the reason is known."""
    return Outcome(index, "failed", error=reason)


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
            problem = manifest._problem()
        except sqlite3.DatabaseError as error:
            manifest._connection.close()
            if error.sqlite_errorcode == sqlite3.SQLITE_BUSY:
                raise InputError(f"{path}: another program holds it for writing") from None
            raise DamagedManifest(f"{path}: not a manifest, or damaged ({error})") from None
        if problem:
            manifest._connection.close()
            raise DamagedManifest(f"{path}: not a manifest that this software knows ({problem})")
        return manifest

    def _problem(self) -> str | None:
        (state,) = self._connection.execute("PRAGMA quick_check(1)").fetchone()
        if state != "ok":
            return str(state)
        version = self.meta.get("schema_version", "unknown")
        if version != str(SCHEMA_VERSION):
            return f"schema version {version}, not {SCHEMA_VERSION}"
        # With their table, as SQLite takes an unknown quoted name alone for a string.
        columns = ", ".join(f"samples.{_quoted(name)}" for name in _COLUMNS)
        self._connection.execute(f"SELECT {columns} FROM samples LIMIT 1")
        return None

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
        return dict(self._connection.execute("SELECT key, value FROM meta"))

    def note(self, meta: Mapping[str, str]) -> None:
        """Replace some of what is known of the data set as a whole."""
        with self._writing() as connection:
            _put_meta(connection, meta)

    def record(self, outcome: Outcome) -> None:
        """Put an outcome in place of the sample's last, and count the attempt."""
        values = asdict(outcome)
        row = {name: _stored(values[name]) for name in values}
        row["finished"] = datetime.now(UTC).isoformat(timespec="seconds")
        row["attempts"] = self.attempts(outcome.index) + 1
        names, marks = ", ".join(map(_quoted, row)), ", ".join("?" * len(row))
        with self._writing() as connection:
            connection.execute(
                f"INSERT OR REPLACE INTO samples ({names}) VALUES ({marks})", list(row.values())
            )

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
        arguments = (failed_too, len(DIED), DIED, MOST_DEATHS)
        settled = {index for (index,) in self._connection.execute(query, arguments)}
        return [index for index in range(samples) if index not in settled]

    def failures(self) -> dict[int, str]:
        """Reasons of the samples that failed, by index."""
        query = 'SELECT "index", error FROM samples WHERE status = \'failed\' ORDER BY "index"'
        return dict(self._connection.execute(query))


_COLUMNS = (*(column.name for column in fields(Outcome)), "attempts", "finished")


def _put_meta(connection: sqlite3.Connection, meta: Mapping[str, str]) -> None:
    connection.executemany("INSERT OR REPLACE INTO meta VALUES (?, ?)", meta.items())


def _quoted(name: str) -> str:
    return f'"{name}"'


def _stored(value: Any) -> Any:
    """Mappings and lists are stored as JSON."""
    if isinstance(value, Mapping | list | tuple):
        return json.dumps(value, ensure_ascii=False)
    return value

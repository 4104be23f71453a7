"""Safe access to untrusted SQLite files."""

import sqlite3
from contextlib import closing
from functools import cache
from pathlib import Path

#: Suffixes of files that SQLite keeps beside a database.
COMPANIONS = ("-journal", "-wal", "-shm")
MAX_VALUE_BYTES = 2**23

_HEADER_BYTES = 100
_SIGNATURE = b"SQLite format 3\0"
_ROLLBACK = b"\1\1"  # file format versions with a rollback journal, not a write-ahead log
_END_OF_A_SUPER_JOURNAL = bytes.fromhex("d9d505f920a163d7")


def check_file(path: Path) -> None:
    """Raise ValueError unless a file is a database that does not affect other files.

    SQLite deletes the file that a journal names as its super-journal, wherever it is, and applies
    any log beside the database. A manifest has neither.
    """
    with path.open("rb") as file:
        header = file.read(_HEADER_BYTES)
    if len(header) < _HEADER_BYTES or not header.startswith(_SIGNATURE):
        raise ValueError("not an SQLite database")
    if header[18:20] != _ROLLBACK:
        raise ValueError("it uses a write-ahead log")
    journal, *logs = (path.with_name(path.name + ending) for ending in COMPANIONS)
    if any(log.exists() for log in logs):
        raise ValueError("a write-ahead log lies beside it")
    if journal.exists() and _names_another_file(journal):
        raise ValueError("its journal names another file")


def check_tables(connection: sqlite3.Connection, schema: str) -> None:
    """Raise ValueError unless the tables, indices, views and triggers are those of a schema.

    It reads none of them first. Raises sqlite3.Error if the file is damaged.
    """
    connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MAX_VALUE_BYTES)
    connection.execute("PRAGMA trusted_schema = OFF")
    if _tables(connection) != _tables_of(schema):
        raise ValueError("its tables are not those of a manifest")
    (state,) = connection.execute("PRAGMA quick_check(1)").fetchone()
    if state != "ok":
        raise ValueError(state)


def _tables(connection: sqlite3.Connection) -> list[tuple[str, str, str, str | None]]:
    query = "SELECT type, name, tbl_name, sql FROM sqlite_master ORDER BY name LIMIT 100"
    return connection.execute(query).fetchall()


@cache
def _tables_of(schema: str) -> list[tuple[str, str, str, str | None]]:
    with closing(sqlite3.connect(":memory:")) as connection:
        connection.executescript(schema)
        return _tables(connection)


def _names_another_file(journal: Path) -> bool:
    return journal.read_bytes()[-len(_END_OF_A_SUPER_JOURNAL) :] == _END_OF_A_SUPER_JOURNAL

"""SQLite files of anyone, of which nothing is carried out and nothing leads elsewhere."""

import sqlite3
from contextlib import closing
from functools import cache
from pathlib import Path

#: Files that SQLite keeps beside a database.
COMPANIONS = ("-journal", "-wal", "-shm")
#: Bytes that a value may have.
MAX_VALUE_BYTES = 2**23

_HEADER_BYTES = 100
_SIGNATURE = b"SQLite format 3\0"
_ROLLBACK = b"\1\1"  # versions of the file format that keep a journal, and no log beside it
_END_OF_A_SUPER_JOURNAL = bytes.fromhex("d9d505f920a163d7")


def check_file(path: Path) -> None:
    """ValueError for a file that is no database, or none that keeps to itself.

    SQLite removes the file that a journal names as its super-journal, wherever that lies, and takes
    up a log that it finds beside a database. A manifest has neither.
    """
    with path.open("rb") as file:
        header = file.read(_HEADER_BYTES)
    if len(header) < _HEADER_BYTES or not header.startswith(_SIGNATURE):
        raise ValueError("not an SQLite file")
    if header[18:20] != _ROLLBACK:
        raise ValueError("its write-ahead log is on")
    journal, *logs = (path.with_name(path.name + ending) for ending in COMPANIONS)
    if any(log.exists() for log in logs):
        raise ValueError("there is a write-ahead log beside it")
    if journal.exists() and _names_another_file(journal):
        raise ValueError("its journal names another file")


def check_tables(connection: sqlite3.Connection, schema: str) -> None:
    """ValueError where a database has other tables, indices, views or triggers than a schema makes.

    Nothing is read from any of them before. sqlite3.Error where the file is damaged.
    """
    connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MAX_VALUE_BYTES)
    connection.execute("PRAGMA trusted_schema = OFF")
    if _tables(connection) != _tables_of(schema):
        raise ValueError("other tables than a manifest has")
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

"""What the manifest of a data set says, read without changing it: a run may be under way."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from reconstruction.errors import InputError, naming
from spisim.dataset.folder import Layout
from spisim.dataset.manifest import SCHEMA_VERSION, Outcome

#: Columns that hold JSON.
_JSON = {"parameters": "{}", "sidecars": "{}", "stage_seconds": "{}", "warnings": "[]"}


@dataclass(frozen=True)
class Record(Outcome):
    """One row of the manifest: how it went with a sample, after how many attempts, and when.

    `parameters` are flat: a drawn section's fields have the names that they have in a plan.
    """

    attempts: int = 0
    finished: str | None = None


def read_manifest(folder: Path) -> tuple[dict[str, str], tuple[Record, ...]]:
    """What the manifest says of the data set, and of its samples in order of their index.

    Raises InputError where there is none, where it is damaged or of another version.
    """
    path = Layout(folder).manifest
    if not path.is_file():
        raise InputError(
            f"{folder}: no data set there ({path.name} is missing); "
            "spisim dataset PLAN -o DIR makes one"
        )
    # With their table, as SQLite takes an unknown quoted name alone for a string.
    names = ", ".join(f'samples."{field.name}"' for field in fields(Record))
    try:
        with naming(path), closing(_opened(path)) as database:
            meta = {str(key): str(value) for key, value in database.execute("SELECT * FROM meta")}
            _check_version(meta.get("schema_version"))
            rows = database.execute(f'SELECT {names} FROM samples ORDER BY "index"')
            return meta, tuple(_record(row) for row in rows)
    except (sqlite3.Error, ValueError, TypeError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"{path}: not a manifest, or damaged ({error}); run the plan again: it is then "
            "written anew from the samples"
        ) from None


def _opened(path: Path) -> sqlite3.Connection:
    return sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)


def _check_version(found: str | None) -> None:
    if found != str(SCHEMA_VERSION):
        raise InputError(f"schema_version is {found}; this software reads {SCHEMA_VERSION}")


def _record(row: tuple[Any, ...]) -> Record:
    values = dict(zip((field.name for field in fields(Record)), row, strict=True))
    for name, nothing in _JSON.items():
        values[name] = json.loads(values[name] or nothing)
    values["parameters"] = dict(flat(values["parameters"]))
    return Record(**values)


def flat(values: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Values and the names that they have in a plan, through all sections."""
    for name, value in values.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value

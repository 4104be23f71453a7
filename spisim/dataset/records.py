"""The contents of a manifest: its tables, their version, and the records in their rows."""

import json
import sqlite3
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, fields
from datetime import UTC, datetime
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from spisim.base.config.messages import show
from spisim.base.config.yaml import MAX_DIGITS

SCHEMA_VERSION = 1
#: Prefix of the reason when a sample killed its worker.
DIED = "worker "
#: Stage of a sample in which it compiled kernels that were not yet cached on disk.
COMPILING = "compile"
#: Stage of a sample in which it traced light for others of its series.
SHARED = "light of others"
#: Status of a sample that waits for disk space. It is never recorded.
NO_SPACE = "no space"
#: Limit on the length of a value in the table `meta`.
_MAX_CHARACTERS = 2000
_NO_RUN_BEFORE = datetime(2000, 1, 1, tzinfo=UTC)

#: Keys of the table `meta`, besides the schema version.
META = ("plan_digest", "name", "samples", "created", "software", "files")
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
    """What happened to one sample, in plain values as the manifest stores them.

    Paths are relative to the data set's folder. `sidecars` maps each file beside the capture to its
    size and SHA-256. `peak_memory_mb` is the peak memory of the process during this sample on
    Linux, and since its start elsewhere.
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
        """Whether the sample's files were written."""
        return self.status == "done"

    @property
    def compiling_s(self) -> float:
        """Seconds spent compiling kernels, which later samples of this kind reuse."""
        return self.stage_seconds.get(COMPILING, 0.0)

    @property
    def own_s(self) -> float:
        """Seconds for this sample, without compiling and the light of others."""
        return (self.seconds or 0.0) - self.compiling_s - self.stage_seconds.get(SHARED, 0.0)


@dataclass(frozen=True)
class Record(Outcome):
    """One row of the manifest: the outcome, the number of attempts, and when the last one finished.

    `parameters` are flat: fields of a drawn section have the dotted names used in a plan.
    """

    attempts: int = 0
    finished: str | None = None


def failure(index: int, reason: str) -> Outcome:
    """Return the outcome of a sample that failed for this reason."""
    return Outcome(index, "failed", error=reason)


_Size = Annotated[int, Field(ge=0)]
_Sha256 = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]


def _is_a_time(text: str) -> str:
    when = datetime.fromisoformat(text)
    if when.tzinfo is None or when < _NO_RUN_BEFORE:
        raise ValueError
    return text


class _Sidecar(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid")

    bytes: _Size
    sha256: _Sha256


class _Row(BaseModel):
    """Validates a row."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False)

    index: _Size
    status: Literal["done", "failed"]
    scene: str | None
    parameters: dict[str, Any]
    file: str | None
    bytes: _Size | None
    sha256: _Sha256 | None
    sidecars: dict[str, _Sidecar]
    seconds: float | None
    stage_seconds: dict[str, float]
    peak_memory_mb: float | None
    attempts: _Size
    error: str | None
    finished: Annotated[str, AfterValidator(_is_a_time)] | None
    warnings: list[str]

    @model_validator(mode="after")
    def _names_its_file(self) -> Self:
        if self.status == "done" and None in (self.file, self.bytes, self.sha256):
            raise ValueError
        return self


#: JSON columns and their empty values.
_JSON = {"parameters": "{}", "sidecars": "{}", "stage_seconds": "{}", "warnings": "[]"}
_COLUMNS = tuple(column.name for column in fields(Record))
# Qualified by the table: SQLite reads an unknown quoted name as a string.
SELECT = "SELECT " + ", ".join(f'samples."{name}"' for name in _COLUMNS) + " FROM samples"
INSERT = (
    "INSERT OR REPLACE INTO samples ("
    + ", ".join(f'"{name}"' for name in _COLUMNS)
    + f") VALUES ({', '.join('?' * len(_COLUMNS))})"
)


def meta_of(connection: sqlite3.Connection) -> dict[str, str]:
    """Read the table `meta`.

    Raises ValueError for another schema version and for missing or impossible values.
    """
    meta = {str(key): str(value) for key, value in connection.execute("SELECT * FROM meta")}
    if any(len(value) > _MAX_CHARACTERS for key, value in meta.items() if key != "files"):
        raise ValueError(f"meta: values should have at most {_MAX_CHARACTERS} characters")
    version = meta.get("schema_version", "unknown")
    if version != str(SCHEMA_VERSION):
        raise ValueError(f"schema_version is {version}; this software reads {SCHEMA_VERSION}")
    for key in META:
        if key not in meta:
            raise ValueError(f"{key} is missing")
    if not 0 < int(meta["samples"]) < 2**63 or not isinstance(_from_json(meta["files"]), dict):
        raise ValueError("meta: samples or files is invalid")
    return meta


def row_of(outcome: Outcome, attempts: int) -> tuple[Any, ...]:
    """Return the row of an outcome in the order of INSERT."""
    finished = datetime.now(UTC).isoformat(timespec="seconds")
    return values_of(asdict(outcome) | {"attempts": attempts, "finished": finished})


def values_of(values: Mapping[str, Any]) -> tuple[Any, ...]:
    """Return a record's fields in the order of INSERT."""
    return tuple(
        json.dumps(values[name], ensure_ascii=False) if name in _JSON else values[name]
        for name in _COLUMNS
    )


def record_of(row: tuple[Any, ...]) -> Record:
    """Return the record of a row in the order of SELECT. Raises ValueError for an invalid row."""
    values = dict(zip(_COLUMNS, row, strict=True))
    try:
        for name, empty in _JSON.items():
            values[name] = _from_json(empty if values[name] is None else values[name])
        values = _Row.model_validate(values).model_dump()
    except ValidationError as error:
        column = (*error.errors()[0]["loc"], "row")[0]
        raise ValueError(f"{column} of sample {show(row[0])} is invalid") from None
    values["parameters"] = dict(flat(values["parameters"]))
    return Record(**values | {"warnings": tuple(values["warnings"])})


def _from_json(text: str) -> Any:
    try:
        return json.loads(text, parse_int=_whole)
    except (TypeError, RecursionError):
        raise ValueError(f"{show(text)} is invalid") from None


def _whole(digits: str) -> int:
    if len(digits) > MAX_DIGITS:
        raise ValueError(f"a number of {len(digits)} digits")
    return int(digits)


def flat(values: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Flatten nested mappings: yield values with the dotted names used in a plan."""
    for name, value in values.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value

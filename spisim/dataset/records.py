"""What a manifest holds: its tables, their version, and what a row of them is."""

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
#: How the reason begins where a sample took its worker with it.
DIED = "worker "
#: Of the stages of a sample: how long it compiled kernels that were not on this machine's disk yet.
COMPILING = "compile"
#: Status of an outcome that is no outcome yet: the sample waits for space. Never recorded.
NO_SPACE = "no space"
#: Of a value that tells of the data set as a whole.
_MAX_CHARACTERS = 2000
_NO_RUN_BEFORE = datetime(2000, 1, 1, tzinfo=UTC)

#: What is told of the data set as a whole, besides the version.
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
    """How it went with one sample; plain values only, as they stand in the manifest.

    Paths are relative to the data set's folder. `sidecars` tells the size and SHA-256 of each file
    beside the capture. `peak_memory_mb` is the most that the process held meanwhile (on Linux;
    elsewhere, so far).
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

    @property
    def compiling_s(self) -> float:
        """Seconds of it that later samples of this kind do not take."""
        return self.stage_seconds.get(COMPILING, 0.0)


@dataclass(frozen=True)
class Record(Outcome):
    """One row of the manifest: how it went with a sample, after how many attempts, and when.

    `parameters` are flat: a drawn section's fields have the names that they have in a plan.
    """

    attempts: int = 0
    finished: str | None = None


def failure(index: int, reason: str) -> Outcome:
    """Outcome of a sample of which nothing but the reason is known."""
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
    """What runs put into a row."""

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
        reported = (self.file, self.bytes, self.sha256)
        if self.status == "done" and None in reported:
            raise ValueError
        return self


#: Columns that hold JSON.
_JSON = {"parameters": "{}", "sidecars": "{}", "stage_seconds": "{}", "warnings": "[]"}
_COLUMNS = tuple(column.name for column in fields(Record))
# With their table, as SQLite takes an unknown quoted name alone for a string.
SELECT = "SELECT " + ", ".join(f'samples."{name}"' for name in _COLUMNS) + " FROM samples"
INSERT = (
    "INSERT OR REPLACE INTO samples ("
    + ", ".join(f'"{name}"' for name in _COLUMNS)
    + f") VALUES ({', '.join('?' * len(_COLUMNS))})"
)


def meta_of(connection: sqlite3.Connection) -> dict[str, str]:
    """What a manifest says of the data set as a whole.

    Raises ValueError for another version, and where something is missing or cannot be.
    """
    meta = {str(key): str(value) for key, value in connection.execute("SELECT * FROM meta")}
    if any(len(value) > _MAX_CHARACTERS for key, value in meta.items() if key != "files"):
        raise ValueError("more words than any run writes")
    version = meta.get("schema_version", "unknown")
    if version != str(SCHEMA_VERSION):
        raise ValueError(f"schema_version is {version}; this software reads {SCHEMA_VERSION}")
    lacking = [key for key in META if key not in meta]
    if lacking:
        raise ValueError(f"{lacking[0]} is missing")
    if not 0 < int(meta["samples"]) < 2**63 or not isinstance(_from_json(meta["files"]), dict):
        raise ValueError("samples or files cannot be")
    return meta


def row_of(outcome: Outcome, attempts: int) -> tuple[Any, ...]:
    """Row of an outcome, as INSERT takes it."""
    finished = datetime.now(UTC).isoformat(timespec="seconds")
    return values_of(asdict(outcome) | {"attempts": attempts, "finished": finished})


def values_of(values: Mapping[str, Any]) -> tuple[Any, ...]:
    """Row of a record's fields, as INSERT takes it."""
    return tuple(
        json.dumps(values[name], ensure_ascii=False) if name in _JSON else values[name]
        for name in _COLUMNS
    )


def record_of(row: tuple[Any, ...]) -> Record:
    """Record of a row, as SELECT gives it. Raises ValueError where it holds what no run writes."""
    values = dict(zip(_COLUMNS, row, strict=True))
    try:
        for name, no_return in _JSON.items():
            values[name] = _from_json(no_return if values[name] is None else values[name])
        values = _Row.model_validate(values).model_dump()
    except ValidationError as error:
        column = (*error.errors()[0]["loc"], "row")[0]
        raise ValueError(f"{column} of sample {show(row[0])} cannot be") from None
    values["parameters"] = dict(flat(values["parameters"]))
    return Record(**values | {"warnings": tuple(values["warnings"])})


def _from_json(text: str) -> Any:
    try:
        return json.loads(text, parse_int=_whole)
    except (TypeError, RecursionError):
        raise ValueError(f"{show(text)} cannot be") from None


def _whole(digits: str) -> int:
    if len(digits) > MAX_DIGITS:
        raise ValueError(f"a number of {len(digits)} digits")
    return int(digits)


def flat(values: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Values and the names that they have in a plan, through all sections."""
    for name, value in values.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value

"""Configuration files and manifests as malice and accident change them, by seeds."""

import copy
import random
import sqlite3
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import yaml

#: Values that stand where another was expected.
ODD: list[Any] = [
    None, True, False, 0, -1, 1, 2**31, 2**63, -(2**70), 10**300, 1e308, -1e308, 5e-324,
    float("inf"), float("nan"), "", " ", "x", "x" * 5000, "9" * 400, "1e999", "\x1b[31m", "\u202e",
    "x.yaml", "~", "=", "<<", "2024-01-01", [], {}, [[]], [{}], {"": ""}, {"x": {"y": []}},
    {1: 2}, [0, 0], [1, 0, 1], [None, None, None], [1e308, 1e308, 1e308], ["a", 1, None],
    list(range(300)), {f"f{k}": k for k in range(200)},
    {"uniform": [0, 1]}, {"uniform": [1, 0]}, {"uniform": [-1e308, 1e308]}, {"uniform": "x"},
    {"log_uniform": [1e-300, 1e300]}, {"normal": [0, 1e308]}, {"normal": [0, 1], "within": [9, 8]},
    {"choice": []}, {"choice": [{"choice": [1, {"uniform": [0, 1]}]}]}, {"choice": "abc"},
    {"choice": [1, 2], "weights": [0, 0]}, {"grid": []}, {"grid": [1, [2], {"x": 3}]},
    {"grid": [{"grid": [1]}]}, {"grid": list(range(3000))}, {"family": "targets"},
]  # fmt: skip
#: Pieces of YAML that no dump of plain data contains.
PIECES = [
    "&a ", "*a", "<<: *a", "!!int ", "!!bool ", "!!set ", "!!python/name:os.system ", "---\n",
    "...\n", "? ", "- ", "[" * 300, "{" * 300, "'", '"', ": ", "\t", "#", "%YAML 9.9\n", "|\n",
    ">\n", "\x00", "\ufeff", "9" * 500, ":1" * 400, "0x" + "f" * 400, "~", "=", ".inf",
]  # fmt: skip
_DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


def mutated_yaml(base: dict[str, Any], seed: int) -> str:
    """Text of a file with one to four changes of its tree, and often one of its text."""
    rng = random.Random(seed)
    tree = copy.deepcopy(base)
    for _ in range(rng.randint(1, 4)):
        _change(tree, rng)
    text = yaml.dump(tree, Dumper=_DUMPER, sort_keys=False, allow_unicode=True)
    if rng.random() < 0.4:
        position = rng.randrange(len(text) + 1)
        text = text[:position] + rng.choice(PIECES) + text[position + rng.choice([0, 0, 1, 20]) :]
    if rng.random() < 0.1:
        text = f"bomb: &b0 [{'x,' * 9}]\n" + "".join(
            f"b{k}: &b{k} [{f'*b{k - 1},' * 9}]\n" for k in range(1, rng.randint(2, 9))
        ) + text  # fmt: skip
    return text


def _change(tree: dict[str, Any], rng: random.Random) -> None:
    holder, key = rng.choice(list(_positions(tree)) or [(tree, "name")])
    kind = rng.randrange(5)
    if kind == 0 and isinstance(holder, dict):
        holder[f"{key}x" if rng.random() < 0.5 else rng.choice("abc")] = holder.pop(key, None)
    elif kind == 1 and key in (holder if isinstance(holder, dict) else range(len(holder))):
        del holder[key]
    elif kind == 2:  # the same thing in two places is dumped with an alias
        other, position = rng.choice(list(_positions(tree)) or [(tree, "name")])
        if position in (other if isinstance(other, dict) else range(len(other))):
            holder[key] = other[position]
    else:
        holder[key] = copy.deepcopy(rng.choice(ODD))


def _positions(tree: Any, depth: int = 0) -> Any:
    if depth > 12:  # it may contain itself by now
        return
    for key, value in tree.items() if isinstance(tree, dict) else enumerate(tree[:20]):
        yield tree, key
        if isinstance(value, dict | list):
            yield from _positions(value, depth + 1)


COLUMNS = ["index", "status", "scene", "parameters", "file", "bytes", "sha256", "sidecars",
           "seconds", "stage_seconds", "peak_memory_mb", "attempts", "error", "finished",
           "warnings"]  # fmt: skip
SAMPLE = '{"samples/000/000001.npz": {"bytes": 8, "sha256": "' + "0" * 64 + '"}}'
CELLS: list[Any] = [
    None, 0, -1, 1, 2, 2**62, -(2**62), 1e308, float("inf"), "", "x", "done", "failed", b"\xff\x00",
    "x" * 100_000, "{}", "[]", "[1]", "null", "{", '{"a": ' * 2000 + "1" + "}" * 2000, "[" * 50_000,
    '{"x": NaN}', '{"x": 1e999}', '{"x": ' + "9" * 500 + "}", '{"": {"": {}}}', '{"a": "b"}',
    SAMPLE,
    SAMPLE.replace("samples/000/000001.npz", "../key"), SAMPLE.replace("8", "-8"),
    "samples/000/000001.h5", "../key", "/etc/passwd", "samples/../../key", "samples/000/000001.npz",
    "0" * 64, "2026-01-01T00:00:00+00:00", "0001-01-01T00:00:00+00:00", "2026-01-01", "\ud7ff\x00",
]  # fmt: skip
SCRIPTS = [
    "DROP TABLE samples", "DROP TABLE meta", "DELETE FROM meta", "DELETE FROM samples",
    "CREATE TABLE more (x)", "CREATE INDEX i ON samples (scene)", "PRAGMA journal_mode = WAL",
    "DROP TABLE samples; CREATE VIEW samples AS WITH RECURSIVE n(x) AS (SELECT 0 UNION ALL SELECT"
    " x + 1 FROM n) SELECT x AS 'index' FROM n",
    "DROP TABLE meta; CREATE VIEW meta AS WITH RECURSIVE n(x) AS (SELECT 0 UNION ALL SELECT x + 1"
    " FROM n) SELECT x, x FROM n",
    "CREATE TRIGGER t AFTER INSERT ON samples BEGIN DELETE FROM samples; END",
    "CREATE TRIGGER t BEFORE DELETE ON samples BEGIN SELECT RAISE(IGNORE); END",
    "ALTER TABLE samples ADD COLUMN more GENERATED ALWAYS AS (hex(zeroblob(100000000)))",
    "PRAGMA writable_schema = ON; UPDATE sqlite_master SET rootpage = 2",
    "PRAGMA writable_schema = ON; UPDATE sqlite_master SET sql = replace(sql, 'TEXT', 'BLOB')",
    "PRAGMA writable_schema = ON; UPDATE sqlite_master SET sql = replace(sql, 'NOT NULL',"
    " 'DEFAULT (randomblob(1000000000))')",
    "PRAGMA page_size = 512; VACUUM", "PRAGMA user_version = 7",
    "PRAGMA encoding = 'UTF-16'; VACUUM",
]  # fmt: skip


def mutate_manifest(path: Path, seed: int) -> None:
    """Change rows, tables or bytes of a manifest, in place, or put something beside it."""
    rng = random.Random(seed)
    kind = rng.choice(["cells", "cells", "cells", "tables", "bytes", "bytes", "beside"])
    if kind in ("cells", "tables"):
        with (
            closing(sqlite3.connect(path, isolation_level=None)) as database,
            suppress(sqlite3.Error),
        ):
            database.execute("PRAGMA ignore_check_constraints = ON")
            database.execute("PRAGMA synchronous = OFF")
            for _ in range(rng.randint(1, 3)):
                _change_cell(database, rng)
            if kind == "tables":  # last: the library would work long on what some of them add
                database.executescript(rng.choice(SCRIPTS))
    content = bytearray(path.read_bytes())
    if kind == "bytes":
        _change_bytes(content, rng)
        path.write_bytes(content)
    elif kind == "beside":
        ending = rng.choice(["-journal", "-wal", "-shm"])
        _change_bytes(content, rng)
        path.with_name(path.name + ending).write_bytes(content)


def _change_cell(database: sqlite3.Connection, rng: random.Random) -> None:
    value = rng.choice(CELLS)
    if rng.random() < 0.2:
        keys = ["schema_version", "plan_digest", "name", "samples", "created", "software", "files"]
        database.execute("UPDATE meta SET value = ? WHERE key = ?", (value, rng.choice(keys)))
    else:
        where = rng.choice(["", ' WHERE "index" = 1', " WHERE rowid % 2"])
        database.execute(f'UPDATE samples SET "{rng.choice(COLUMNS)}" = ?{where}', (value,))


def _change_bytes(content: bytearray, rng: random.Random) -> None:
    for _ in range(rng.choice([1, 1, 3, 30])):
        position = rng.randrange(rng.choice([100, 200, len(content)]))
        content[position] = rng.choice([0, 1, 2, 13, 127, 128, 255, rng.randrange(256)])
    if rng.random() < 0.2:
        del content[rng.randrange(len(content)) :]
    if rng.random() < 0.1:
        page = rng.randrange(0, len(content) + 1, 512)
        content[page : page + 512] = content[:512]

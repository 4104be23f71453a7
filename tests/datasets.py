"""Small data sets on disk, as a run of a plan leaves them, without any light transport."""

import hashlib
import json
import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml

from reconstruction import Capture, write_capture
from spisim.dataset.folder import Layout, Origin
from spisim.dataset.planned import PlannedSet
from spisim.dataset.records import SCHEMA

PLAN = "0123abcd"
META = {
    "schema_version": "1",
    "plan_digest": PLAN,
    "name": "walls",
    "created": "2026-01-01T00:00:00+00:00",
    "software": "spisim test",
    "samples": "45",
    "files": "{}",
}
SCENES = 20


def make_set(folder: Path, capture: Capture, done: int = 40, failed: int = 3) -> Path:
    """A data set of two samples for each of twenty scenes, then failed ones; returns the folder.

    Every third sample lacks the fog's visibility, which is 10 m more than ten times its index.
    """
    folder.mkdir(parents=True)
    (folder / "plan.yaml").write_text(f"name: walls\nsamples: {done + failed + 2}\n")
    rows = [_done(folder, capture, index) for index in range(done)]
    rows += [_failed(index) for index in range(done, done + failed)]
    with closing(sqlite3.connect(folder / "manifest.sqlite")) as database, database:
        database.executescript(SCHEMA)
        meta = META | {"samples": str(done + failed + 2)}
        database.executemany("INSERT INTO meta VALUES (?, ?)", meta.items())
        for row in rows:
            names = ", ".join(f'"{name}"' for name in row)
            marks = ", ".join("?" * len(row))
            database.execute(f"INSERT INTO samples ({names}) VALUES ({marks})", tuple(row.values()))
    return folder


def sample_capture(capture: Capture, index: int, plan: str = PLAN) -> Capture:
    """The capture of a sample: a wall that stands `index` metres farther away."""
    assert capture.truth is not None
    settings = yaml.safe_dump({"spp": 7, "data_set": {"plan": plan, "index": index}})
    return replace(
        capture,
        truth=replace(capture.truth, depth_m=capture.truth.depth_m + np.float32(index)),
        provenance=replace(capture.provenance, created="", settings=settings),
    )


def _done(folder: Path, capture: Capture, index: int) -> dict:
    name = f"samples/000/{index:06d}"
    write_capture(sample_capture(capture, index), folder / f"{name}.h5")
    (folder / f"{name}.npz").write_bytes(b"light %d" % index)
    fog = {} if index % 3 == 0 else {"scene.fog": {"visibility_m": 10.0 * index + 10}}
    return {
        "index": index,
        "status": "done",
        "scene": f"walls-{index % SCENES}",
        "parameters": json.dumps({"scene": "walls", "power_w": index / 10, **fog}),
        "file": f"{name}.h5",
        **_reported(folder / f"{name}.h5"),
        "sidecars": json.dumps({f"{name}.npz": _reported(folder / f"{name}.npz")}),
        "seconds": 2.0,
        "stage_seconds": json.dumps({"image": 1.5}),
        "peak_memory_mb": 300.0,
        "attempts": 1,
        "finished": f"2026-01-01T00:{index:02d}:00+00:00",
    }


def _failed(index: int) -> dict:
    reason = "a laser hits nothing" if index % 2 else f"scene {index}: drone within {index} cm"
    return {
        "index": index,
        "status": "failed",
        "scene": f"walls-{index}",
        "parameters": "{}",
        "attempts": 1,
        "error": reason,
        "finished": "2026-01-01T01:00:00+00:00",
    }


def _reported(path: Path) -> dict:
    content = path.read_bytes()
    return {"bytes": len(content), "sha256": hashlib.sha256(content).hexdigest()}


def put_captures(planned: PlannedSet, folder: Path, capture: Capture) -> None:
    """All samples of a plan as they are found where the manifest is lost."""
    for index in range(planned.plan.size):
        path = Layout(folder).capture(index)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.with_suffix(".npz").write_bytes(b"light %d" % index)
        sidecars = {".npz": hashlib.sha256(b"light %d" % index).hexdigest()}
        settings = {"data_set": Origin(planned.digest, index, sidecars).settings}
        provenance = replace(capture.provenance, settings=yaml.safe_dump(settings))
        write_capture(replace(capture, provenance=provenance), path)


def change(folder: Path, statement: str) -> None:
    """Carry out an SQL statement on the manifest of a data set."""
    with closing(sqlite3.connect(folder / "manifest.sqlite")) as database, database:
        database.execute(statement)

"""Small data sets by the real program, in processes that may be killed."""

from __future__ import annotations

import hashlib
import os
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml

from commands import program, spisim

SAMPLES = 6
PLAN = {
    "name": "tiny",
    "samples": SAMPLES,
    "scenes": [{"family": "targets", "parameters": {"target": "plane", "setting": "alone"}}],
    "vary": {
        "instrument.projector.shape": [16, 16],
        "instrument.plan.patterns": 32,
        "scene.fog.visibility_m": {"log_uniform": [20, 200]},
    },
    "spp": 8,
    "keep": {"transport": True, "histograms": True},
}


def write_plan(folder: Path, **changes: Any) -> Path:
    path = folder / "tiny.yaml"
    path.write_text(yaml.safe_dump(PLAN | changes, sort_keys=False))
    return path


def run(*arguments: str | Path) -> Any:
    return spisim("dataset", *arguments)


@contextmanager
def started(*arguments: str | Path) -> Iterator[subprocess.Popen[str]]:
    """A run under way, in a group of its own as under a terminal; none of it is left behind."""
    process = subprocess.Popen(
        program("dataset", *arguments), stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    try:
        yield process
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def files(folder: Path) -> dict[str, str]:
    """SHA-256 of everything that a run leaves in the samples' folder, hidden files too."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted((folder / "samples").rglob("*"))
        if path.is_file()
    }


def captures(folder: Path) -> int:
    return len(list(folder.glob("samples/*/*.h5")))


def children(pid: int) -> list[int]:
    """Worker processes of a run; its resource tracker is none."""
    result = []
    for number in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
        if b"spawn_main" in Path(f"/proc/{number}/cmdline").read_bytes():
            result.append(int(number))
    return result

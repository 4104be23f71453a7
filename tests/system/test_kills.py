"""Flights and studies that are killed at any time, and run again, end as undisturbed ones."""

from __future__ import annotations

import random
import shutil
import signal
import subprocess
from pathlib import Path

import pytest
import yaml

from commands import program
from reconstruction.base.folders import LOCK
from steps import run_to_step

pytestmark = pytest.mark.slow

SCENE = """
name: hall
drone: {position_m: [0, 0, 1], look_at_m: [5, 0, 1]}
objects:
  - {name: wall, shape: rectangle, size_m: [9, 9], rotate_deg: [0, -90, 0], translate_m: [6, 0, 1],
     material: concrete}
"""
PATH = "t,x,y,z,look_x,look_y,look_z\n0,0,0,1,6,0,1\n3,1.5,0,1,6,0.5,1\n"
PLAN = {
    "name": "wall",
    "scenes": [{"scene": "target-plane"}],
    "vary": {
        "instrument.projector.shape": [16, 16],
        "instrument.plan.patterns": 32,
        "scene.fog.visibility_m": {"grid": [25, 1000]},
    },
    "spp": 8,
    "study": {"x": "scene.fog.visibility_m", "rounds": 2, "metrics": ["range_bias_m[cw]"]},
}
COMMANDS = {
    "fly": ["hall.yaml", "--path", "path.csv", "--spp", "4", "--rate", "1"],
    "study": ["plan.yaml", "--workers", "1"],
}
ENDS = {"killed": signal.SIGKILL, "Ctrl-C": signal.SIGINT}
KILLS = 5


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "hall.yaml").write_text(SCENE)
    (tmp_path / "path.csv").write_text(PATH)
    (tmp_path / "plan.yaml").write_text(yaml.safe_dump(PLAN, sort_keys=False))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def contents(folder: Path) -> dict[str, bytes]:
    """All files but the manifest, which states when samples were made, and the lock's empty file.

    A run that is killed between creating its lock and writing it leaves that.
    """
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != "manifest.sqlite" and not is_empty_lock(path)
    }


def is_empty_lock(path: Path) -> bool:
    return path.name == LOCK and not path.stat().st_size


@pytest.mark.parametrize("end", ENDS)
@pytest.mark.parametrize("verb", COMMANDS)
def test_what_was_ended_early_ends_as_if_it_had_not_been(verb: str, end: str, place: Path) -> None:
    """At steps all over its life; where it is through by then, there is nothing to go on with."""
    arguments = [verb, *COMMANDS[verb], "--no-progress", "-o"]
    status, steps = run_to_step(-1, ENDS[end], *arguments, "whole")
    assert status == 0
    whole, rng = contents(place / "whole"), random.Random(verb + end)
    for kill in range(KILLS):
        shutil.rmtree(place / "out", ignore_errors=True)
        step = int(steps * (kill + rng.random()) / KILLS)
        status, _ = run_to_step(step, ENDS[end], *arguments, "out")
        assert status != 0, step
        # In a process as the others: the last digits of flights follow the number of BLAS threads.
        run = subprocess.run(program(*arguments, "out"), capture_output=True, text=True)
        assert run.returncode == 0, (step, run.stderr)
        now = contents(place / "out")
        assert [name for name in {**now, **whole} if now.get(name) != whole.get(name)] == [], step

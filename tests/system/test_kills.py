"""Flights and studies that are killed at any time, and run again, end as undisturbed ones."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest
import yaml

from commands import program
from waiting import SAFETY_S

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
KILLS = 3


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "hall.yaml").write_text(SCENE)
    (tmp_path / "path.csv").write_text(PATH)
    (tmp_path / "plan.yaml").write_text(yaml.safe_dump(PLAN, sort_keys=False))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def contents(folder: Path) -> dict[str, bytes]:
    """All files but the manifest, which tells when samples were made."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != "manifest.sqlite"
    }


@pytest.mark.parametrize("end", ENDS)
@pytest.mark.parametrize("verb", COMMANDS)
def test_what_was_ended_early_ends_as_if_it_had_not_been(verb: str, end: str, place: Path) -> None:
    """At times all over its life; where it is through by then, there is nothing to go on with."""
    arguments = [verb, *COMMANDS[verb], "--no-progress", "-o"]
    began = time.monotonic()
    subprocess.run(program(*arguments, "whole"), check=True, timeout=SAFETY_S)
    seconds = time.monotonic() - began
    whole, rng, ended = contents(place / "whole"), random.Random(verb + end), 0
    for kill in range(KILLS):
        shutil.rmtree(place / "out", ignore_errors=True)
        process = subprocess.Popen(program(*arguments, "out"), start_new_session=True)
        time.sleep(seconds * (kill + rng.random()) / KILLS)
        os.killpg(process.pid, ENDS[end])
        ended += process.wait(SAFETY_S) != 0
        # In a process as the others: the last digits of flights follow the number of BLAS threads.
        run = subprocess.run(program(*arguments, "out"), capture_output=True, text=True)
        assert run.returncode == 0, run.stderr
        assert contents(place / "out") == whole
    assert ended

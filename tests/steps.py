"""A command that is ended at one of its steps on the file system, shared by the tests."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

from waiting import SAFETY_S

#: Runs a command, and signals it before the step whose number the environment holds.
_PROGRAM = """
import os, sys

KINDS = {"open", "os.mkdir", "os.rename", "os.remove", "os.rmdir", "fcntl.flock"}
ending, signal, folder, seen = int(os.environ["END_AT"]), int(os.environ["SIGNAL"]), sys.argv[-1], 0

def step(event, arguments):
    global seen
    if event not in KINDS or event != "fcntl.flock" and folder not in str(arguments[0]):
        return
    if seen == ending:
        os.kill(os.getpid(), signal)
    seen += 1

sys.addaudithook(step)
from spisim_app.cli import main
try:
    main()
finally:
    if ending < 0:
        print(f"steps: {seen}", file=sys.stderr)
"""


def run_to_step(step: int, end: signal.Signals, *arguments: str | Path) -> tuple[int, int]:
    """Run a command that writes the folder of its last argument, and signal it before a step.

    Returns its exit status and, for a negative step, which lets it finish, the number of steps.
    """
    run = subprocess.run(
        [sys.executable, "-c", _PROGRAM, *map(str, arguments)],
        env={**os.environ, "END_AT": str(step), "SIGNAL": str(int(end))},
        capture_output=True,
        text=True,
        timeout=SAFETY_S,
    )
    steps = run.stderr.rpartition("steps: ")[2].strip()
    return run.returncode, int(steps) if step < 0 else 0

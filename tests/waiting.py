"""Waiting for what other processes do: for the thing itself, however busy the machine is."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable

#: Ends a test that would hang; no test that passes comes near.
SAFETY_S = 900


def until(condition: Callable[[], object], process: subprocess.Popen[str] | None = None) -> None:
    """Return when the condition holds; fail where the process ends before that."""
    end = time.monotonic() + SAFETY_S
    while not condition():
        assert process is None or process.poll() is None or condition()
        assert time.monotonic() < end
        time.sleep(0.02)

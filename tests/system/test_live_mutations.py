"""Changed setups and frames, with checksums that fit, against a loop with all sinks."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from stream_mutations import SINKS, fly

LONGEST_S, MAX_MIB = 5.0, 300
"""Of processor time for a setup and its frames; of the whole process."""


def judge(reported):
    """Nothing crashes, hangs or fills memory; what came is accounted for, and no sink is gone."""
    counts = reported["counts"]
    assert reported["alive"] == [*SINKS, "messages"]
    assert reported["longest_s"] < LONGEST_S
    assert counts["received"] == counts["reconstructed"] + counts.get("failed", 0)
    assert counts["refused"] > 0
    assert counts.get("sink_failures", 0) >= sum(reported["lost"].values())


def test_some_changed_streams_do_no_harm(tmp_path):
    judge(fly(12, 5, tmp_path))


@pytest.mark.hours
def test_ten_thousand_changed_streams_do_no_harm():
    program = Path(__file__).parents[1] / "stream_mutations.py"
    done = subprocess.run(
        [sys.executable, str(program), "10000"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    fields = json.loads(done.stdout)
    judge(fields)
    assert fields["memory_mib"] < MAX_MIB

"""A flipped bit in a sample is found where the manifest that tells of it is lost."""

from pathlib import Path

import numpy as np
import pytest

from datasets import make_set, sample_capture
from reconstruction import Capture, InputError, read_capture, write_capture
from runs import PLAN, Run, rows, write_plan
from spisim.dataset import verify
from spisim.dataset.folder import Layout
from spisim.dataset.planned import PlannedSet


def flip(path: Path, position: int) -> None:
    content = bytearray(path.read_bytes())
    content[position] ^= 1
    path.write_bytes(content)


@pytest.fixture
def planned(tmp_path: Path) -> PlannedSet:
    return write_plan(tmp_path, PLAN)


@pytest.mark.parametrize("part", ["readings", "truth"])
def test_a_lost_manifest_and_a_flipped_bit(
    planned: PlannedSet, tmp_path: Path, capture: Capture, part: str
) -> None:
    folder = tmp_path / "set"
    path = Layout(folder).capture(2)
    write_capture(sample_capture(capture, 2, planned.digest), path)
    whole = read_capture(path)
    assert whole.truth is not None
    values = whole.buckets.counts if part == "readings" else whole.truth.depth_m
    flip(path, path.read_bytes().index(values.tobytes()[:16]) + 8)
    run = Run(planned, folder)
    assert run.said == [f"removed damaged captures, which are made again: {path}"]
    assert run.executor.asked == [[0, 1, 2, 3, 4]]
    assert len(rows(folder, "status")) == 5


def test_verify_does_not_take_it_for_a_capture(tmp_path: Path, capture: Capture) -> None:
    folder = make_set(tmp_path / "walls", capture, done=2, failed=0)
    path = folder / "samples/000/000001.h5"
    path.rename(folder / "samples/000/000007.h5")
    path = folder / "samples/000/000007.h5"
    for position in np.random.default_rng(0).integers(0, path.stat().st_size, 20):
        flip(path, int(position))
        reported = {finding.file: finding.detail for finding in verify(folder)}
        assert reported["samples/000/000007.h5"] == "not a readable capture"
        with pytest.raises(InputError):
            read_capture(path)
        flip(path, int(position))

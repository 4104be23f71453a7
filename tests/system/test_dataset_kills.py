"""Runs killed at random times and tampered with in between end as one undisturbed."""

from __future__ import annotations

import os
import random
import shutil
import signal
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from spisim.dataset import verify
from spisim.dataset.folder import Layout
from tinysets import SAMPLES, captures, children, files, run, started, write_plan
from waiting import until

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc"),
]
ROUNDS = 20


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, str]]:
    """A plan, and what its run leaves when nothing disturbs it."""
    folder = tmp_path_factory.mktemp("whole")
    plan = write_plan(folder)
    assert run(plan, "-o", folder / "set", "--workers", "2").exit_code == 0
    return plan, files(folder / "set")


def one(folder: Path, rng: random.Random, suffix: str = "*") -> Path:
    """Any file of a sample that is done."""
    return rng.choice(sorted(Layout(folder).samples.glob(f"*/[0-9]*.{suffix}")))


def flipped(folder: Path, rng: random.Random, suffix: str = "*") -> None:
    path = one(folder, rng, suffix)
    content = bytearray(path.read_bytes())
    content[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
    path.write_bytes(content)


def truncated(folder: Path, rng: random.Random) -> None:
    path = one(folder, rng)
    os.truncate(path, rng.randrange(path.stat().st_size))


def deleted(folder: Path, rng: random.Random) -> None:
    one(folder, rng).unlink()


def linked(folder: Path, rng: random.Random) -> None:
    path = one(folder, rng)
    elsewhere = folder.parent / "elsewhere"
    path.rename(elsewhere)
    path.symlink_to(elsewhere)
    refused = run(folder.parent / "tiny.yaml", "-o", folder)
    assert refused.exit_code == 2
    assert "is a link" in refused.stderr
    path.unlink()


def without_manifest(folder: Path, rng: random.Random) -> None:
    for path in folder.glob("manifest.sqlite*"):
        path.unlink()


def without_manifest_and_flipped(folder: Path, rng: random.Random) -> None:
    without_manifest(folder, rng)
    flipped(folder, rng)


def manifest_garbled(folder: Path, rng: random.Random) -> None:
    path = folder / "manifest.sqlite"
    path.write_bytes(rng.randbytes(path.stat().st_size))


def manifest_cut(folder: Path, rng: random.Random) -> None:
    path = folder / "manifest.sqlite"
    os.truncate(path, rng.randrange(path.stat().st_size))


def foreign_files(folder: Path, rng: random.Random) -> None:
    (folder / ".editor.tmp").write_text("mine")
    (folder / "notes.txt").write_text("mine")


def half_written(folder: Path, rng: random.Random) -> None:
    path = Layout(folder).capture(rng.randrange(SAMPLES))
    path.with_name(f".{path.name}.0123abcd.tmp").write_bytes(rng.randbytes(1000))


def without_plan(folder: Path, rng: random.Random) -> None:
    (folder / "plan.yaml").unlink(missing_ok=True)


def swapped(folder: Path, rng: random.Random) -> None:
    path = one(folder, rng, "npz")
    path.write_bytes(one(folder, rng, "exr").read_bytes())


TAMPERINGS: list[Callable[[Path, random.Random], None]] = [
    flipped, truncated, deleted, linked, without_manifest, without_manifest_and_flipped,
    manifest_garbled, manifest_cut, foreign_files, half_written, without_plan, swapped,
]  # fmt: skip


@pytest.mark.parametrize("seed", range(ROUNDS))
def test_killed_and_tampered_with(
    whole: tuple[Path, dict[str, str]], tmp_path: Path, seed: int
) -> None:
    plan, expected = whole
    plan = Path(shutil.copy(plan, tmp_path))
    folder, rng = tmp_path / "set", random.Random(seed)
    tamper = TAMPERINGS[seed % len(TAMPERINGS)]
    first, second = sorted(rng.choices(range(1, SAMPLES), k=2))
    with started(plan, "-o", folder, "--workers", "2") as process:
        until(lambda: captures(folder) >= first, process)
        workers = children(process.pid)
        if rng.random() < 0.5:
            os.kill(rng.choice(workers), signal.SIGKILL)
            until(lambda: captures(folder) >= second, process)
            workers = children(process.pid)
        process.kill()  # its workers end by themselves
        process.wait()
        until(lambda: not any(Path(f"/proc/{pid}/exe").exists() for pid in workers))
    tamper(folder, rng)
    done = run(plan, "-o", folder, "--workers", "2", "--deep")
    assert done.exit_code == 0, (tamper.__name__, done.stderr)
    assert files(folder) == expected, tamper.__name__
    assert verify(folder) == []
    if tamper is foreign_files:
        assert (folder / ".editor.tmp").read_text() == (folder / "notes.txt").read_text() == "mine"

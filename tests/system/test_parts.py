"""The parts of the slow tests, and which of them a commit's check runs."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from pages import ROOT
from parts import PARTS

pytest_plugins = ["pytester"]

SUITE = """
import pytest

@pytest.mark.slow
@pytest.mark.parametrize("number", range(40))
def test_slow(number): pass

def test_fast(): pass
"""


def test_each_slow_test_is_in_one_part(pytester: pytest.Pytester) -> None:
    pytester.makeini("[pytest]\nmarkers = slow")
    pytester.makepyfile(SUITE)

    def run(*arguments: str) -> list[str]:
        counted = pytester.inline_run("-p", "parts", "-m", "slow", *arguments)
        return [report.nodeid for report in counted.listoutcomes()[0]]

    parts = [run("--part", str(part)) for part in range(5 * PARTS, 6 * PARTS)]
    assert all(parts)
    assert sorted(name for part in parts for name in part) == sorted(run())
    assert len(run()) == 40


def made(folder: Path) -> list[str]:
    """What the check of a tree has made, in order."""
    (folder / ".ci").mkdir()
    shutil.copy(ROOT / ".ci" / "run", folder / ".ci")
    make = folder / "make"
    make.write_text('#!/bin/sh\necho "$@"\n', encoding="utf-8")
    make.chmod(0o755)
    path = os.pathsep.join([str(folder), os.environ["PATH"]])
    environment = os.environ | {"PATH": path, "GIT_CEILING_DIRECTORIES": str(folder.parent)}
    run = [folder / ".ci" / "run"]
    return subprocess.run(
        run, env=environment, capture_output=True, text=True, check=True
    ).stdout.splitlines()


def git(folder: Path, *arguments: str) -> str:
    command = ["git", "-C", str(folder), "-c", "user.name=a", "-c", "user.email=a@b", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


@pytest.mark.skipif(shutil.which("git") is None, reason="needs git")
def test_the_commit_says_which_part_is_checked(tmp_path: Path) -> None:
    git(tmp_path, "init", "--quiet")
    git(tmp_path, "commit", "--quiet", "--allow-empty", "--message", "one")
    number = int(git(tmp_path, "rev-parse", "HEAD")[:7], 16)
    assert made(tmp_path) == ["test", f"slow PART={number}"]


@pytest.mark.parametrize("repository", [False, True])
def test_without_a_commit_the_first_part_is_checked(tmp_path: Path, repository: bool) -> None:
    if repository:
        git(tmp_path, "init", "--quiet")
    assert made(tmp_path) == ["test", "slow PART=0"]

"""The README points to what is there."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def local_targets(markdown: str) -> list[str]:
    """Targets of links and images, Markdown's and HTML's, that lie in the repository."""
    targets = re.findall(r"\]\(\s*<?([^)\s>]+)", markdown)
    targets += re.findall(r"""(?:src|href)=["']([^"']+)["']""", markdown)
    return [t.partition("#")[0] for t in targets if not re.match(r"#|[a-z]+:", t)]


def tracked_by_git() -> set[str]:
    """Files that are tracked, or would be by `git add`; all files where there is no Git."""
    listing = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    if listing.returncode != 0:
        return {str(path.relative_to(ROOT)) for path in ROOT.rglob("*") if path.is_file()}
    return {name for name in listing.stdout.splitlines() if (ROOT / name).is_file()}


def test_all_kinds_of_links_are_seen() -> None:
    text = '![a](b.png) [c](d.md#e) <img src="f.svg"> [g](https://h.org) [i](#j) [k](mailto:l@m)'
    assert local_targets(text) == ["b.png", "d.md", "f.svg"]


@pytest.mark.parametrize("target", local_targets(README))
def test_every_link_leads_to_a_file_of_the_repository(target: str) -> None:
    assert target in tracked_by_git()


@pytest.mark.slow
def test_the_example_in_python_suits_a_strict_type_checker(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "start.md").read_text(encoding="utf-8")
    example = re.search(r"```python\n(.*?)```", page, re.S)
    assert example is not None
    assert "result.ranges" in example[1]
    (tmp_path / "example.py").write_text(example[1], encoding="utf-8")
    options = ["--strict", "--follow-imports", "silent", "--config-file", ""]
    done = subprocess.run(
        [sys.executable, "-m", "mypy", *options, "--cache-dir", str(tmp_path), "example.py"],
        cwd=tmp_path,
        env={**os.environ, "MYPYPATH": str(ROOT)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout

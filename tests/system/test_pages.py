"""The README and the pages: every block runs as it is printed."""

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

from pages import PAGES, ROOT, SHELLS, Block, blocks

#: It needs a fresh clone: tools/strangers_path.py goes it.
STRANGERS_PATH = ROOT / "docs" / "path.md"
RUN = [page for page in PAGES if page != STRANGERS_PATH]

#: Runs files that it is told of, one after the other, in one namespace.
PYTHON = """
import sys, traceback
space = {"__name__": "__main__"}
for line in sys.stdin:
    path = line.strip()
    try:
        exec(compile(open(path).read(), path, "exec"), space)
        print("\\0done", flush=True)
    except BaseException:
        traceback.print_exc(file=sys.stdout)
        print("\\0failed", flush=True)
"""


class NetworkInput:
    """A folder in which the blocks of one page run."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.environment: dict[str, str] = {
            **os.environ,
            "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
            "PYTHONPATH": str(ROOT),
            "REPOSITORY": str(ROOT),
            "MPLBACKEND": "agg",
            "SPISIM_CACHE": str(folder / ".cache"),
        }
        self.python: subprocess.Popen[str] | None = None

    def run(self, block: Block) -> None:
        """Write it if it is a file, run it if it is a program."""
        if block.first:
            self.shell(block.first)
        if block.title:
            file = self.folder / block.title
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(block.text, encoding="utf-8")
        elif block.not_run is None and block.language in SHELLS:
            self.shell(block.text)
        elif block.not_run is None and block.language == "python":
            self.exec(block.text)

    def shell(self, text: str) -> None:
        """Run commands, the first that fails ends them; what they export stays."""
        retained = self.folder / ".environment"
        done = subprocess.run(
            ["bash", "-e", "-o", "pipefail", "-c", f"{text}\nenv -0 > '{retained}'"],
            cwd=self.folder,
            env=self.environment,
            capture_output=True,
            text=True,
            stdin=subprocess.DEVNULL,
            check=False,
        )
        assert done.returncode == 0, f"{text}\n{done.stdout[-3000:]}\n{done.stderr[-3000:]}"
        self.environment = _read(retained.read_text(encoding="utf-8"))

    def exec(self, text: str) -> None:
        """Run Python after what ran before it."""
        if self.python is None:
            self.python = subprocess.Popen(
                [sys.executable, "-c", PYTHON],
                cwd=self.folder,
                env=self.environment,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
        assert self.python.stdin is not None
        assert self.python.stdout is not None
        file = self.folder / ".block.py"
        file.write_text(text, encoding="utf-8")
        self.python.stdin.write(f"{file}\n")
        self.python.stdin.flush()
        said = []
        for line in self.python.stdout:
            said.append(line)
            if line.startswith("\0"):
                break
        assert said, "Python is gone"
        assert said[-1] == "\0done\n", f"{text}\n{''.join(said)[-3000:]}"

    def end(self) -> None:
        """Let Python go."""
        if self.python is not None:
            self.python.communicate()


def _read(text: str) -> dict[str, str]:
    pairs: Mapping[str, str] = dict(
        entry.split("=", 1) for entry in text.split("\0") if "=" in entry
    )
    return dict(pairs)


@pytest.mark.slow
@pytest.mark.parametrize("page", RUN, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_block_runs_as_it_is_printed(page, tmp_path):
    result = blocks(page)
    if not any(block.language in (*SHELLS, "python") for block in result):
        pytest.skip("nothing to run")
    displayed = NetworkInput(tmp_path)
    try:
        for block in result:
            displayed.run(block)
    finally:
        displayed.end()

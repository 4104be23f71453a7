"""Go the stranger's path in a fresh clone, as docs/path.md prints it, and time it.

    python tools/strangers_path.py [--keep FOLDER]

What is committed is cloned; packages are installed anew, from wherever pip finds them.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from pages import SHELLS, blocks  # noqa: E402 - lies with the tests

#: All of it, packages included.
MAX_S = 600.0


def go(clone: Path) -> float:
    """Write and run everything that the page prints; the seconds that it took."""
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "VIRTUAL_ENV")}
    steps = []
    for block in blocks(clone / "docs" / "path.md"):
        if block.title:
            steps.append(f"cat > {block.title} <<'END'\n{block.text}END")
        elif block.language in SHELLS:
            steps.append(block.text)
    begin = time.monotonic()
    for number, step in enumerate(steps):
        script = "\n".join(['export PATH="$PWD/.venv/bin:$PATH"', "mkdir -p mine", step])
        before = time.monotonic()
        subprocess.run(["bash", "-e", "-c", script], cwd=clone, env=environment, check=True)
        first = step.partition("\n")[0]
        print(f"-- step {number}: {time.monotonic() - before:.0f} s, {first}", flush=True)
    return time.monotonic() - begin


def main() -> int:
    """Clone, go, and say whether it took less than ten minutes."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="clone into it, and leave it")
    folder = parser.parse_args().keep
    with tempfile.TemporaryDirectory() as passing:
        clone = (folder or Path(passing) / "spisim").absolute()
        subprocess.run(["git", "clone", "--quiet", str(ROOT), str(clone)], check=True)
        seconds = go(clone)
        report = clone / "mine" / "study" / "report.html"
        print(f"The path took {seconds:.0f} s, of {MAX_S:.0f} s; {report.stat().st_size} bytes")
    return 0 if seconds <= MAX_S else 1


if __name__ == "__main__":
    sys.exit(main())

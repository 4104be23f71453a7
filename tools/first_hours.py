"""Run the scripts of tests/strangers as new users would: from empty folders, against the wheel.

    python tools/first_hours.py [SCRIPT ...] [--python PYTHON]

The wheel is built and installed into a new virtual environment, packages from wherever pip finds
them. What a script needs besides, it says in a line such as `# needs: spisim[ros], mcap`. Scripts
are Python or shell; both find the commands of that environment first in PATH. With `--python` an
environment that has the packages already is used as it is.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
import venv
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).parents[1]
SCRIPTS = ROOT / "tests" / "strangers"
NEEDS = re.compile(r"^# needs: (.+)$", re.MULTILINE)
EXTRA = re.compile(r"spisim\[(\w+)\]")


def scripts_named(names: Iterable[str]) -> list[Path]:
    """Scripts by their names, all without any; ends the program for unknown ones."""
    result = {
        path.name: path for path in sorted(SCRIPTS.iterdir()) if path.suffix in (".py", ".sh")
    }
    stems = {path.stem: path for path in result.values()}
    chosen = list(names) or list(result)
    unknown = [name for name in chosen if name not in result | stems]
    if unknown:
        raise SystemExit(f"no script {unknown[0]!r} in {SCRIPTS}; allowed: {', '.join(result)}")
    return [(result | stems)[name] for name in chosen]


def installed(folder: Path, scripts: Iterable[Path]) -> Path:
    """The interpreter of a new environment in `folder` that has the wheel."""
    build = [sys.executable, "-m", "build", "--wheel", "--outdir", str(folder), str(ROOT)]
    subprocess.run(build, check=True, stdout=subprocess.DEVNULL)
    (wheel,) = folder.glob("*.whl")
    needs = {
        need.strip()
        for script in scripts
        for line in NEEDS.findall(script.read_text(encoding="utf-8"))
        for need in line.split(",")
    }
    extras = sorted(match[1] for need in needs if (match := EXTRA.fullmatch(need)))
    packages = sorted(need for need in needs if not EXTRA.fullmatch(need))
    venv.create(folder / "venv", with_pip=True)
    python = folder / "venv" / "bin" / "python"
    spisim = f"{wheel}[{','.join(extras)}]" if extras else str(wheel)
    subprocess.run(
        [
            python,
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
            spisim,
            *packages,
        ],
        check=True,
        env=environment(python),
    )
    return python


def environment(python: Path) -> dict[str, str]:
    """Variables of a process that sees nothing of this repository."""
    retained = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "VIRTUAL_ENV")}
    return retained | {"PATH": f"{python.parent}{os.pathsep}{os.environ['PATH']}"}


def run(script: Path, python: Path) -> bool:
    """Run one script in an empty folder; whether it succeeded."""
    command = [str(python), str(script)] if script.suffix == ".py" else ["bash", "-e", str(script)]
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        status = subprocess.run(command, cwd=folder, env=environment(python)).returncode
    said = "succeeded" if status == 0 else f"FAILED with status {status}"
    print(f"-- {script.name} {said} after {time.monotonic() - began:.0f} s", flush=True)
    return status == 0


def main() -> int:
    """Install, run all scripts, and return whether all succeeded."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("scripts", nargs="*", metavar="SCRIPT", help="by name; all without")
    parser.add_argument("--python", type=Path, help="interpreter that has the packages already")
    options = parser.parse_args()
    scripts = scripts_named(options.scripts)
    with tempfile.TemporaryDirectory() as folder:
        python = options.python or installed(Path(folder), scripts)
        results = [run(script, python.absolute()) for script in scripts]
    return 0 if all(results) else 1


if __name__ == "__main__":
    sys.exit(main())

"""What the reconstruction needs on the rig. Who may import whom is held by import-linter."""

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from reconstruction import Capture, write_capture

ROOT = Path(__file__).parents[2]
FORBIDDEN_ON_THE_RIG = {"mitsuba", "drjit", "spisim", "trimesh", "pydantic", "yaml", "typer"}
SLOW_TO_LOAD = {"matplotlib", "numba", "scipy"}


def imported(source: str) -> set[str]:
    """Top-level names of all modules that a source imports."""
    names = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            names.add(str(node.module).partition(".")[0])
    return names


def test_its_distribution_asks_for_what_it_imports() -> None:
    project = tomllib.loads((ROOT / "reconstruction" / "pyproject.toml").read_text())["project"]
    required = {re.split(r"\W", line)[0] for line in project["dependencies"]}
    extras = {
        "compiled.py": "fast",
        "in_step.py": "gpu",
        "_wavelets.py": "wavelets",
        "serial_port.py": "serial",
        "drawing.py": "window",
        "display.py": "window",
        "completion.py": "completion",
        "mcap_file.py": "ros",
        "codec.py": "mavlink",
    }
    modules = {"PyWavelets": "pywt", "pyserial": "serial"}
    packages = (ROOT / "reconstruction", ROOT / "live" / "spisim_live")
    for path in sorted(path for package in packages for path in package.rglob("*.py")):
        if path.parent.name == "adapters":  # each for a library of its own
            continue
        foreign = imported(path.read_text(encoding="utf-8")) - sys.stdlib_module_names
        extra = project["optional-dependencies"].get(extras.get(path.name), [])
        names = {line.partition(">")[0] for line in extra}
        allowed = required | {modules.get(name, name.replace("-", "_")) for name in names}
        assert foreign <= allowed | {"reconstruction", "spisim_live"}, path


def loaded_after(code: str) -> set[str]:
    """Modules that a fresh Python has loaded after some code."""
    text = f"{code}\nimport sys; print(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", text], cwd=ROOT, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return set(run.stdout.splitlines()[-1].split())


@pytest.mark.parametrize(
    "module", ["reconstructor", "depth.methods.learned", "ranging.methods.fog"]
)
def test_what_reads_a_capture_is_quick_to_load(module: str) -> None:
    assert not SLOW_TO_LOAD & loaded_after(f"import reconstruction.{module}")


def test_a_reconstruction_run_loads_no_simulator_and_nothing_slow(
    capture: Capture, tmp_path: Path
) -> None:
    write_capture(capture, tmp_path / "capture.h5")
    loaded = loaded_after(f"""
from reconstruction.cli import main
assert main([{str(tmp_path / "capture.h5")!r}, "-o", {str(tmp_path)!r}]) == 0
""")
    assert not loaded & (FORBIDDEN_ON_THE_RIG | SLOW_TO_LOAD)
    assert (tmp_path / "result.h5").exists()
    assert (tmp_path / "depth.png").exists()


@pytest.mark.parametrize(("already", "expected"), [("", "1"), ("import numpy", None)])
def test_the_rigs_program_calculates_on_one_thread(already: str, expected: str | None) -> None:
    code = f"""
import os
for name in [name for name in os.environ if name.endswith("_THREADS")]:
    del os.environ[name]
{already}
from reconstruction.cli import main
main(["reconstruct", "missing.h5", "-o", "nowhere"])
assert os.environ.get("OPENBLAS_NUM_THREADS") == {expected!r}
"""
    loaded_after(code)

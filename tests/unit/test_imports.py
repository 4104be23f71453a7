"""Who may import whom: the reconstruction runs on the rig, and only one folder knows Mitsuba."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from reconstruction import Capture, write_capture

ROOT = Path(__file__).parents[2]
RENDERERS = {"mitsuba", "drjit"}
ON_THE_RIG = {"numpy", "scipy", "h5py", "matplotlib", "rich"}
FORBIDDEN_ON_THE_RIG = RENDERERS | {"spisim", "trimesh", "pydantic", "yaml", "typer"}


def imported(source: str) -> Iterator[str]:
    """Top-level names of all modules that a source imports, wherever and however it does."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield str(node.module).partition(".")[0]
        elif isinstance(node, ast.Call):
            function = node.func
            name = getattr(function, "attr", None) or getattr(function, "id", None)
            if name in {"import_module", "__import__"} and node.args:
                argument = node.args[0]
                if isinstance(argument, ast.Constant):
                    yield str(argument.value).partition(".")[0]


@pytest.mark.parametrize(
    "source",
    [
        "import mitsuba as mi",
        "import numpy, mitsuba.scalar_rgb",
        "from mitsuba import Float",
        "def f():\n    from mitsuba.llvm import Float",
        "import importlib\nimportlib.import_module('mitsuba')",
        "__import__('mitsuba')",
        "if TYPE_CHECKING:\n    import mitsuba",
    ],
)
def test_every_form_of_import_is_seen(source: str) -> None:
    assert "mitsuba" in set(imported(source))


def test_relative_imports_and_words_are_no_imports() -> None:
    assert set(imported("from .mitsuba import x\ny = 'import mitsuba'")) == set()


def modules(*folders: str) -> list[Path]:
    found = [path for folder in folders for path in sorted((ROOT / folder).rglob("*.py"))]
    assert found
    return found


@pytest.mark.parametrize("path", modules("reconstruction"), ids=lambda p: str(p.relative_to(ROOT)))
def test_reconstruction_needs_few_packages(path: Path) -> None:
    foreign = set(imported(path.read_text(encoding="utf-8"))) - sys.stdlib_module_names
    assert foreign <= ON_THE_RIG


def test_the_readme_names_what_a_rig_needs() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    sentence = re.search(r"`python -m reconstruction capture\.h5[^.]*` needs ([^.]*), but", readme)
    assert sentence is not None
    assert set(re.findall(r"\w+", sentence[1].lower())) - {"and"} == ON_THE_RIG


@pytest.mark.parametrize("path", modules("spisim"), ids=lambda p: str(p.relative_to(ROOT)))
def test_only_transport_imports_the_renderer(path: Path) -> None:
    if ROOT / "spisim" / "transport" not in path.parents:
        assert not RENDERERS & set(imported(path.read_text(encoding="utf-8")))


def test_a_reconstruction_run_loads_no_simulator(capture: Capture, tmp_path: Path) -> None:
    write_capture(capture, tmp_path / "capture.h5")
    code = f"""
import runpy, sys
sys.argv = ["reconstruction", {str(tmp_path / "capture.h5")!r}, "-o", {str(tmp_path)!r}]
try:
    runpy.run_module("reconstruction", run_name="__main__")
except SystemExit as stop:
    assert not stop.code, stop.code
loaded = {{name.partition(".")[0] for name in sys.modules}}
assert not loaded & {FORBIDDEN_ON_THE_RIG!r}, loaded & {FORBIDDEN_ON_THE_RIG!r}
"""
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    assert (tmp_path / "depth.png").exists()

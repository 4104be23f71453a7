"""What is released, as a stranger has it: wheel and sdist, outside of the repository; its types."""

import importlib
import os
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPT = """
import numpy as np

import reconstruction
import spisim

scene = spisim.load_scene("target-plane")
instrument = spisim.load_instrument("paper")
simulation: spisim.Simulation = spisim.simulate(scene, instrument, spp=4, seed=0)
capture: reconstruction.Capture = simulation.capture
result = reconstruction.reconstruct(capture, image="zero-filled")
image: np.ndarray[tuple[int, ...], np.dtype[np.float32]] = result.image
depth_m = result.depth_m
assert depth_m is not None and image.shape == depth_m.shape == (64, 64)
spisim.write_report("report.html", capture, result)
told: str = f"{result.frame} {capture.frames} {spisim.__version__}"
print(told)
"""


def without_this_repository() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a wheel and an sdist."""
    folder = tmp_path_factory.mktemp("built")
    pytest.importorskip("build")
    command = [sys.executable, "-m", "build", "--outdir", str(folder), str(ROOT)]
    subprocess.run(command, check=True, capture_output=True)
    return folder


@pytest.mark.slow
def test_wheel_and_sdist_hold_all_that_is_needed(built: Path) -> None:
    (wheel,) = built.glob("*.whl")
    (sdist,) = built.glob("*.tar.gz")
    packed = set(zipfile.ZipFile(wheel).namelist())
    assert {
        "spisim/py.typed",
        "reconstruction/py.typed",
        "spisim_app/py.typed",
        "spisim_app/report/templates/capture.html",
        "spisim_app/report/plots.mplstyle",
        "spisim_live/py.typed",
        "spisim/shipped/scenes/warehouse.yaml",
        "spisim/shipped/studies/depth.yaml",
    } <= packed
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {"CHANGELOG.md", "CITATION.cff", "LICENSE", "pyproject.toml", "README.md"} <= names


@pytest.mark.slow
def test_the_wheel_of_the_rig_holds_live_streams_and_their_commands(tmp_path: Path) -> None:
    pytest.importorskip("build")
    command = [sys.executable, "-m", "build", "--wheel", "--outdir", str(tmp_path)]
    subprocess.run([*command, str(ROOT / "reconstruction")], check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as packed:
        names = set(packed.namelist())
        (points,) = (name for name in names if name.endswith("entry_points.txt"))
        entries = packed.read(points).decode()
    assert "live = spisim_live.cli:live" in entries
    assert "mcap = spisim_live.ros.mcap:EXPORT" in entries
    assert {
        "reconstruction/py.typed",
        "reconstruction/depth/completion/fitted.json",
        "reconstruction/image/learned.npz",
        "spisim_live/cli/live.py",
        "spisim_live/py.typed",
    } <= names
    assert {name.partition("/")[0] for name in names if name.endswith(".py")} == {
        "reconstruction",
        "spisim_live",
    }


@pytest.fixture(scope="module")
def python(built: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An interpreter that has the wheel; its dependencies are those that are here already."""
    (wheel,) = built.glob("*.whl")
    folder = tmp_path_factory.mktemp("installed") / "venv"
    venv.create(folder, with_pip=True, system_site_packages=False)
    python = folder / "bin" / "python"
    install = [str(python), "-m", "pip", "install", "--quiet", "--no-deps", str(wheel)]
    subprocess.run(install, check=True, env=without_this_repository())
    here = [path for path in sys.path if path.endswith("site-packages")]
    (site,) = (folder / "lib").glob("python*/site-packages")
    (site / "here.pth").write_text("\n".join(here))
    return python


def said(*command: str | Path, folder: Path) -> str:
    """What a command prints that runs outside of the repository."""
    run = subprocess.run(
        [str(word) for word in command],
        cwd=folder,
        env=without_this_repository(),
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    return run.stdout


@pytest.mark.slow
def test_the_wheel_works_outside_of_the_repository(python: Path, tmp_path: Path) -> None:
    where = said(python, "-c", "import spisim; print(spisim.__file__)", folder=tmp_path)
    assert where.startswith(str(python.parents[1]))
    (tmp_path / "script.py").write_text(SCRIPT)
    assert said(python, "script.py", folder=tmp_path)
    assert said(python, "-m", "spisim", "--version", folder=tmp_path).startswith("spisim ")
    assert "SOURCE" in said(python, "-m", "reconstruction", "live", "--help", folder=tmp_path)


@pytest.mark.slow
def test_a_users_script_passes_the_strictest_type_check(python: Path, tmp_path: Path) -> None:
    (tmp_path / "script.py").write_text(SCRIPT)
    mypy = [sys.executable, "-m", "mypy", "--strict", "--no-incremental"]
    said(*mypy, "--python-executable", python, "script.py", folder=tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("package", ["spisim", "reconstruction"])
def test_tab_in_a_fresh_interpreter_lists_the_api(
    python: Path, package: str, tmp_path: Path
) -> None:
    ask = f"""
import rlcompleter, {package}
complete = rlcompleter.Completer(dict({package}={package})).complete
words = []
while (word := complete("{package}.", len(words))) is not None:
    words.append(word)
print(*words)
"""
    reported = {word.rstrip("()") for word in said(python, "-c", ask, folder=tmp_path).split()}
    names = set(importlib.import_module(package).__all__) - {"__version__"}
    assert {f"{package}.{name}" for name in names} <= reported

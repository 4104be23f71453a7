"""What is found by name: files of a folder, entry points of other packages, and clashes."""

import importlib
import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from plugins import install
from reconstruction import Capture, InputError, write_capture
from reconstruction.base.registry import Registry
from reconstruction.capture import READINGS, Spots
from reconstruction.depth import DEPTH_METHODS
from reconstruction.image import DICTIONARIES, IMAGE_METHODS
from reconstruction.operators import BASES, ORDERS, Basis
from reconstruction.ranging import RANGING_METHODS

GROUP = "tests.tools"


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder that Python imports from, with a package of tools in it."""
    tools = tmp_path / "tools_of_tests"
    (tools / "folder").mkdir(parents=True)
    for name in ("saw", "cross_cut_saw", "_shared", "folder/__init__"):
        (tools / f"{name}.py").write_text(f"TOOL = {name!r}\n")
    (tools / "__init__.py").touch()
    monkeypatch.syspath_prepend(tmp_path)
    importlib.invalidate_caches()
    yield tmp_path
    for name, module in list(sys.modules.items()):
        if str(getattr(module, "__file__", None)).startswith(str(tmp_path)):
            del sys.modules[name]


@pytest.fixture
def tools(place: Path) -> Callable[[], Registry[str]]:
    """A registry of the tools, made anew."""

    def make() -> Registry[str]:
        importlib.invalidate_caches()
        return Registry("tool", package="tools_of_tests", attribute="TOOL", group=GROUP)

    return make


def test_own_entries_are_the_modules_by_file_name(tools: Callable[[], Registry[str]]) -> None:
    registry = tools()
    assert list(registry) == ["cross-cut-saw", "saw"]
    assert len(registry) == 2
    assert "cross-cut-saw" in registry
    assert "cross_cut_saw" not in registry
    assert "tools_of_tests.cross_cut_saw" not in sys.modules  # nothing is imported to be listed
    assert registry["cross-cut-saw"] == "cross_cut_saw"
    assert dict(registry) == {"cross-cut-saw": "cross_cut_saw", "saw": "saw"}


@pytest.mark.parametrize("name", ["_shared", "-shared", "folder", "swa", ""])
def test_an_unknown_name_is_told_with_the_nearest(
    tools: Callable[[], Registry[str]], name: str
) -> None:
    with pytest.raises(InputError, match=f"unknown tool '{name}': ") as error:
        tools()[name]
    assert "allowed: cross-cut-saw, saw" in str(error.value)
    assert ("did you mean 'saw'?" in str(error.value)) == (name == "swa")


def test_other_packages_add_theirs_by_name(tools: Callable[[], Registry[str]], place: Path) -> None:
    entries = {GROUP: {"drill": "borers:DRILL", "awl": "borers:AWL"}, "another.group": {"no": "x"}}
    install(place, "borers", entries, "DRILL = 'turns'\nAWL = 'sticks'\n")
    registry = tools()
    assert list(registry) == ["cross-cut-saw", "saw", "awl", "drill"]
    assert "borers" not in sys.modules
    assert registry["drill"] == "turns"
    with pytest.raises(InputError, match="did you mean 'drill'"):
        registry["dril"]


def test_a_name_of_two_packages_is_refused_naming_both(
    tools: Callable[[], Registry[str]], place: Path
) -> None:
    install(place, "turners", {GROUP: {"drill": "turners:DRILL"}}, "DRILL = 1\n")
    install(place, "copiers", {GROUP: {"drill": "copiers:D", "awl": "copiers:A"}}, "A = D = 2\n")
    registry = tools()
    assert list(registry).count("drill") == 1
    with pytest.raises(InputError, match="tool 'drill' is registered by ") as error:
        registry["drill"]
    assert "turners (turners:DRILL)" in str(error.value)
    assert "copiers (copiers:D)" in str(error.value)
    assert registry["awl"] == 2


def test_a_name_of_our_own_is_not_replaced(tools: Callable[[], Registry[str]], place: Path) -> None:
    install(place, "better", {GROUP: {"saw": "better:SAW"}}, "SAW = 'sharp'\n")
    registry = tools()
    assert list(registry) == ["cross-cut-saw", "saw"]
    with pytest.raises(InputError, match=r"registered by tools_of_tests and by better \(better:S"):
        registry["saw"]


def test_a_package_brings_all_of_its_modules(
    tools: Callable[[], Registry[str]], place: Path
) -> None:
    shed = place / "shed"
    shed.mkdir()
    for name in ("__init__", "garden_fork", "spade", "_shared"):
        (shed / f"{name}.py").write_text(f"TOOL = {name!r}\n")
    install(place, "gardeners", {GROUP: {"garden": "shed"}})
    registry = tools()
    assert list(registry) == ["cross-cut-saw", "saw", "garden-fork", "spade"]
    assert "shed.spade" not in sys.modules
    assert registry["garden-fork"] == "garden_fork"
    (shed / "saw.py").write_text("TOOL = 'blunt'\n")
    with pytest.raises(InputError, match="registered by tools_of_tests and by gardeners"):
        tools()["saw"]


def test_a_package_that_cannot_be_imported_is_warned_of_and_others_go_on(
    tools: Callable[[], Registry[str]], place: Path
) -> None:
    install(place, "fallen", {GROUP: {"garden": "fallen"}}, "raise RuntimeError('rot')\n")
    install(place, "borers", {GROUP: {"drill": "borers:DRILL"}}, "DRILL = 'turns'\n")
    with pytest.warns(UserWarning, match=r"tools of fallen \(fallen\) cannot be .*Error: rot"):
        names = list(tools())
    assert names == ["cross-cut-saw", "saw", "drill"]


def test_a_registry_without_entries_says_what_to_install(place: Path) -> None:
    registry: Registry[str] = Registry("tool", attribute="TOOL", group=GROUP, hint="buy some")
    with pytest.raises(InputError, match="unknown tool 'saw': there is none; buy some"):
        registry["saw"]


@pytest.mark.parametrize(
    ("source", "reason"),
    [
        ("", "AttributeError: .*no attribute 'DRILL'"),
        ("import nothing_of_this_name\n", "ModuleNotFoundError: No module named 'nothing_of"),
        ("raise RuntimeError('no licence')\n", "RuntimeError: no licence"),
    ],
)
def test_an_entry_that_cannot_be_loaded_is_told_with_its_package(
    tools: Callable[[], Registry[str]], place: Path, source: str, reason: str
) -> None:
    install(place, "worn", {GROUP: {"drill": "worn:DRILL"}}, source)
    registry = tools()
    assert registry["saw"] == "saw"
    with pytest.raises(InputError, match=rf"tool 'drill' of worn \(worn:DRILL\) .*: {reason}"):
        registry["drill"]


@pytest.mark.parametrize(
    ("registry", "names", "fits"),
    [
        (IMAGE_METHODS, {"pursuit", "zero-filled"}, lambda result: result.title and result.compile),
        (
            DEPTH_METHODS,
            {"anchored", "nearest", "dense"},
            lambda result: result.title and result.needs,
        ),
        (
            RANGING_METHODS,
            {"cw", "pulsed", "dtof", "fog", "fog-carried"},
            lambda result: all(issubclass(kind, Spots) for kind in np.atleast_1d(result.reads)),
        ),
        (READINGS, {"cw", "pulsed", "dtof"}, lambda result: issubclass(result, Spots)),
        (
            DICTIONARIES,
            {"dct", "haar", "db4", "learned"},
            lambda result: len(result.bands((4, 8))[0].vertical) == 4,
        ),
        (
            BASES,
            {"hadamard", "dense", "fourier", "scrambled"},
            lambda result: issubclass(result, Basis),
        ),
        (ORDERS, {"natural", "cake-cutting", "random"}, callable),
    ],
    ids=lambda value: getattr(value, "kind", ""),
)
def test_every_entry_of_the_stations_is_what_it_must_be(
    registry: Registry[Any], names: set[str], fits: Callable[[Any], bool]
) -> None:
    assert set(registry) >= names
    assert all(fits(result) for result in registry.values())


@pytest.mark.parametrize("registry", [READINGS, BASES], ids=lambda registry: registry.kind)
def test_what_files_name_is_named_as_its_file(registry: Registry[Any]) -> None:
    key = "method" if registry is READINGS else "name"
    assert all(getattr(result, key) == name for name, result in registry.items())


METHODS = """
import numpy as np

from reconstruction.depth import DepthEstimate
from reconstruction.image import Estimate

class Grey:
    title = "all grey"
    def compile(self, operator):
        return lambda coefficients: Estimate(np.full(operator.image_shape, 3.0))

GREY = Grey()

class Flat:
    title = "flat wall"
    needs = ("spots",)
    def compile(self, context):
        shape = context.setup.plan.shape
        return lambda view: DepthEstimate(np.full(shape, np.nanmean(view.ranges.range_m)))

FLAT = Flat()
"""


def test_methods_of_another_package_go_through_the_command(
    capture: Capture, tmp_path: Path
) -> None:
    entries = {
        "reconstruction.images": {"grey": "plain:GREY", "broken": "plain:MISSING"},
        "reconstruction.depths": {"flat": "plain:FLAT"},
    }
    install(tmp_path, "plain", entries, METHODS)
    write_capture(capture, tmp_path / "capture.h5")
    code = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r}); "
        "from reconstruction.cli import main; sys.exit(main(sys.argv[1:]))"
    )

    def run(*options: str) -> subprocess.CompletedProcess[str]:
        arguments = [str(tmp_path / "capture.h5"), "-o", str(tmp_path / "out"), "--json", *options]
        return subprocess.run(
            [sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=False
        )

    done = run("--image", "grey,pursuit", "--depth", "flat,nearest")
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    assert report["images"] == ["grey", "pursuit", "zero-filled"]
    assert report["depth_coverage"] == {"flat": 1.0, "nearest": 1.0}
    assert (tmp_path / "out" / "image_pursuit.png").is_file()
    failed = run("--image", "broken")
    assert failed.returncode == 2
    assert "'broken' of plain (plain:MISSING) cannot be loaded" in failed.stderr
    assert "Traceback" not in failed.stderr

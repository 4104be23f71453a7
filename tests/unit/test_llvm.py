"""A working LLVM is found, and one that would abort the process is refused by a message."""

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from reconstruction import InputError
from spisim.base import llvm


@pytest.mark.parametrize(
    ("name", "version"),
    [
        ("libLLVM.so.22.1", 22),
        ("libLLVM.so.19.1", 19),
        ("libLLVM-19.so.1", 19),
        ("libLLVM-15.so", 15),
        ("libLLVM-14.0.6.so.1", 14),
        ("llvm-18/lib/libLLVM.so.1", 18),
        ("opt/llvm@20/lib/libLLVM.dylib", 20),
        ("Cellar/llvm/21.1.2/lib/libLLVM.dylib", 21),
        ("lib/libLLVM.so", None),
        ("lib/libLLVM.dylib", None),
    ],
)
def test_version_is_read_from_name_and_folder(name: str, version: int | None) -> None:
    assert llvm.version_in_name(Path("/nowhere") / name) == version


def test_version_follows_links(tmp_path: Path) -> None:
    (tmp_path / "libLLVM.so.21.1").touch()
    link = tmp_path / "libLLVM.so"
    link.symlink_to("libLLVM.so.21.1")
    assert llvm.version_of(link) == 21


def test_the_library_found_tells_the_version_that_its_name_tells(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv(llvm.VARIABLE, raising=False)
    path = llvm.find_llvm()
    asked = llvm._version_inside(path)
    assert asked is not None
    assert asked >= llvm.MIN_VERSION
    assert llvm.version_in_name(path) in {asked, None}


def test_libraries_of_other_names_are_no_candidates(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("libLLVM.so.22.1", "libLLVM-19.so.1", "libLLVMCore.so.22", "libLLVM-C.so"):
        (tmp_path / name).touch()
    monkeypatch.setattr(llvm, "_folders", lambda: iter([tmp_path]))
    assert [path.name for path in llvm.candidates()] == ["libLLVM.so.22.1", "libLLVM-19.so.1"]


def test_an_old_llvm_alone_is_refused_with_advice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "libLLVM-15.so.1").touch()
    monkeypatch.delenv(llvm.VARIABLE, raising=False)
    monkeypatch.setattr(llvm, "_folders", lambda: iter([tmp_path]))
    with pytest.raises(llvm.LLVMNotFound) as caught:
        llvm.find_llvm()
    assert f"{tmp_path / 'libLLVM-15.so.1'} (version 15)" in str(caught.value)
    assert llvm.advice() in str(caught.value)


def test_nothing_found_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(llvm.VARIABLE, raising=False)
    monkeypatch.setattr(llvm, "_folders", lambda: iter(()))
    with pytest.raises(InputError, match="found none"):
        llvm.find_llvm()


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda folder: folder / "missing.so", "not a file"),
        (lambda folder: folder, "not a file"),
        (lambda folder: _touched(folder / "libsomething.so"), "not an LLVM library"),
        (lambda folder: _touched(folder / "libLLVM-15.so.1"), "which is LLVM 15"),
    ],
)
def test_an_unusable_library_named_by_the_variable_is_refused(
    make: object, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert callable(make)
    path = make(tmp_path)
    monkeypatch.setenv(llvm.VARIABLE, str(path))
    with pytest.raises(llvm.LLVMNotFound, match=reason) as caught:
        llvm.find_llvm()
    assert llvm.VARIABLE in str(caught.value)
    assert str(path) in str(caught.value)


def fresh_python(code: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run code in a Python of its own that has been told nothing of LLVM but `variables`."""
    environment = {name: text for name, text in os.environ.items() if name != llvm.VARIABLE}
    return subprocess.run(
        [sys.executable, "-c", code],
        env=environment | variables,
        capture_output=True,
        text=True,
        check=False,
    )


ACTIVATE = "from spisim.transport.backend import activate; print(activate())"
KERNEL = """
import drjit as dr
from drjit.auto import Float
assert dr.sum(dr.minimum(dr.arange(Float, 64), 1.0))[0] == 63.0
"""


def test_a_bad_variable_gives_a_message_and_no_abort(tmp_path: Path) -> None:
    old = _touched(tmp_path / "libLLVM-15.so.1")
    run = fresh_python(ACTIVATE, **{llvm.VARIABLE: str(old)})
    if "cuda" in run.stdout:
        pytest.skip("light is traced on the GPU here")
    assert run.returncode == 1
    assert "which is LLVM 15" in run.stderr


@pytest.mark.parametrize(
    "first",
    [
        "import spisim, drjit, mitsuba",
        "import mitsuba; mitsuba.set_variant('llvm_ad_mono')",
        pytest.param("import drjit, spisim", marks=pytest.mark.slow),
        pytest.param("import mitsuba, spisim, drjit", marks=pytest.mark.slow),
    ],
)
def test_any_order_of_imports_works_or_is_told_truly(first: str) -> None:
    """Only where Dr.Jit came first may it have loaded an old LLVM; the advice then helps."""
    run = fresh_python(f"{first}\n{ACTIVATE}{KERNEL}")
    if run.returncode == 0:
        return
    assert not first.startswith("import spisim"), run.stderr
    assert "import spisim before mitsuba and drjit" in run.stderr
    advised = run.stderr.strip().rpartition(f"{llvm.VARIABLE}=")[2]
    run = fresh_python(f"{first}\n{ACTIVATE}{KERNEL}", **{llvm.VARIABLE: advised})
    assert run.returncode == 0, run.stderr


def test_a_library_that_the_user_names_goes_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = _touched(tmp_path / "libLLVM.so.22.1")
    monkeypatch.setenv(llvm.VARIABLE, str(own))
    llvm.prefer_working_llvm()
    assert os.environ[llvm.VARIABLE] == str(own)


def test_the_trial_kernel_runs_with_the_library_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(llvm.VARIABLE, raising=False)
    assert llvm.probe(llvm.find_llvm()) is None


def test_the_trial_kernel_tells_what_fails(tmp_path: Path) -> None:
    problem = llvm.probe(_touched(tmp_path / "libLLVM.so.22.1"))
    assert problem is not None
    assert "the trial kernel" in problem


def _touched(path: Path) -> Path:
    path.touch()
    return path


def test_a_process_forked_after_cuda_was_used_is_told_so(monkeypatch: pytest.MonkeyPatch) -> None:
    from spisim.transport import backend

    monkeypatch.setattr(backend, "mi", SimpleNamespace(variant=lambda: backend.CUDA_VARIANT))
    monkeypatch.setattr(backend, "_user_of_cuda", {})
    assert backend.activate() == backend.activate() == backend.CUDA_VARIANT
    child = os.getpid() + 1
    monkeypatch.setattr(backend.os, "getpid", lambda: child)
    with pytest.raises(InputError, match=r"forked from one that uses CUDA.*spawn"):
        backend.activate()


def test_an_interruption_while_a_loop_is_traced_stays_one() -> None:
    from spisim.transport.backend import with_backend

    @with_backend
    def traced(cause: BaseException) -> None:
        raise RuntimeError("dr.while_loop(): encountered an exception") from cause

    with pytest.raises(KeyboardInterrupt):
        traced(KeyboardInterrupt())
    with pytest.raises(RuntimeError):
        traced(ValueError())

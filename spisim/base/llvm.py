"""Find an LLVM library that works with Dr.Jit before Dr.Jit loads one that does not.

Dr.Jit loads a system library on import. LLVM 14 to 16 abort the process on machines with AVX-512
("Cannot select: fminimum"), so versions are determined here without loading the library.
"""

import ctypes
import importlib.metadata
import logging
import os
import re
import subprocess
import sys
import sysconfig
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from reconstruction.base.errors import InputError
from spisim.base.home import home

logger = logging.getLogger(__name__)

VARIABLE = "DRJIT_LIBLLVM_PATH"
MIN_VERSION = 19  # 19 and 22 work, 14 to 16 abort, 17 and 18 are untried
WHEEL = "karellen-llvm-core"
# Filled by `spisim doctor --install-llvm`.
PRIVATE_FOLDER = Path(sys.prefix).resolve() / "lib" / "llvm"
#: Cache of compiled kernels of Dr.Jit.
KERNELS = home() / ".drjit"

_LIBRARY_NAME = re.compile(r"libLLVM(-\d[\d.]*)?\.(so[\d.]*|dylib)")
_VERSION_IN_NAME = re.compile(r"libLLVM-(\d{2,})|libLLVM\.so\.(\d{2,})")
_VERSION_IN_FOLDER = re.compile(r"llvm[-@/](\d{2,})")
_SYSTEM_FOLDERS = (
    f"usr/lib/{sysconfig.get_config_var('MULTIARCH')}",
    "usr/lib",
    "usr/lib64",
    "usr/local/lib",
    "usr/lib/llvm-*/lib",
    "usr/lib64/llvm*/lib",
    "opt/homebrew/opt/llvm*/lib",
    "usr/local/opt/llvm*/lib",
)

_ASK_VERSION = """
import ctypes, sys
library = ctypes.CDLL(sys.argv[1])
numbers = [ctypes.c_uint() for _ in range(3)]
if hasattr(library, "LLVMGetVersion"):
    library.LLVMGetVersion(*map(ctypes.byref, numbers))
print(numbers[0].value)
"""

_PROBE = """
import drjit as dr
from drjit.llvm import Float
assert dr.sum(dr.minimum(dr.arange(Float, 64), 1.0))[0] == 63.0
"""


class LLVMNotFound(InputError):
    """No usable LLVM library; the message lists those present and how to get one."""


def find_llvm() -> Path:
    """Path of `DRJIT_LIBLLVM_PATH` if set, else the first usable library; LLVMNotFound if none."""
    if chosen := os.environ.get(VARIABLE):
        return _checked(Path(chosen))
    rejected = []
    for path in candidates():
        version = version_of(path)
        if version is not None and version >= MIN_VERSION:
            return path
        rejected.append(f"{path} (version {version or 'unknown'})")
    versions = "found only " + ", ".join(rejected) if rejected else "found none"
    raise LLVMNotFound(
        f"LLVM {MIN_VERSION} or newer is needed to trace light; {versions}.\n{advice()}"
    )


def prefer_working_llvm() -> None:
    """Make Dr.Jit load a working LLVM on import, if there is one and the user names none."""
    if not os.environ.get(VARIABLE):
        try:
            os.environ[VARIABLE] = str(find_llvm())
        except LLVMNotFound as error:
            logger.debug("%s", error)
    if Path(os.environ.get(VARIABLE, "")).parent == PRIVATE_FOLDER:
        _preload(PRIVATE_FOLDER)


def candidates() -> Iterator[Path]:
    """All LLVM libraries on this machine: most trusted folder first, newest version first."""
    seen = set()
    for folder in _folders():
        libraries = [p for p in folder.glob("libLLVM*") if _LIBRARY_NAME.fullmatch(p.name)]
        for path in sorted(libraries, key=lambda p: version_in_name(p) or 0, reverse=True):
            file = path.resolve()
            if file.is_file() and file not in seen:
                seen.add(file)
                yield file


def version_of(path: Path) -> int | None:
    """Major version of an LLVM library, or None if unknown."""
    return version_in_name(path) or _version_inside(path)


def version_in_name(path: Path) -> int | None:
    """Major version in the name or folder of a library, with links resolved."""
    file = path.resolve()
    match = (
        _VERSION_IN_NAME.search(path.name)
        or _VERSION_IN_NAME.search(file.name)
        or _VERSION_IN_FOLDER.search(str(file.parent))
    )
    return int(next(filter(None, match.groups()))) if match else None


def probe(path: Path) -> str | None:
    """Run a small kernel with this library in another process: None if it works, else the error."""
    environment = os.environ | {VARIABLE: str(path)}
    if path.parent == PRIVATE_FOLDER:
        environment["LD_LIBRARY_PATH"] = str(PRIVATE_FOLDER)
    run = _python(_PROBE, environment=environment)
    if run.returncode == 0:
        return None
    lines = [line for line in run.stderr.splitlines() if line.strip()]
    reason = next((line for line in lines if "LLVM ERROR" in line), lines[-1] if lines else "")
    how = f"was ended by signal {-run.returncode}" if run.returncode < 0 else "failed"
    return f"the trial kernel {how}: {reason.strip()}"


def advice() -> str:
    """How to install a working LLVM on this platform."""
    if sys.platform == "darwin":
        return "To get one: brew install llvm"
    return (
        "To get one on Debian or Ubuntu, without root: spisim doctor --install-llvm\n"
        f"Elsewhere: install LLVM {MIN_VERSION} or newer and set {VARIABLE} to its libLLVM.so."
    )


def _folders() -> Iterator[Path]:
    """Folders that may hold libLLVM."""
    try:
        wheel = importlib.metadata.distribution(WHEEL)
        yield from {
            Path(str(wheel.locate_file(file))).resolve().parent
            for file in wheel.files or ()
            if file.name.startswith("libLLVM")
        }
    except importlib.metadata.PackageNotFoundError:
        pass
    yield PRIVATE_FOLDER
    yield Path(sys.prefix) / "lib"
    for pattern in _SYSTEM_FOLDERS:
        yield from sorted(Path("/").glob(pattern), reverse=True)


def _checked(path: Path) -> Path:
    """Return `path`, a library named by the user, or raise LLVMNotFound."""
    if not path.is_file():
        raise LLVMNotFound(f"{VARIABLE} names {path}, which is not a file. Correct or unset it.")
    version = _version_inside(path) or version_in_name(path)
    if version is None:
        raise LLVMNotFound(f"{VARIABLE} names {path}, which is not an LLVM library. Unset it.")
    if version < MIN_VERSION:
        raise LLVMNotFound(
            f"{VARIABLE} names {path}, which is LLVM {version}; "
            f"{MIN_VERSION} or newer is needed, older ones abort. Correct or unset it."
        )
    return path


@cache
def _version_inside(path: Path) -> int | None:
    """Major version reported by the library itself (LLVM 16 and newer), in another process."""
    run = _python(_ASK_VERSION, str(path), environment=dict(os.environ))
    return int(run.stdout) or None if run.returncode == 0 else None


def _preload(folder: Path) -> None:
    """Load the dependencies of a private libLLVM, which need each other, while more can load."""
    waiting = [p for p in folder.glob("lib*.so*") if not p.name.startswith("libLLVM")]
    while waiting:
        failed = [path for path in waiting if not _load(path)]
        if len(failed) == len(waiting):
            return
        waiting = failed


def _load(path: Path) -> bool:
    try:
        ctypes.CDLL(str(path), mode=ctypes.RTLD_GLOBAL)
    except OSError:
        return False
    return True


def _python(
    code: str, *arguments: str, environment: dict[str, str]
) -> subprocess.CompletedProcess[str]:
    """Run Python code in another process and return its result."""
    return subprocess.run(
        [sys.executable, "-c", code, *arguments],
        env=environment,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )

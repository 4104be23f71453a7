"""Install LLVM from the Debian or Ubuntu archive into the Python environment, without root.

It serves machines without an LLVM wheel, such as 64-bit Arm under Linux.
"""

import re
import shutil
import subprocess
import tempfile
from pathlib import Path

from reconstruction.base.errors import InputError
from spisim.base.llvm import MIN_VERSION, PRIVATE_FOLDER


def install_llvm() -> Path:
    """Download the newest libllvm with its missing dependencies; return its folder.

    Package lists and downloads are kept apart from the system's. Raises InputError without apt, or
    without a recent enough package.
    """
    for program in ("apt-get", "apt-cache", "dpkg"):
        if not shutil.which(program):
            raise InputError(
                f"{program} is missing: this way of installing LLVM is for Debian and Ubuntu. "
                f"Install LLVM {MIN_VERSION} or newer and set DRJIT_LIBLLVM_PATH to its libLLVM"
            )
    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder)
        options = _apt_options(here)
        _run("apt-get", *options, "--quiet=2", "update")
        package = _newest(_run("apt-cache", *options, "search", "--names-only", "^libllvm[0-9]+$"))
        install = ("--quiet=2", "--yes", "--no-install-recommends", "--download-only", "install")
        _run("apt-get", *options, *install, package)
        unpacked = here / "unpacked"
        for archive in here.glob("cache/archives/*.deb"):
            _run("dpkg", "--extract", str(archive), str(unpacked))
        _collect(unpacked, PRIVATE_FOLDER)
    return PRIVATE_FOLDER


def _apt_options(folder: Path) -> list[str]:
    """Return options for lists and downloads in `folder`; installed packages are the system's."""
    settings = {
        "Dir::State": folder / "state",
        "Dir::State::status": "/var/lib/dpkg/status",
        "Dir::Cache": folder / "cache",
        "Debug::NoLocking": "1",
        "APT::Sandbox::User": "",
    }
    for name in ("state/lists/partial", "cache/archives/partial"):
        (folder / name).mkdir(parents=True)
    return [part for key, value in settings.items() for part in ("-o", f"{key}={value}")]


def _newest(listing: str) -> str:
    versions = [int(number) for number in re.findall(r"^libllvm(\d+)\b", listing, re.MULTILINE)]
    if not versions or max(versions) < MIN_VERSION:
        offered = ", ".join(map(str, sorted(versions))) or "none"
        raise InputError(
            f"this release's archive has no LLVM {MIN_VERSION} or newer, only: {offered}. "
            "Its backports may have one, or a newer release of the system"
        )
    return f"libllvm{max(versions)}"


def _collect(unpacked: Path, folder: Path) -> None:
    """Copy the shared libraries of all packages, including links, into one folder."""
    draft = folder.with_name(f".{folder.name}.draft")
    shutil.rmtree(draft, ignore_errors=True)
    draft.mkdir(parents=True)
    for library in unpacked.rglob("lib*.so*"):
        file = library.resolve()
        if not library.is_symlink():
            shutil.copy2(file, draft / file.name)
        elif library.name != file.name and file.is_file():
            (draft / library.name).symlink_to(file.name)
    shutil.rmtree(folder, ignore_errors=True)
    draft.replace(folder)


def _run(*command: str) -> str:
    """Return the output of a program. Raises InputError with its last words if it fails."""
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    if run.returncode != 0:
        words = run.stderr.strip().splitlines() or ["no message"]
        raise InputError(f"{' '.join((command[0], command[-1]))} failed: {words[-1]}")
    return run.stdout

"""`spisim doctor`: check this machine."""

import importlib.metadata
import os
import platform
import re
import sys
import warnings
from typing import Annotated, Any

import typer

from reconstruction.base.registry import Registry
from spisim.base.config import shipped

from .console import messages, print_json, results, say
from .options import Json
from .tables import print_table, word_table

EXAMPLE = "spisim doctor"


def command(
    json: Json = False,
    install_llvm: Annotated[
        bool,
        typer.Option(
            "--install-llvm", help="First install LLVM from the Debian or Ubuntu archive."
        ),
    ] = False,
) -> None:
    """Report the state of this machine; exit 1 if it cannot simulate."""
    if install_llvm:
        from .install_llvm import install_llvm as install

        messages.print("Downloading LLVM …")
        say(f"LLVM is now in {install()}")
    findings = examine()
    if json:
        print_json(findings)
    else:
        _print(findings)
    if findings["problems"]:
        raise typer.Exit(1)


def examine() -> dict[str, Any]:
    """Return all relevant facts about the machine, and a list of problems."""
    llvm, trouble = _llvm()
    gpu = _gpu()
    problems = [*([] if trouble is None or gpu else [trouble]), *_plug_ins()]
    return {
        "ready": not problems,
        "problems": problems,
        "python": platform.python_version(),
        "platform": platform.platform(),
        "cores": len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count(),
        "memory_gib": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30, 1),
        "llvm": llvm,
        "gpu": gpu,
        "cache": _kernel_cache(),
        "shipped": {name: str(shipped(name)) for name in ("scenes", "studies", "examples")},
        "packages": _packages(),
    }


def _llvm() -> tuple[dict[str, Any], str | None]:
    """Return the LLVM library that Dr.Jit will use, and its problem."""
    from spisim.base.llvm import LLVMNotFound, advice, find_llvm, probe, version_of

    try:
        path = find_llvm()
    except LLVMNotFound as error:
        return {"path": None, "version": None}, str(error)
    problem = probe(path)
    library = {"path": str(path), "version": version_of(path)}
    return library, problem and f"LLVM {path}: {problem}\n{advice()}"


def _gpu() -> bool:
    """Return whether Dr.Jit can use a CUDA device."""
    from spisim.transport.backend import has_cuda

    return has_cuda()


def _plug_ins() -> list[str]:
    """Return problems of entries that other packages register."""
    from reconstruction.capture import READINGS
    from reconstruction.depth import DEPTH_METHODS
    from reconstruction.image import DICTIONARIES, IMAGE_METHODS
    from reconstruction.operators import BASES, ORDERS
    from reconstruction.ranging import RANGING_METHODS
    from spisim.atmosphere.sections import WEATHER
    from spisim.dataset.exports import EXPORTS
    from spisim.instrument.sensors import SENSORS
    from spisim.instrument.tofs import TOFS
    from spisim.scene.families import FAMILIES

    methods: tuple[Registry[Any], ...] = (IMAGE_METHODS, RANGING_METHODS, DEPTH_METHODS)
    parts: tuple[Registry[Any], ...] = (DICTIONARIES, READINGS, BASES, ORDERS)
    simulated: tuple[Registry[Any], ...] = (SENSORS, TOFS, WEATHER, FAMILIES, EXPORTS)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for registry in (*methods, *parts, *simulated):
            list(registry.loadable())
    return [str(each.message) for each in caught]


def _kernel_cache() -> dict[str, Any]:
    """Return where Dr.Jit caches compiled kernels; without a cache every run recompiles."""
    from spisim.base.llvm import KERNELS

    nearest = KERNELS if KERNELS.exists() else KERNELS.parent
    return {"path": str(KERNELS), "writable": os.access(nearest, os.W_OK)}


def _packages() -> dict[str, str]:
    """Return versions of spisim and its dependencies."""
    requirements = importlib.metadata.requires("spisim") or []
    needed = [line for line in requirements if "extra" not in line]
    names = [re.split(r"[^\w.-]", line, maxsplit=1)[0] for line in needed]
    versions = {}
    for name in ["spisim", "drjit", *names]:
        try:
            versions[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            versions[name] = "missing"
    return versions


def _print(findings: dict[str, Any]) -> None:
    """Print the findings as text."""
    llvm, cache = findings["llvm"], findings["cache"]
    table = word_table()
    table.add_column(style="dim")
    table.add_column(overflow="fold")
    table.add_row("Python", findings["python"])
    table.add_row("system", findings["platform"])
    table.add_row("machine", f"{findings['cores']} cores, {findings['memory_gib']} GiB")
    table.add_row("LLVM", f"{llvm['version']} in {llvm['path']}" if llvm["path"] else "none usable")
    table.add_row("GPU", "CUDA" if findings["gpu"] else "none; light is traced on the CPU")
    writable = "" if cache["writable"] else " (not writable: every run compiles anew)"
    table.add_row("kernel cache", cache["path"] + writable)
    for name, folder in findings["shipped"].items():
        table.add_row(name, folder)
    table.add_row("packages", ", ".join(f"{n} {v}" for n, v in findings["packages"].items()))
    print_table(table)
    for problem in findings["problems"]:
        say(f"\n{problem}", style="red")
    if findings["ready"]:
        results.print("\nReady.", style="green")

"""Many hostile inputs, tried in processes that may crash, hang or grow and harm nothing."""

import gc
import os
import resource
import signal
import sys
import traceback
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

PER_PROCESS = 250
CPU_SECONDS = 10.0
MEMORY_MB = 1024


def survive(
    attack: Callable[[int], None],
    seeds: Iterable[int],
    *,
    readable: Iterable[Path] = (),
    writable: Iterable[Path] = (),
) -> None:
    """Call `attack(seed)` for all seeds; AssertionError, naming the seed, for the first that harms.

    Harm is an exception, a crash, more than `CPU_SECONDS` of processor time for one seed (without
    the kernel's, which copies pages of a large parent at the pace of the machine), more than
    `MEMORY_MB` beyond what the process held before, or a file opened from Python that lies outside
    the `readable` and `writable` folders (Python's own, libraries and devices aside), or that is
    opened for writing outside the `writable` ones.
    """
    left = list(seeds)
    while left:
        batch, left = left[:PER_PROCESS], left[PER_PROCESS:]
        _in_child(attack, batch, (*readable, *writable), tuple(writable))


def _in_child(
    attack: Callable[[int], None],
    seeds: list[int],
    readable: tuple[Path, ...],
    writable: tuple[Path, ...],
) -> None:
    ours, theirs = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(ours)
        status = 1
        try:
            _attack_all(attack, seeds, theirs, readable, writable)
            status = 0
        except BaseException:
            os.write(theirs, f"!{traceback.format_exc()[-2000:]}".encode())
        finally:
            os._exit(status)
    os.close(theirs)
    with os.fdopen(ours, "rb") as pipe:
        reported = pipe.read().decode(errors="replace")
    _, status = os.waitpid(child, 0)
    progress, _, reason = reported.partition("!")
    if status != 0:
        seed = progress.split()[-1] if progress.split() else "none"
        killed = os.WIFSIGNALED(status) and signal.Signals(os.WTERMSIG(status)).name
        raise AssertionError(f"seed {seed}: {reason or killed or status}")


def _attack_all(
    attack: Callable[[int], None],
    seeds: list[int],
    pipe: int,
    readable: tuple[Path, ...],
    writable: tuple[Path, ...],
) -> None:
    sys.dont_write_bytecode = True  # of modules that the first attack loads
    opened = _watch_files(readable, writable)
    # What the parent holds is not this attack's: no collection of garbage walks it (or copies it).
    gc.freeze()
    signal.signal(signal.SIGVTALRM, signal.SIG_DFL)
    before_mb = _peak_mb()
    for seed in seeds:
        os.write(pipe, f"{seed} ".encode())
        signal.setitimer(signal.ITIMER_VIRTUAL, CPU_SECONDS)
        attack(seed)
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        assert not opened, f"opened {opened}"
        grown_mb = _peak_mb() - before_mb
        assert grown_mb < MEMORY_MB, f"{grown_mb:.0f} MB more than before"


def _peak_mb() -> float:
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 2**20


def _watch_files(readable: tuple[Path, ...], writable: tuple[Path, ...]) -> list[str]:
    """A list that grows with every file opened where none should be."""
    own = (sys.prefix, sys.base_prefix, "/proc", "/dev", "/sys", "/usr", "/etc/mime.types")
    package = str(Path(__file__).parents[1])
    may_read = (*own, package, *(str(folder.resolve()) for folder in readable))
    may_write = ("/dev", *(str(folder.resolve()) for folder in writable))
    result: list[str] = []

    def watch(event: str, arguments: tuple[Any, ...]) -> None:
        if event != "open" or not isinstance(arguments[0], str | bytes | os.PathLike):
            return
        path = os.path.realpath(os.fsdecode(arguments[0]))
        flags = arguments[2] if isinstance(arguments[2], int) else 0
        writes = bool(flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT))
        if not path.startswith(may_write if writes else may_read):
            result.append(path)

    sys.addaudithook(watch)
    return result

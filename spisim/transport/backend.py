"""Choice of the Dr.Jit backend, and of the Mitsuba variant while this package uses it."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from threading import Lock
from typing import Any

import drjit as dr
import mitsuba as mi

from reconstruction.base.arrays import usual_float_errors
from reconstruction.base.errors import InputError
from spisim.base.llvm import KERNELS, MIN_VERSION, VARIABLE, find_llvm

#: One wavelength, just-in-time compiled, on the GPU where there is one.
CUDA_VARIANT = "cuda_ad_mono"
LLVM_VARIANT = "llvm_ad_mono"
OURS = (CUDA_VARIANT, LLVM_VARIANT)

_user_of_cuda: dict[str, int] = {}


def activate() -> str:
    """Select the Mitsuba variant, unless one of ours is active already, and return its name.

    Raises
    ------
    InputError
        If there is neither a CUDA device nor a working LLVM library, or this process was forked
        from one that uses CUDA.
    """
    variant = mi.variant()
    if variant not in OURS:
        variant = CUDA_VARIANT if has_cuda() else LLVM_VARIANT
    if variant == LLVM_VARIANT:
        _check_llvm()
    if variant == CUDA_VARIANT:
        _check_process()
    if variant != mi.variant():
        mi.set_variant(variant)
    return str(variant)


class _Active:
    """Our variant within, which all threads share; the last to leave restores the user's own."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._users = 0
        self._before: str | None = None

    def __enter__(self) -> str:
        with self._lock:
            if self._users == 0:
                self._before = mi.variant()
            variant = activate()
            self._users += 1
        return variant

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._users -= 1
            if self._users == 0 and self._before not in (None, *OURS):
                mi.set_variant(self._before)


active = _Active()


def check_backend() -> None:
    """Raise InputError as `activate`, and leave the user's variant as it is."""
    with active:
        pass


def has_cuda() -> bool:
    """Whether Dr.Jit found a CUDA device."""
    return bool(dr.has_backend(dr.JitBackend.CUDA))


def use_threads(count: int) -> None:
    """Set the number of CPU threads that trace light in this process."""
    dr.set_thread_count(count)


def free_memory() -> None:
    """Free the memory that Dr.Jit caches: buffers, and compiled kernels that are also on disk.

    Each kind of surface and medium needs its own kernel, which is cached with its source.
    """
    dr.flush_malloc_cache()
    if os.access(KERNELS, os.W_OK):
        dr.flush_kernel_cache()


@contextmanager
def compiling_timed(seconds: dict[str, float], name: str) -> Iterator[None]:
    """Record the time spent compiling kernels that are not on disk yet, as `name` of `seconds`."""
    dr.kernel_history_clear()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        yield
        kernels = dr.kernel_history([dr.KernelType.JIT])
    seconds[name] = sum(kernel["backend_time"] for kernel in kernels) / 1000


def _check_process() -> None:
    """Raise InputError in a forked process: CUDA works only in the process that first used it."""
    if _user_of_cuda.setdefault("pid", os.getpid()) != os.getpid():
        raise InputError(
            "this process was forked from one that uses CUDA and cannot use CUDA itself: start "
            "processes by 'spawn', as in DataLoader(…, multiprocessing_context=\"spawn\"), or read "
            "samples that already exist"
        )


def _check_llvm() -> None:
    """Check the LLVM library that Dr.Jit has loaded; an old one may abort the process."""
    loaded = "no LLVM"
    if dr.has_backend(dr.JitBackend.LLVM):
        version = dr.detail.llvm_version()
        if version[0] >= MIN_VERSION:
            return
        loaded = f"LLVM {'.'.join(map(str, version))}, which aborts on many machines"
    wanted = find_llvm()
    raise InputError(
        f"Dr.Jit has loaded {loaded}: import spisim before mitsuba and drjit, or start Python with "
        f"{VARIABLE}={wanted}"
    )


def with_backend(function: Callable[..., Any]) -> Callable[..., Any]:
    """Decorate an entry point of this package that needs Mitsuba, in a variant of our own."""

    @wraps(function)
    @usual_float_errors
    def wrapper(*args: Any, **kwargs: Any) -> Any:
        try:
            with active:
                return function(*args, **kwargs)
        except RuntimeError as error:  # Dr.Jit's, of an interruption while a loop is traced
            if isinstance(error.__cause__, KeyboardInterrupt):
                raise KeyboardInterrupt from None
            raise

    return wrapper

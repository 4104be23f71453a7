"""Depth methods, one module each."""

from collections.abc import Callable

from ...base.errors import InputError
from ...base.registry import Registry
from ...capture import Setup
from ..method import DepthMethod, Need

DEPTH_METHODS: Registry[DepthMethod] = Registry(
    "depth method", package=__name__, attribute="METHOD", group="reconstruction.depths"
)


def depth_method(name: str, setup: Setup, own: DepthMethod | None = None) -> DepthMethod:
    """Return a depth method by name.

    Parameters
    ----------
    name
        Entry of `DEPTH_METHODS`.
    setup
        Setup of the recording it is for.
    own
        Unregistered method to take instead.

    Raises
    ------
    InputError
        If the name is unknown, or the recording lacks what the method needs.
    """
    method = DEPTH_METHODS[name] if own is None else own
    missing = lacks(method, setup)
    if missing:
        parts = " and ".join(part.replace("_", " ") for part in missing)
        raise InputError(f"depth method {name!r} needs {parts}, which the recording lacks")
    return method


def lacks(method: DepthMethod, setup: Setup) -> tuple[Need, ...]:
    """Parts that a method needs and a recording lacks."""
    return tuple(need for need in method.needs if getattr(setup, need) is None)


def suits(method: DepthMethod, setup: Setup) -> bool:
    """Whether a recording has all parts that a method needs."""
    return not lacks(method, setup)


def out_of_distribution(method: DepthMethod, setup: Setup) -> str | None:
    """Why a recording is out of the distribution of a method that has such a check, else None."""
    check: Callable[[Setup], str | None] | None = getattr(method, "out_of_distribution", None)
    return None if check is None else check(setup)

"""Methods of making depth maps, one module each."""

from collections.abc import Callable

from ...base.errors import InputError
from ...base.registry import Registry
from ...capture import Setup
from ...capture.spots import check_four
from ..method import DepthMethod, Need

DEPTH_METHODS: Registry[DepthMethod] = Registry(
    "depth method", package=__name__, attribute="METHOD", group="reconstruction.depths"
)


def depth_method(name: str, setup: Setup, own: DepthMethod | None = None) -> DepthMethod:
    """Return ``own``, or the method of this name; InputError if the recording lacks its needs."""
    method = DEPTH_METHODS[name] if own is None else own
    missing = lacks(method, setup)
    if missing:
        parts = " and ".join(part.replace("_", " ") for part in missing)
        raise InputError(f"depth method {name!r} needs {parts}, which the recording lacks")
    if "spots" in method.needs:
        check_four(f"depth method {name!r}", setup.spots)
    return method


def lacks(method: DepthMethod, setup: Setup) -> tuple[Need, ...]:
    """What a method needs and a recording has not."""
    return tuple(need for need in method.needs if getattr(setup, need) is None)


def suits(method: DepthMethod, setup: Setup) -> bool:
    """Whether a recording has what a method needs, in the number that it needs."""
    other = "spots" in method.needs and setup.spots is not None and not setup.spots.are_four
    return not (lacks(method, setup) or other)


def out_of_distribution(method: DepthMethod, setup: Setup) -> str | None:
    """Why a method has nothing of its own to tell of a recording, as far as it says; None else.

    A method that was made for some recordings alone tells so by a method of this name.
    """
    reported: Callable[[Setup], str | None] | None = getattr(method, "out_of_distribution", None)
    return None if reported is None else reported(setup)

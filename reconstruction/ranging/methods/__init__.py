"""Ranging methods, one module each; the plain method of a kind of readings has its name."""

from ...base.arrays import usual_float_errors
from ...base.errors import InputError
from ...base.registry import Registry
from ...capture import Spots
from ...capture.schema import between
from ..method import RangingMethod
from ..ranges import MAX_FOG_RANGE_M, Ranges

RANGING_METHODS: Registry[RangingMethod] = Registry(
    "ranging method", package=__name__, attribute="METHOD", group="reconstruction.rangings"
)


def ranging_method(name: str, spots: Spots, own: RangingMethod | None = None) -> RangingMethod:
    """Return ``own``, or the method of this name; InputError if it reads another kind of spots."""
    method = RANGING_METHODS[name] if own is None else own
    if not isinstance(spots, method.reads):
        fitting = [
            name for name, each in RANGING_METHODS.loadable() if isinstance(spots, each.reads)
        ]
        kinds = method.reads if isinstance(method.reads, tuple) else (method.reads,)
        raise InputError(
            f"ranging method {name!r} reads {' and '.join(repr(kind.method) for kind in kinds)} "
            f"spots, not those of "
            f"{spots.method!r}; allowed: {', '.join(fitting)}"
        )
    return method


def reads(name: str, spots: Spots) -> bool:
    """Whether a method understands these readings."""
    return isinstance(spots, RANGING_METHODS[name].reads)


def usual_rangings(spots: Spots) -> tuple[str, ...]:
    """Default methods of these readings: the plain one, preceded by fog ranging unless the air is
    clear.

    Fog ranging is left out for readings of a longer maximum range, which it would cut off.
    """
    fog = RANGING_METHODS["fog"]
    clear = spots.clear_probability == 1
    if not clear and reads("fog", spots) and fog.unambiguous_range_m(spots) <= MAX_FOG_RANGE_M:
        return "fog", spots.method
    return (spots.method,)


@usual_float_errors
def measure_ranges(spots: Spots, frame: int = 0, method: str | None = None) -> Ranges:
    """Ranges of one frame.

    Parameters
    ----------
    spots : Spots
        Readings of a recording.
    frame : int
        Its index.
    method : str, optional
        Name; the plain method of these readings by default. `reconstruction.reconstruct` instead
        defaults to the first of `usual_rangings`.
    """
    solver = ranging_method(method or spots.method, spots).compile(between(spots, 0, 0))
    return solver(between(spots, frame, frame + 1).aimed)

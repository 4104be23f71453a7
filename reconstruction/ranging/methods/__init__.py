"""Methods of ranging, one module each; the one named as a kind of readings is its plain one."""

from ...base.errors import InputError
from ...base.registry import Registry
from ...capture import Spots
from ...capture.schema import between
from ..method import RangingMethod
from ..ranges import LONGEST_IN_FOG_M, Ranges

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
    """The plain method of these readings; before it the one that knows of fog, unless it is clear.

    Readings that tell of targets farther off than drones fly in fog would lose these.
    """
    fog = RANGING_METHODS["fog"]
    clear = spots.clear_probability == 1
    if not clear and reads("fog", spots) and fog.unambiguous_range_m(spots) <= LONGEST_IN_FOG_M:
        return "fog", spots.method
    return (spots.method,)


def measure_ranges(spots: Spots, frame: int = 0, method: str | None = None) -> Ranges:
    """Ranges of one frame by a method, the plain one of these readings where None.

    What a user sees first is the default ranging, of `reconstruction.reconstruct`.
    """
    solver = ranging_method(method or spots.method, spots).compile(between(spots, 0, 0))
    return solver(between(spots, frame, frame + 1))

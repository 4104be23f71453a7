"""Which methods a recording gets: by name, or the usual ones that suit it."""

from collections.abc import Callable, Iterable, Sequence
from itertools import islice

from .base.errors import InputError
from .capture import Setup
from .capture.spots import check_four
from .depth import DEPTH_METHODS, out_of_distribution, suits
from .image import IMAGE_METHODS, CarryingMethod, UsableReadings, image_method
from .ranging import RANGING_METHODS, RangingSolver, ranging_method, reads, usual_rangings
from .result import BASELINE

Names = str | Sequence[str] | None
"""Methods: one, several of which the first is the default, or None, the ``default`` one.

Among several, ``usual`` stands for the default one and those that it is compared with, ``all`` for
those and all that fit. ``all`` has no image methods that carry something from frame to frame: their
images depend on which frames were reconstructed before.
"""

USUAL_IMAGES = ("edge-preserving", "pursuit", BASELINE)
USUAL_DEPTHS = ("learned", "anchored", "nearest", "dense")
WARM_UP = 64
"""Frames before one from which methods that carry something from frame to frame learn."""


def warm_up_frames(frame: int, image: Names = None, ranging: Names = None) -> int:
    """Number of frames before one that methods of these names have to have seen."""
    carried = any(
        carries
        for names, carries_any in ((image, _carries), (ranging, _ranging_carries))
        for carries in map(carries_any, _listed(names, (), (), bool))
    )
    return min(WARM_UP, frame) if carried else 0


def check_names(image: Names, ranging: Names, depth: Names) -> None:
    """Raise InputError for what is no method's name, before there is a recording."""
    for name in _listed(image, (), (), bool):
        image_method(name)
    for methods, names in ((RANGING_METHODS, ranging), (DEPTH_METHODS, depth)):
        for name in _listed(names, (), (), bool):
            methods[name]


def _carries(name: str) -> bool:
    return isinstance(image_method(name), CarryingMethod)


def _ranging_carries(name: str) -> bool:
    return bool(getattr(RANGING_METHODS[name], "carries", False))


def image_names(names: Names, readings: UsableReadings) -> list[str]:
    """Image methods by name, the zero-filled one among them; InputError as of `Reconstructor`."""

    def fits(name: str) -> bool:
        if _carries(name):  # one that cannot be loaded is told
            return False
        try:
            readings.solver(name)
        except InputError:
            return False
        return True

    usual = USUAL_IMAGES if readings.decoder.operator.shape[1] > 1 else (BASELINE,)
    chosen = _listed(names, usual, IMAGE_METHODS, fits)
    if not chosen:
        raise InputError("no image method is named; at least one is needed")
    for name in chosen:
        image_method(name)
    for name in chosen:
        readings.solver(name)
    return list(dict.fromkeys([*chosen, BASELINE]))


def ranging_solvers(names: Names, setup: Setup) -> tuple[dict[str, RangingSolver], dict[str, str]]:
    """Solvers by name, and a note on the plain method where it refuses the recording."""
    spots = setup.spots
    if spots is None:
        for name in _listed(names, (), (), bool):
            RANGING_METHODS[name]  # an unknown one is told first
            raise InputError(f"ranging method {name!r} needs spots, which the recording lacks")
        return {}, {}
    if not spots.are_four:
        for name in _listed(names, (), (), bool):
            RANGING_METHODS[name]
            check_four(f"ranging method {name!r}", spots)
        text = f"left out: methods need 4 spots, the recording has {len(spots.directions)}"
        return {}, {f"ranging {spots.method}": text}
    solvers: dict[str, RangingSolver] = {}
    refused: dict[str, str] = {}

    def fits(name: str) -> bool:
        try:
            if reads(name, spots):
                solvers[name] = RANGING_METHODS[name].compile(spots, setup.optics)
        except InputError as error:
            if name in usual_rangings(spots):
                refused[f"ranging {name}"] = f"left out: {error}"
            return False
        return name in solvers

    chosen = _listed(names, filter(fits, usual_rangings(spots)), RANGING_METHODS, fits)
    return {
        name: solvers.get(name) or ranging_method(name, spots).compile(spots, setup.optics)
        for name in chosen
    }, refused


def left_out(setup: Setup) -> dict[str, str]:
    """Of the usual depth methods those that a recording does not suit, by name, and why."""
    fit = (name for name in USUAL_DEPTHS if suits(DEPTH_METHODS[name], setup))
    reported = {name: out_of_distribution(DEPTH_METHODS[name], setup) for name in fit}
    return {name: why for name, why in reported.items() if why is not None}


def depth_names(names: Names, setup: Setup) -> list[str]:
    """Depth methods by name; InputError for what is no name."""

    def fits(name: str) -> bool:
        return suits(DEPTH_METHODS[name], setup)

    unsuited = left_out(setup)
    usual = [name for name in USUAL_DEPTHS if fits(name) and name not in unsuited]
    return _listed(names, usual, DEPTH_METHODS, fits)


def _listed(
    names: Names, usual: Iterable[str], every: Iterable[str], fits: Callable[[str], bool]
) -> list[str]:
    """Names one by one, with those that "default", "usual" and "all" stand for.

    Of the ``usual`` ones only those are looked at that are needed.
    """
    if not (names is None or isinstance(names, Sequence)):
        raise InputError(f"methods are told by their names, not by {names!r}")
    reported = ["default"] if names is None else [names] if isinstance(names, str) else names
    given = list(islice(usual, None if "usual" in reported or "all" in reported else 1))
    listed: list[str] = []
    for each in reported:
        if each == "default":
            listed += given[:1]
        else:
            listed += given if each in ("usual", "all") else [each]
        listed += filter(fits, every) if each == "all" else []
    return list(dict.fromkeys(listed))

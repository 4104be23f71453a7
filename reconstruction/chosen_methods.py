"""Which methods reconstruct a recording: by name, as objects, or the usual ones that suit it."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any, Protocol

from numpy.typing import NDArray

from .base.arrays import Floats
from .base.errors import InputError
from .base.registry import Registry, check_name
from .capture import Setup
from .depth import DEPTH_METHODS, depth_method, out_of_distribution, suits
from .image import (
    IMAGE_METHODS,
    CarryingMethod,
    Coefficients,
    Estimate,
    ImageSolver,
    UsableReadings,
    image_method,
)
from .operators import MeasurementOperator
from .ranging import RANGING_METHODS, RangingSolver, ranging_method, reads, usual_rangings
from .result import BASELINE


class Method(Protocol):
    """A method given as an object: as `ImageMethod`, `RangingMethod` or `DepthMethod`, with a name.

    ``title``, a few words for plots and tables, is optional.
    """

    @property
    def name(self) -> str:
        """Name in results: letters, digits, ``-``, ``_`` and ``.``."""

    @property
    def compile(self) -> Callable[..., Any]:
        """Function that does what frames share and returns the solver of a frame."""


Methods = str | Method | Sequence[str | Method] | None
"""Methods of one station: one, several of which the first is the default, or None, the default one.

Each is a name or an object. Among several, ``usual`` stands for the default one and those that it
is compared with, ``all`` for those and all others that fit. ``all`` leaves out image methods that
carry state from frame to frame: their images depend on which frames were reconstructed before.
"""

USUAL_IMAGES = ("edge-preserving", "pursuit", BASELINE)
USUAL_DEPTHS = ("flight", "learned", "anchored", "nearest", "dense")
WARM_UP = 64
"""Number of earlier frames from which methods that carry state from frame to frame learn."""

REGISTRIES: Mapping[str, Registry[Any]] = {
    "image": IMAGE_METHODS,
    "ranging": RANGING_METHODS,
    "depth": DEPTH_METHODS,
}
MEMBERS = {
    "image": ("name", "compile"),
    "ranging": ("name", "reads", "compile"),
    "depth": ("name", "needs", "compile"),
}
"""What an object must have to be a method, by station."""


def register(
    *, image: Method | None = None, ranging: Method | None = None, depth: Method | None = None
) -> None:
    """Make methods known by their names until this process ends, as entry points do for good.

    Raises
    ------
    InputError
        If an object is not a method of its station, or its name is taken.
    """
    for station, method in (("image", image), ("ranging", ranging), ("depth", depth)):
        if method is not None:
            _check_method(station, method)
            REGISTRIES[station].register(method.name, method)


@dataclass(frozen=True)
class _Denoiser:
    """An image method that filters the image of another one."""

    function: Callable[[NDArray[Any], Floats | None], Any]
    name: str
    inner: str

    def compile(self, operator: MeasurementOperator) -> ImageSolver:
        solve = image_method(self.inner).compile(operator)

        def denoised(coefficients: Coefficients) -> Estimate:
            estimate = solve(coefficients)
            return Estimate(self.function(estimate.image, estimate.sigma))

        return denoised


def denoiser(
    function: Callable[[NDArray[Any], Floats | None], Any],
    name: str | None = None,
    method: str = "least-squares",
) -> Method:
    """Make an image method of a function that denoises images.

    Parameters
    ----------
    function
        Takes an image (H, W) and its standard deviation (H, W), None where ``method`` states none,
        and returns the denoised image (H, W), all in the unit of the result's images.
    name
        The method's name; the function's own by default.
    method
        Image method whose image is denoised.

    Returns
    -------
    Method
        States no standard deviation: the function's effect on noise is not known.

    Raises
    ------
    InputError
        If the function cannot be called, or there is no such method.
    """
    if not callable(function):
        raise InputError(f"a denoiser is a function of image and sigma, got {function!r}")
    image_method(method)
    chosen = str(name or getattr(function, "__name__", "denoiser"))
    check_name(IMAGE_METHODS.kind, chosen)
    return _Denoiser(function, chosen, method)


def own_methods(station: str, methods: Methods) -> dict[str, Any]:
    """Methods given as objects, by name; InputError for what is neither a name nor a method."""
    own: dict[str, Any] = {}
    for method in _sequence(methods):
        if isinstance(method, str):
            continue
        _check_method(station, method)
        registry, name = REGISTRIES[station], method.name
        if own.get(name, method) is not method:
            raise InputError(f"{registry.kind} {name!r} is given twice, as different objects")
        if name in registry and registry[name] is not method:
            raise InputError(
                f"{registry.kind} {name!r} is registered by {registry.owners(name)} too: "
                f"give {type(method).__qualname__} another name"
            )
        own[name] = method
    return own


def _check_method(station: str, method: Any) -> None:
    members, kind = MEMBERS[station], REGISTRIES[station].kind
    missing = [member for member in members if not hasattr(method, member)]
    if isinstance(method, type) and "compile" not in missing:
        raise InputError(f"{station}: {method.__qualname__} is a class; give an instance of it")
    if missing or not callable(method.compile):
        lacking = " and ".join(missing) or "a compile that can be called"
        hint = "; `denoiser` makes an image method of a function" if callable(method) else ""
        raise InputError(
            f"{station}: {method!r} is neither the name of a method nor a method: it lacks "
            f"{lacking}; {kind}s have {' and '.join(members)}{hint}"
        )
    check_name(kind, method.name)


def carries(
    setup: Setup, *, image: Methods = None, ranging: Methods = None, depth: Methods = None
) -> bool:
    """Whether any of these methods carries state from frame to frame of a recording."""
    if any(isinstance(each, CarryingMethod) for each in _given("image", image)):
        return True
    given = [*_given("ranging", ranging), *_given("depth", depth)]
    if depth is None:
        given += depth_methods(None, setup, ranged=setup.spots is not None).values()
    return any(getattr(each, "carries", False) for each in given)


def warm_up_frames(setup: Setup, frame: int, **methods: Methods) -> int:
    """Number of frames before one that these methods, as of `carries`, must have seen."""
    return min(WARM_UP, frame) if frame and carries(setup, **methods) else 0


def check_methods(image: Methods, ranging: Methods, depth: Methods) -> None:
    """Raise InputError for what is not a method, before there is a recording."""
    for station, methods in (("image", image), ("ranging", ranging), ("depth", depth)):
        for _ in _given(station, methods):
            pass


def _given(station: str, methods: Methods) -> Iterator[Any]:
    """Methods that are named one by one or given as objects."""
    own = own_methods(station, methods)
    find = image_method if station == "image" else REGISTRIES[station].__getitem__
    for name in _listed(methods):
        yield own[name] if name in own else find(name)


def image_names(methods: Methods, readings: UsableReadings) -> list[str]:
    """Names of image methods, the zero-filled one included; InputError as of `Reconstructor`."""

    def fits(name: str) -> bool:
        if isinstance(image_method(name), CarryingMethod):  # raises if it cannot be loaded
            return False
        try:
            readings.solver(name)
        except InputError:
            return False
        return True

    usual = USUAL_IMAGES if readings.decoder.operator.shape[1] > 1 else (BASELINE,)
    chosen = _listed(methods, usual, IMAGE_METHODS, fits)
    if not chosen:
        raise InputError("no image method is named; at least one is needed")
    for name in chosen:
        readings.solver(name)
    return list(dict.fromkeys([*chosen, BASELINE]))


def ranging_solvers(
    methods: Methods, setup: Setup
) -> tuple[dict[str, RangingSolver], dict[str, str]]:
    """Solvers by name, and a note on the plain method where it refuses the recording."""
    spots = setup.spots
    if spots is None:
        for name in _listed(methods):
            raise InputError(f"ranging method {name!r} needs spots, which the recording lacks")
        return {}, {}
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

    own = own_methods("ranging", methods)
    chosen = _listed(methods, filter(fits, usual_rangings(spots)), RANGING_METHODS, fits)
    return {
        name: solvers.get(name)
        or ranging_method(name, spots, own.get(name)).compile(spots, setup.optics)
        for name in chosen
    }, refused


def left_out(setup: Setup) -> dict[str, str]:
    """Usual depth methods that do not suit a recording, by name, and why."""
    fit = (name for name in USUAL_DEPTHS if suits(DEPTH_METHODS[name], setup))
    reasons = {name: out_of_distribution(DEPTH_METHODS[name], setup) for name in fit}
    return {name: why for name, why in reasons.items() if why is not None}


def depth_methods(methods: Methods, setup: Setup, *, ranged: bool) -> dict[str, Any]:
    """Depth methods by name; InputError as of `Reconstructor`.

    Unless the spots can be ``ranged``, methods that need ranges are used only if named.
    """
    usable = setup if ranged else replace(setup, spots=None)

    def fits(name: str) -> bool:
        return suits(DEPTH_METHODS[name], usable)

    unsuited = left_out(usable)
    usual = [name for name in USUAL_DEPTHS if fits(name) and name not in unsuited]
    own = own_methods("depth", methods)
    names = _listed(methods, usual, DEPTH_METHODS, fits)
    return {name: depth_method(name, setup, own.get(name)) for name in names}


def _sequence(methods: Methods) -> Sequence[str | Method]:
    if methods is None:
        return ["default"]
    if isinstance(methods, Sequence) and not isinstance(methods, str):
        return methods
    return [methods]


def _listed(
    methods: Methods,
    usual: Iterable[str] = (),
    every: Iterable[str] = (),
    fits: Callable[[str], bool] = bool,
) -> list[str]:
    """Names one by one, including those that "default", "usual" and "all" stand for.

    Only as many ``usual`` ones are tried as are needed.
    """
    names = [each if isinstance(each, str) else each.name for each in _sequence(methods)]
    given = list(islice(usual, None if "usual" in names or "all" in names else 1))
    listed: list[str] = []
    for each in names:
        if each == "default":
            listed += given[:1]
        else:
            listed += given if each in ("usual", "all") else [each]
        listed += filter(fits, every) if each == "all" else []
    return list(dict.fromkeys(listed))

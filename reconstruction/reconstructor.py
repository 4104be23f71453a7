"""From frames to image, ranges and depth map: compiled once for a recording, called per frame."""

import hashlib
import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from .arrays import Floats
from .capture import Frames, Recording, Setup, datasets
from .depth import (
    DEPTH_METHODS,
    MIN_FREE,
    Context,
    Corridor,
    DepthEstimate,
    View,
    check_min_free,
    depth_method,
    lacks,
    pixel_of,
    pixel_rays,
    unlike,
)
from .errors import InputError
from .image import (
    IMAGE_METHODS,
    CarryingMethod,
    Coefficients,
    Estimate,
    Imaging,
    UsableReadings,
    image_method,
)
from .ranging import (
    RANGING_METHODS,
    Brightness,
    Ranges,
    RangingSolver,
    Status,
    Weather,
    brightness_at,
    range_doubts,
    ranging_method,
    reads,
    usual_rangings,
    with_weather,
)
from .result import BASELINE, Image, Result
from .timing import timed

logger = logging.getLogger(__name__)

Names = str | Sequence[str] | None
"""Methods: one, several of which the first is the default, ``all`` that fit, or the usual ones.

Among several, ``usual`` stands for those. ``all`` has no image methods that carry something from
frame to frame: their images depend on which frames were reconstructed before.
"""

USUAL_IMAGES = ("edge-preserving", "pursuit", BASELINE)
USUAL_DEPTHS = ("learned", "anchored", "nearest", "dense")
LEAD = 64
"""Frames before one from which methods that carry something from frame to frame learn."""


class Reconstructor:
    """Reconstructs frames of one recording, or of others that have the same ``setup``.

    ``image``, ``ranging`` and ``depth`` name methods (see `Names`); by default those are taken that
    fit the recording. The zero-filled image is always among the images: all others are compared
    with it. A name ``method:dictionary`` is an image method with another dictionary than
    its own. ``weather`` is what the user states of it: "clear", "fog", "unknown" or a visibility in
    metres, in place of what the recording states; ranging in fog takes it as its prior, and in
    clear air the plain ranges come first. ``min_free``: an obstacle is where the probability that
    the corridor ahead is free falls below this. Everything that the frames share is computed here;
    the work per frame does not depend on how many there are.

    Raises InputError for unknown names, methods that the recording does not suit, plans that do
    not tell the background, and ``min_free`` that is no probability above 0 and below 1.
    """

    def __init__(
        self,
        setup: Setup,
        *,
        image: Names = None,
        ranging: Names = None,
        depth: Names = None,
        weather: str | float | None = None,
        min_free: float = MIN_FREE,
    ) -> None:
        check_min_free(min_free)
        if weather is not None:
            setup = with_weather(setup, Weather.parsed(weather))
        self.setup, self._min_free = setup, min_free
        self._imaging = Imaging(*setup.plans)
        everything = self._imaging.of(np.ones(setup.plan.exposures, dtype=bool))
        self._images = _image_names(image, everything)
        self._rangings, self._refused = _rangings(ranging, setup)
        context = Context(setup, self._imaging)
        self._depths = {
            name: depth_method(name, setup).compile(context) for name in _depth_names(depth, setup)
        }
        self._corridor: Corridor | None = None
        self._stretch: Image | None = None
        if setup.optics is not None:
            rays = pixel_rays(setup.optics, setup.plan.shape)
            self._corridor = Corridor(rays)
            self._stretch = np.linalg.norm(rays, axis=-1).astype(np.float32)
        logger.info(
            "methods of image: %s; of ranging: %s; of depth: %s",
            *(", ".join(names) or "none" for names in (self._images, self._rangings, self._depths)),
        )

    def __call__(self, frame: Frames) -> Result:
        """Reconstruct one frame; InputError for several, and if nothing in it is usable."""
        if isinstance(frame, Frames) and len(frame) != 1:
            raise InputError(f"{len(frame)} frames: one is needed here; `batch` takes several")
        return self.batch(frame)[0]

    def batch(self, frames: Frames) -> list[Result]:
        """Reconstruct frames; InputError as for one, and where they are of another recording."""
        self._check(frames)
        buckets = frames.buckets
        readings = zip(buckets.signal, buckets.variance, buckets.usable, strict=True)
        return [
            self._frame(frames.between(number, number + 1), *reading)
            for number, reading in enumerate(readings)
        ]

    def _check(self, frames: Frames) -> None:
        if not isinstance(frames, Frames) or not len(frames):
            raise InputError(f"frames of a recording are needed, not {type(frames).__name__}")
        expected, found = (
            (
                f"{exposures} exposures, {type(part.spots).__name__}, "
                f"{'no ' if part.pattern_taps is None else ''}taps of patterns"
            )
            for part, exposures in (
                (self.setup, self.setup.plan.exposures),
                (frames, frames.buckets.counts.shape[1]),
            )
        )
        if found != expected:
            raise InputError(
                f"frames of {found}, compiled for {expected}: they are of another recording"
            )

    def _frame(
        self,
        frame: Frames,
        signal: Floats,
        variance: Floats,
        usable: NDArray[np.bool_],
    ) -> Result:
        timings: dict[str, float] = {}
        with timed(timings, "decoding"):
            readings, spoilt = self._readings(frame.first, signal, usable)
            coefficients = readings.decode(signal, variance)
        for shared in (coefficients.values, coefficients.noise):
            shared.setflags(write=False)  # by methods, one after the other
        varying = readings.decoder.operator.varying
        notes = _note_of_readings(frame.first, spoilt, varying, coefficients)
        images, deviations = {}, {}
        for name in self._images:
            with timed(timings, f"image {name}"):
                estimate = self._image(name, readings, coefficients)
            images[name] = estimate.image
            if estimate.deviation is not None:
                deviations[name] = estimate.deviation
            if estimate.note is not None:
                notes[f"image {name}"] = estimate.note
        brightness = self._brightness(images, deviations, readings)
        rangings: dict[str, Ranges] = {}
        for name, solve in self._rangings.items():
            assert frame.spots is not None
            with timed(timings, f"ranging {name}"):
                rangings[name] = _checked_ranges(name, solve(frame.spots, brightness))
        if frame.spots is not None:
            doubts = range_doubts(rangings, frame.spots)
            notes |= {f"ranging {name}": note for name, note in doubts.items()} | self._refused
        image = next(iter(images.values()))
        image.setflags(write=False)
        view = View(image, next(iter(rangings.values()), None), frame)
        maps: dict[str, DepthEstimate] = {}
        for name, solve_depth in self._depths.items():
            with timed(timings, f"depth {name}"):
                found = solve_depth(view)
            if found is not None:
                maps[name] = _checked_depths(f"depth method {name!r}", found, self._shape)
        notes |= {f"depth {name}": each.note for name, each in maps.items() if each.note}
        logger.debug("frame %d, seconds: %s", frame.first, timings)
        return Result(
            images=_single(images),
            deviations=_single(deviations),
            rangings=rangings,
            depths=_single({name: each.depth_m for name, each in maps.items()}),
            depth_deviations=_single({name: each.deviation for name, each in maps.items()}),
            nothings=_single({name: each.nothing for name, each in maps.items()}),
            free_probabilities=self._free(maps.items()),
            min_free=self._min_free,
            range_over_depth=self._stretch,
            timings_s=timings,
            unit=frame.buckets.unit,
            recording=frame.digest(self.setup),
            frame=frame.first,
            patterns=readings.decoder.index.size,
            notes=notes,
        )

    def _readings(
        self, frame: int, signal: Floats, usable: NDArray[np.bool_]
    ) -> tuple[UsableReadings, NDArray[np.bool_]]:
        """What is compiled for the readings (M,) of a frame, and which of them are spoilt."""
        readings = self._imaging.of(usable, frame)
        spoilt = readings.spoilt(signal)
        if spoilt.any():
            readings = self._imaging.of(usable & ~spoilt, frame)
        if not readings.decoder.index.size:
            raise InputError(
                f"frame {frame}: every pattern rests on a saturated reading, so there is "
                "no image; record again with less light (projector power, exposure time) or a "
                "larger full scale"
            )
        return readings, spoilt

    def _image(self, name: str, readings: UsableReadings, coefficients: Coefficients) -> Estimate:
        who = f"image method {name!r}"
        estimate = readings.solver(name)(coefficients)
        if not isinstance(estimate, Estimate):
            raise InputError(f"{who} gave {type(estimate).__name__}, not an Estimate")
        image = _checked(who, estimate.image, self._shape)
        deviation = estimate.deviation
        if deviation is not None:
            deviation = _checked(f"{who}, of the deviation,", deviation, self._shape)
        for values in (image, *([] if deviation is None else [deviation])):
            if not np.isfinite(values).all():
                raise InputError(f"{who} gave values that are not finite")
        if not readings.decoder.level:  # the darkest pixel is taken to be dark
            image = image - image.min()
        return Estimate(image, deviation, estimate.note)

    def _free(self, maps: Iterable[tuple[str, DepthEstimate]]) -> dict[str, Floats]:
        """Of the corridor ahead by each method, left out where no depth is known at all."""
        stated = {
            name: each.free if self._corridor is None else self._corridor.stated(each)
            for name, each in maps
        }
        return {name: free for name, free in stated.items() if free is not None}

    def _brightness(
        self,
        images: Mapping[str, Floats],
        deviations: Mapping[str, Floats],
        readings: UsableReadings,
    ) -> Brightness | None:
        """What the image by default shows at the spots; None where it has no sigma or level."""
        name = next(iter(images))
        setup = self.setup
        coupled = setup.buckets.baseline_electrons > 0  # then the level of all light is lost
        if (
            setup.optics is None
            or setup.spots is None
            or name not in deviations
            or coupled
            or setup.buckets.unit != "electron"
            or not readings.decoder.level
        ):
            return None
        at = pixel_of(setup.spots.directions, setup.optics, self._shape)
        return brightness_at(at, images[name], deviations[name])

    @property
    def _shape(self) -> tuple[int, int]:
        return self.setup.plan.shape


def reconstruct(
    recording: Recording,
    frame: int = 0,
    *,
    image: Names = None,
    ranging: Names = None,
    depth: Names = None,
    weather: str | float | None = None,
    min_free: float = MIN_FREE,
) -> Result:
    """Reconstruct one frame of a recording; see `Reconstructor`.

    Methods that carry something from frame to frame begin `LEAD` frames before it. Raises
    InputError if there is no such frame or nothing usable in it.
    """
    recording.batch(frame, frame + 1)  # told before any other
    reconstructor = Reconstructor(
        recording.setup,
        image=image,
        ranging=ranging,
        depth=depth,
        weather=weather,
        min_free=min_free,
    )
    for earlier in range(frame - lead(frame, image, ranging), frame):
        reconstructor(recording.batch(earlier, earlier + 1))
    return reconstructor(recording.batch(frame, frame + 1))


def default_ranges(recording: Recording, frame: int = 0) -> Ranges | None:
    """Ranges of one frame as `reconstruct` gives them by default; None where it gives none."""
    setup = recording.setup
    try:
        return _ranging_alone(_Same(setup))(recording.batch(frame, frame + 1)).ranges
    except InputError:
        return None


class _Same:
    """A setup that equals others of the same content."""

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        digest = hashlib.sha256()
        for name, value, _ in datasets(setup.plans, setup):
            digest.update(f"{name} {np.shape(value)} ".encode())
            digest.update(value.encode() if isinstance(value, str) else np.asarray(value).tobytes())
        self._digest = digest.digest()

    def __hash__(self) -> int:
        return hash(self._digest)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and self._digest == other._digest


@lru_cache(maxsize=2)
def _ranging_alone(same: _Same) -> Reconstructor:
    """With the image that ranging looks at, and nothing else."""
    try:
        return Reconstructor(same.setup, image=USUAL_IMAGES[0], depth=())
    except InputError:
        return Reconstructor(same.setup, image=BASELINE, depth=())


def lead(frame: int, image: Names = None, ranging: Names = None) -> int:
    """Number of frames before one that methods of these names have to have seen."""
    carried = any(
        carries
        for names, carries_any in ((image, _carries), (ranging, _ranging_carries))
        for carries in map(carries_any, _listed(names, (), (), bool))
    )
    return min(LEAD, frame) if carried else 0


def _carries(name: str) -> bool:
    return isinstance(image_method(name), CarryingMethod)


def _ranging_carries(name: str) -> bool:
    return bool(getattr(RANGING_METHODS[name], "carries", False))


def _note_of_readings(
    frame: int, spoilt: NDArray[np.bool_], varying: NDArray[np.bool_], found: Coefficients
) -> dict[str, str]:
    """What to say of the readings (M,) of a frame, and of what they tell in ``varying`` (K,)."""
    notes = []
    if spoilt.any():
        why = "what is shown twice differs there (lost, or disturbed?)"
        notes.append(f"without {spoilt.sum()} of its {spoilt.size} readings: {why}")
    ratio = found.signal_over_noise(varying)
    if not found.values[varying].any():
        notes.append("without an image: readings of all its patterns are alike")
    elif ratio is not None and ratio < 1:
        notes.append(
            f"hardly above its noise: signal over noise is about {ratio:.2g} per coefficient"
        )
    return {f"frame {frame}": "; ".join(notes)} if notes else {}


def _image_names(names: Names, readings: UsableReadings) -> list[str]:
    def fits(name: str) -> bool:
        if _carries(name):  # one that cannot be loaded is told
            return False
        try:
            readings.solver(name)
        except InputError:
            return False
        return True

    chosen = _listed(names, USUAL_IMAGES, IMAGE_METHODS, fits)
    if not chosen:
        raise InputError("no image method is named; at least one is needed")
    for name in chosen:
        image_method(name)
    for name in chosen:
        readings.solver(name)
    return list(dict.fromkeys([*chosen, BASELINE]))


def _rangings(names: Names, setup: Setup) -> tuple[dict[str, RangingSolver], dict[str, str]]:
    """Solvers by name, and a note on the plain method where it refuses the recording."""
    spots = setup.spots
    if spots is None:
        for name in _listed(names, (), (), bool):
            RANGING_METHODS[name]  # an unknown one is told first
            raise InputError(f"ranging method {name!r} needs spots, which the recording lacks")
        return {}, {}
    solvers: dict[str, RangingSolver] = {}
    refused: dict[str, str] = {}

    def fits(name: str) -> bool:
        try:
            if reads(name, spots):
                solvers[name] = RANGING_METHODS[name].compile(spots, setup.optics)
        except InputError as error:
            if name == spots.method:
                refused[f"ranging {name}"] = f"left out: {error}"
            return False
        return name in solvers

    usual: list[str] = []
    if names is None or (isinstance(names, Sequence) and ("usual" in names or "all" in names)):
        usual = [name for name in usual_rangings(spots) if fits(name)]
    chosen = _listed(names, usual, RANGING_METHODS, fits)
    return {
        name: solvers.get(name) or ranging_method(name, spots).compile(spots, setup.optics)
        for name in chosen
    }, refused


def left_out(setup: Setup) -> dict[str, str]:
    """Of the usual depth methods those that a recording does not suit, by name, and why."""
    fit = (name for name in USUAL_DEPTHS if not lacks(DEPTH_METHODS[name], setup))
    told = {name: unlike(DEPTH_METHODS[name], setup) for name in fit}
    return {name: why for name, why in told.items() if why is not None}


def _depth_names(names: Names, setup: Setup) -> list[str]:
    def fits(name: str) -> bool:
        return not lacks(DEPTH_METHODS[name], setup)

    unsuited = left_out(setup)
    usual = [name for name in USUAL_DEPTHS if fits(name) and name not in unsuited]
    return _listed(names, usual, DEPTH_METHODS, fits)


def _listed(
    names: Names, usual: Sequence[str], every: Iterable[str], fits: Callable[[str], bool]
) -> list[str]:
    """Names one by one, in place of "usual" the ``usual`` ones, of "all" those that fit too."""
    if not (names is None or isinstance(names, Sequence)):
        raise InputError(f"methods are told by their names, not by {names!r}")
    listed: list[str] = []
    for each in ["usual"] if names is None else [names] if isinstance(names, str) else names:
        listed += usual if each in ("usual", "all") else [each]
        listed += filter(fits, every) if each == "all" else []
    return list(dict.fromkeys(listed))


def _checked(who: str, values: Any, shape: tuple[int, int]) -> Floats:
    """What another's code returned; InputError unless it is an array of real numbers so shaped."""
    array = np.asarray(values)
    if array.shape != shape or array.dtype.kind not in "iuf":
        raise InputError(
            f"{who} gave {array.dtype} of shape {array.shape}; real numbers of {shape} are needed"
        )
    if np.isinf(array).any():
        raise InputError(f"{who} gave values that are not finite")
    return array.astype(np.float64, copy=False)


def _checked_depths(who: str, found: Any, shape: tuple[int, int]) -> DepthEstimate:
    """Depths above 0; with a deviation wherever there is one, and probabilities, if any."""
    if not isinstance(found, DepthEstimate):
        raise InputError(f"{who} gave {type(found).__name__}, not a DepthEstimate")
    depth_m = _checked(who, found.depth_m, shape)
    known = np.isfinite(depth_m)
    if (depth_m[known] <= 0).any():
        raise InputError(f"{who} gave a depth of {depth_m[known].min():g} m")
    deviation, nothing = found.deviation, found.nothing
    if deviation is not None:
        deviation = np.where(known, _checked(f"{who}, of the deviation,", deviation, shape), np.nan)
        if not (deviation[known] >= 0).all():
            raise InputError(f"{who} gave depths with a deviation that is negative or not known")
    if nothing is not None:
        nothing = _checked(f"{who}, of nothing within reach,", nothing, shape)
        if not ((nothing >= 0) & (nothing <= 1)).all():
            raise InputError(f"{who} gave probabilities of nothing within reach beyond 0 to 1")
    return replace(found, depth_m=depth_m, deviation=deviation, nothing=nothing)


def _checked_ranges(name: str, ranges: Any) -> Ranges:
    if not (isinstance(ranges, Ranges) and _are_of_four_spots(ranges)):
        raise InputError(f"ranging method {name!r} gave {type(ranges).__name__}, not four ranges")
    unknown = set(ranges.status) - set(get_args(Status))
    if unknown:
        raise InputError(
            f"ranging method {name!r} gave the status {min(unknown)!r}; allowed: "
            f"{', '.join(get_args(Status))}"
        )
    if not np.isfinite(ranges.range_m[ranges.valid]).all():
        raise InputError(f"ranging method {name!r} gave a range that is not finite as 'ok'")
    return ranges


def _are_of_four_spots(ranges: Ranges) -> bool:
    values = dict(vars(ranges))
    values.pop("fog")
    lists = values.pop("status"), values.pop("alternatives")
    return all(np.shape(v) == (4,) for v in values.values()) and all(len(v) == 4 for v in lists)


def _single(arrays: Mapping[str, Floats | None]) -> dict[str, Image]:
    return {name: array.astype(np.float32) for name, array in arrays.items() if array is not None}

"""From frames to image, ranges and depth map: compiled once for a recording, called per frame."""

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .base.arrays import Floats
from .base.errors import InputError
from .base.timing import timed
from .capture import Frames, Recording, Setup
from .checks import checked, checked_depths, checked_ranges
from .chosen_methods import Names, depth_names, image_names, ranging_solvers, warm_up_frames
from .depth import (
    MIN_FREE,
    Context,
    Corridor,
    DepthEstimate,
    View,
    check_min_free,
    depth_method,
    pixel_of,
    pixel_rays,
)
from .image import (
    Coefficients,
    Estimate,
    Imaging,
    SolverOfMany,
    UsableReadings,
)
from .ranging import (
    Brightness,
    Ranges,
    Weather,
    brightness_at,
    range_consistency,
    with_weather,
)
from .result import Image, Result

logger = logging.getLogger(__name__)


class Reconstructor:
    """Reconstructs frames of one recording, or of others that have the same ``setup``.

    ``image``, ``ranging`` and ``depth`` name methods (see `Names`): of each station the first of
    the usual ones that fits the recording, unless others are named. The zero-filled image is always
    among the images: all others are compared with it. A name ``method:dictionary`` is an image
    method with another dictionary than its own. ``weather`` is what the user states of it: "clear",
    "fog", "unknown" or a visibility in metres, in place of what the recording states; ranging in
    fog takes it as its prior, and in clear air the plain ranges come first. ``min_free``: an
    obstacle is where the probability that the corridor ahead is free falls below this. Everything
    that the frames share is computed here; the work per frame does not depend on how many there
    are.

    ``failed`` hears of a method that raises in a frame, by its station and name, whose result then
    goes without it; unless it is given, the error is the caller's.

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
        failed: Callable[[str, Exception], None] | None = None,
    ) -> None:
        check_min_free(min_free)
        self._failed = failed
        if weather is not None:
            setup = with_weather(setup, Weather.parsed(weather))
        self.setup, self._min_free = setup, min_free
        self._imaging = Imaging(*setup.plans)
        everything = self._imaging.of(np.ones(setup.plan.exposures, dtype=bool))
        self._images = image_names(image, everything)
        self._rangings, self._refused = ranging_solvers(ranging, setup)
        context = Context(setup, self._imaging)
        unranged = f"ranging {setup.spots.method}" in self._refused if setup.spots else False
        ranged = replace(setup, spots=None) if unranged else setup
        self._depths = {
            name: depth_method(name, setup).compile(context) for name in depth_names(depth, ranged)
        }
        self._corridor: Corridor | None = None
        self._stretch: Image | None = None
        if setup.optics is not None:
            rays = pixel_rays(setup.optics, setup.plan.shape)
            self._corridor = Corridor(rays)
            if setup.spots is not None:
                self._spots = pixel_of(setup.spots.directions, setup.optics, setup.plan.shape)
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
        decoded = [
            self._decoded(frames.between(number, number + 1), *each)
            for number, each in enumerate(readings)
        ]
        if len(decoded) > 1:
            self._imaged_together(decoded)
        return [self._frame(each) for each in decoded]

    def _decoded(
        self, frame: Frames, signal: Floats, variance: Floats, usable: NDArray[np.bool_]
    ) -> "_Decoded":
        timings: dict[str, float] = {}
        with timed(timings, "decoding"):
            readings, outliers = self._readings(frame.first, signal, usable)
            coefficients = readings.decode(signal, variance)
        for shared in (coefficients.values, coefficients.noise):
            shared.setflags(write=False)  # by methods, one after the other
        return _Decoded(frame, readings, coefficients, outliers, timings, {})

    def _imaged_together(self, decoded: Sequence["_Decoded"]) -> None:
        """By those methods that are faster with several frames at once."""
        for name in self._images:
            solvers: dict[Any, None] = dict.fromkeys(each.readings.solver(name) for each in decoded)
            for solver in solvers:
                if not isinstance(solver, SolverOfMany):
                    continue
                same = [each for each in decoded if each.readings.solver(name) is solver]
                timings: dict[str, float] = {}
                with timed(timings, "all"):
                    estimates = solver.many([each.coefficients for each in same])
                for each, estimate in zip(same, estimates, strict=True):
                    each.estimates[name] = estimate
                    each.timings[f"image {name}"] = timings["all"] / len(same)

    def _check(self, frames: Frames) -> None:
        if not isinstance(frames, Frames) or not len(frames):
            raise InputError(f"frames of a recording are needed, not {type(frames).__name__}")
        expected, result = (
            (
                f"{exposures} exposures, {type(part.spots).__name__}, "
                f"{'no ' if part.pattern_taps is None else ''}taps of patterns"
            )
            for part, exposures in (
                (self.setup, self.setup.plan.exposures),
                (frames, frames.buckets.counts.shape[1]),
            )
        )
        if result != expected:
            raise InputError(
                f"frames of {result}, compiled for {expected}: they are of another recording"
            )

    def _frame(self, decoded: "_Decoded") -> Result:
        frame, readings, coefficients, outliers, timings, _ = decoded
        varying = readings.decoder.operator.varying & readings.measured
        notes = _note_of_readings(frame.first, outliers, varying, coefficients)
        images, sigmas = self._images_of(decoded, notes)
        brightness = self._brightness(images, sigmas, readings)
        rangings: dict[str, Ranges] = {}
        for name, solve in self._rangings.items():
            assert frame.spots is not None
            with self._contained(f"ranging {name}"), timed(timings, f"ranging {name}"):
                rangings[name] = checked_ranges(name, solve(frame.spots, brightness))
        if frame.spots is not None:
            warnings = range_consistency(rangings, frame.spots)
            notes |= {f"ranging {name}": note for name, note in warnings.items()} | self._refused
            if brightness is None:
                notes |= _notes_without_image(rangings)
        image = next(iter(images.values()))
        image.setflags(write=False)
        view = View(image, next(iter(rangings.values()), None), frame)
        maps: dict[str, DepthEstimate] = {}
        for name, solve_depth in self._depths.items():
            with self._contained(f"depth {name}"), timed(timings, f"depth {name}"):
                result = solve_depth(view)
                if result is not None:
                    maps[name] = checked_depths(f"depth method {name!r}", result, self._shape)
        notes |= {f"depth {name}": each.note for name, each in maps.items() if each.note}
        logger.debug("frame %d, seconds: %s", frame.first, timings)
        return Result(
            images=_single(images),
            sigmas=_single(sigmas),
            rangings=rangings,
            depths=_single({name: each.depth_m for name, each in maps.items()}),
            log_depth_sigmas=_single({name: each.sigma for name, each in maps.items()}),
            no_returns=_single({name: each.no_return for name, each in maps.items()}),
            free_probabilities=self._free(maps.items()),
            min_free=self._min_free,
            range_over_depth=self._stretch,
            timings_s=timings,
            unit=frame.buckets.unit,
            recording=frame.digest(self.setup),
            frame=frame.first,
            patterns=readings.patterns,
            notes=notes,
        )

    @contextmanager
    def _contained(self, method: str) -> Iterator[None]:
        """Tell whoever wants to hear of it what a method raises."""
        try:
            yield
        except Exception as error:
            if self._failed is None:
                raise
            self._failed(method, error)

    def _readings(
        self, frame: int, signal: Floats, usable: NDArray[np.bool_]
    ) -> tuple[UsableReadings, NDArray[np.bool_]]:
        """What is compiled for the readings (M,) of a frame, and which of them are spoilt."""
        readings = self._imaging.of(usable, frame)
        outliers = readings.outliers(signal)
        if outliers.any():
            readings = self._imaging.of(usable & ~outliers, frame)
        if not readings.patterns:
            raise InputError(
                f"frame {frame}: every pattern rests on a saturated reading, so there is "
                "no image; record again with less light (projector power, exposure time) or a "
                "larger full scale"
            )
        return readings, outliers

    def _images_of(
        self, decoded: "_Decoded", notes: dict[str, str]
    ) -> tuple[dict[str, Floats], dict[str, Floats]]:
        """Images and their deviations by method, of one at least."""
        readings, estimates = decoded.readings, decoded.estimates
        images: dict[str, Floats] = {}
        sigmas: dict[str, Floats] = {}
        for name in self._images:
            with self._contained(f"image {name}"):
                if name not in estimates:
                    with timed(decoded.timings, f"image {name}"):
                        estimates[name] = readings.solver(name)(decoded.coefficients)
                estimate = self._checked_image(name, readings, estimates[name])
                images[name] = estimate.image
                if estimate.sigma is not None:
                    sigmas[name] = estimate.sigma
                if estimate.note is not None:
                    notes[f"image {name}"] = estimate.note
        if not images:
            raise InputError("every method of the image has failed")
        return images, sigmas

    def _checked_image(self, name: str, readings: UsableReadings, estimate: Estimate) -> Estimate:
        who = f"image method {name!r}"
        if not isinstance(estimate, Estimate):
            raise InputError(f"{who} gave {type(estimate).__name__}, not an Estimate")
        image = checked(who, estimate.image, self._shape)
        sigma = estimate.sigma
        if sigma is not None:
            sigma = checked(f"{who}, of the deviation,", sigma, self._shape)
        for values in (image, *([] if sigma is None else [sigma])):
            if not np.isfinite(values).all():
                raise InputError(f"{who} gave values that are not finite")
        if not readings.has_dc:  # the darkest pixel is taken to be dark
            image = image - image.min()
        return Estimate(image, sigma, estimate.note)

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
        sigmas: Mapping[str, Floats],
        readings: UsableReadings,
    ) -> Brightness | None:
        """What the first image with a sigma shows at the spots; None without any, or a level."""
        name = next((each for each in images if each in sigmas), None)
        setup = self.setup
        coupled = setup.buckets.baseline_electrons > 0  # then the level of all light is lost
        if (
            setup.optics is None
            or setup.spots is None
            or not setup.spots.are_four
            or name is None
            or coupled
            or setup.buckets.unit != "electron"
            or not readings.has_dc
        ):
            return None
        return brightness_at(self._spots, images[name], sigmas[name])

    @property
    def _shape(self) -> tuple[int, int]:
        return self.setup.plan.shape


class _Decoded(NamedTuple):
    """A frame from its readings on, and the images of it that were made with those of others."""

    frame: Frames
    readings: UsableReadings
    coefficients: Coefficients
    outliers: NDArray[np.bool_]
    timings: dict[str, float]
    estimates: dict[str, Estimate]


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

    Unless methods are named there are all usual ones, for the default ones to be compared with.
    Methods that carry something from frame to frame begin `WARM_UP` frames before it. Raises
    InputError if there is no such frame or nothing usable in it.
    """
    recording.batch(frame, frame + 1)  # told before any other
    reconstructor = Reconstructor(
        recording.setup,
        image=_or_usual(image),
        ranging=_or_usual(ranging),
        depth=_or_usual(depth),
        weather=weather,
        min_free=min_free,
    )
    for earlier in range(frame - warm_up_frames(frame, image, ranging), frame):
        reconstructor(recording.batch(earlier, earlier + 1))
    return reconstructor(recording.batch(frame, frame + 1))


def _or_usual(names: Names) -> Names:
    return "usual" if names is None else names


def _notes_without_image(rangings: Mapping[str, Ranges]) -> dict[str, str]:
    """Of ranges that rest on a prior over weather which no image has narrowed."""
    note = (
        "without the image (no sigma, no level or no optics) fog is hardly told: state the weather "
        "for ranges that are narrower, or more of them"
    )
    return {
        f"ranging {name}": note for name, each in rangings.items() if "weather prior" in each.status
    }


def _note_of_readings(
    frame: int, outliers: NDArray[np.bool_], varying: NDArray[np.bool_], result: Coefficients
) -> dict[str, str]:
    """What to say of the readings (M,) of a frame, and of what they tell in ``varying`` (K,)."""
    notes = []
    if outliers.any():
        why = "what is shown twice differs there (lost, or disturbed?)"
        notes.append(f"without {outliers.sum()} of its {outliers.size} readings: {why}")
    ratio = result.signal_over_noise(varying)
    if varying.any() and not result.values[varying].any():
        notes.append("without an image: readings of all its patterns are alike")
    elif ratio is not None and ratio < 1:
        notes.append(
            f"hardly above its noise: signal over noise is about {ratio:.2g} per coefficient"
        )
    return {f"frame {frame}": "; ".join(notes)} if notes else {}


def _single(arrays: Mapping[str, Floats | None]) -> dict[str, Image]:
    return {name: array.astype(np.float32) for name, array in arrays.items() if array is not None}

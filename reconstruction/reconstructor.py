"""Compiled once for a recording, called per frame: readings to image, ranges and depth map."""

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from .base.arrays import Floats, usual_float_errors
from .base.errors import InputError
from .base.timing import timed
from .capture import Frames, Recording, Setup, Spots
from .capture.motion import pose_at
from .checks import check_frames, checked_depths, checked_image, checked_ranges
from .chosen_methods import (
    Methods,
    check_methods,
    depth_methods,
    image_names,
    own_methods,
    ranging_solvers,
    warm_up_frames,
)
from .depth import (
    FORWARD,
    MIN_FREE,
    Context,
    Corridors,
    DepthEstimate,
    LastView,
    View,
    check_min_free,
    pixel_of,
    pixel_rays,
)
from .image import Coefficients, Estimate, Imaging, SolverOfMany, UsableReadings
from .ranging import Brightness, Ranges, Weather, brightness_at, range_consistency, with_weather
from .result import Image, Result

T = TypeVar("T")
logger = logging.getLogger(__name__)


class Reconstructor:
    """Reconstructs frames of one recording, or of others that have the same setup.

    The constructor computes everything that frames share; the time per frame does not depend on
    how many there are.

    Parameters
    ----------
    setup
        What the frames have in common: `Capture.setup`.
    image, ranging, depth
        Methods of each station: a name, an object that is a method, or several of these, the
        default one first. If None, the first of the usual methods that suits the recording. The
        zero-filled image, to which the others are compared, is always among the images.
        ``method:dictionary`` is an image method with another dictionary than its own.
    weather
        Replaces what the recording states: "clear", "fog", "unknown", or a visibility in metres.
        It is the prior of ranging in fog; in clear air the plain ranges come first.
    min_free
        An obstacle is where the probability that the corridor ahead is free falls below this.
    failed
        Called with station and name of a method, and the exception that it raised in a frame; the
        result is then without this method. If None, the exception propagates.

    Raises
    ------
    InputError
        If a method is unknown or does not suit the recording, if the pattern plans do not determine
        the background, or if ``min_free`` does not lie between 0 and 1.
    """

    @usual_float_errors
    def __init__(
        self,
        setup: Setup,
        *,
        image: Methods = None,
        ranging: Methods = None,
        depth: Methods = None,
        weather: str | float | None = None,
        min_free: float = MIN_FREE,
        failed: Callable[[str, Exception], None] | None = None,
    ) -> None:
        check_methods(image, ranging, depth)
        check_min_free(min_free)
        self._failed = failed
        if weather is not None:
            setup = with_weather(setup, Weather.parsed(weather))
        self.setup, self._min_free = setup, min_free
        self._last_view = LastView(setup.optics, setup.plan.shape)
        self._imaging = Imaging(
            *setup.plans, own=own_methods("image", image), motion=self._last_view.motion
        )
        every = self._imaging.of(np.ones(setup.plan.exposures, dtype=bool))
        self._images = image_names(image, every)
        self._rangings, self._refused = ranging_solvers(ranging, setup)
        context = Context(setup, self._imaging)
        ranged = not (setup.spots and f"ranging {setup.spots.method}" in self._refused)
        self._depths = {
            name: method.compile(context)
            for name, method in depth_methods(depth, setup, ranged=ranged).items()
        }
        self._corridors = Corridors(setup)
        self._range_over_depth: Image | None = None
        if setup.optics is not None:
            rays = pixel_rays(setup.optics, setup.plan.shape)
            self._range_over_depth = np.linalg.norm(rays, axis=-1).astype(np.float32)
        logger.info(
            "image methods: %s; ranging methods: %s; depth methods: %s",
            *(", ".join(names) or "none" for names in (self._images, self._rangings, self._depths)),
        )

    @usual_float_errors
    def __call__(self, frame: Frames) -> Result:
        """Reconstruct one frame.

        Raises
        ------
        InputError
            For several frames, for frames of another recording, and if no reading is usable.
        """
        if isinstance(frame, Frames) and len(frame) != 1:
            raise InputError(f"got {len(frame)} frames, expected one; `batch` takes several")
        return self.batch(frame)[0]

    @usual_float_errors
    def batch(self, frames: Frames) -> list[Result]:
        """Reconstruct any number of frames, in order; some methods are faster with many at once.

        Raises
        ------
        InputError
            For frames of another recording, and if no reading of a frame is usable.
        """
        check_frames(frames, self.setup)
        buckets = frames.buckets
        readings = zip(buckets.signal, buckets.variance, buckets.usable, strict=True)
        decoded = [
            self._decoded(frames.between(number, number + 1).aimed, *each)
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
            shared.setflags(write=False)  # several methods read them
        return _Decoded(frame, readings, coefficients, outliers, timings, {})

    def _imaged_together(self, decoded: Sequence["_Decoded"]) -> None:
        """Apply the image methods that are faster with several frames at once."""
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

    def _frame(self, decoded: "_Decoded") -> Result:
        frame, readings, coefficients, outliers, timings, _ = decoded
        varying = readings.decoder.operator.varying & readings.measured
        self._last_view.turn_to(pose_at(frame.poses))
        notes = _note_of_readings(frame.first, outliers, varying, coefficients)
        images, sigmas = self._images_of(decoded, notes)
        brightness = self._brightness(images, sigmas, readings, frame.spots)
        rangings: dict[str, Ranges] = {}
        for name, solve in self._rangings.items():
            assert frame.spots is not None
            with self._contained(f"ranging {name}"), timed(timings, f"ranging {name}"):
                rangings[name] = checked_ranges(
                    name, solve(frame.spots, brightness), len(frame.spots.directions)
                )
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
                estimate = solve_depth(view)
                if estimate is not None:
                    maps[name] = checked_depths(f"depth method {name!r}", estimate, self._shape)
        self._last_view.keep(next((each.depth_m for each in maps.values()), None))
        corridors = self._corridors(maps, view, brightness, next(iter(self._depths), None))
        notes |= {f"depth {name}": each.note for name, each in maps.items() if each.note}
        logger.debug("frame %d, seconds: %s", frame.first, timings)
        return Result(
            images=_single(images),
            sigmas=_single(sigmas),
            rangings=rangings,
            depths=_single({name: each.depth_m for name, each in maps.items()}),
            log_depth_sigmas=_single({name: each.sigma for name, each in maps.items()}),
            no_returns=_single({name: each.no_return for name, each in maps.items()}),
            free_probabilities={name: each(FORWARD) for name, each in corridors.items()},
            corridors=corridors,
            min_free=self._min_free,
            range_over_depth=self._range_over_depth,
            spot_directions=None if frame.spots is None else frame.spots.directions,
            timings_s=timings,
            unit=frame.buckets.unit,
            recording=frame.digest(self.setup),
            frame=frame.first,
            patterns=readings.patterns,
            notes=notes,
            points_m=_present({name: each.points_m for name, each in maps.items()}),
        )

    @contextmanager
    def _contained(self, method: str) -> Iterator[None]:
        """Pass what a method raises to ``failed``, if there is one."""
        try:
            yield
        except Exception as error:
            if self._failed is None:
                raise
            self._failed(method, error)

    def _readings(
        self, frame: int, signal: Floats, usable: NDArray[np.bool_]
    ) -> tuple[UsableReadings, NDArray[np.bool_]]:
        """What is compiled for the readings (M,) of a frame, and which of them are outliers."""
        readings = self._imaging.of(usable, frame)
        outliers = readings.outliers(signal)
        if outliers.any():
            readings = self._imaging.of(usable & ~outliers, frame)
        if not readings.patterns:
            raise InputError(
                f"frame {frame}: no image, because every pattern has a saturated reading; record "
                "again with less light (projector power, exposure time) or a larger full scale"
            )
        return readings, outliers

    def _images_of(
        self, decoded: "_Decoded", notes: dict[str, str]
    ) -> tuple[dict[str, Floats], dict[str, Floats]]:
        """Images and their standard deviations by method, at least one."""
        readings, estimates = decoded.readings, decoded.estimates
        images: dict[str, Floats] = {}
        sigmas: dict[str, Floats] = {}
        for name in self._images:
            with self._contained(f"image {name}"):
                if name not in estimates:
                    with timed(decoded.timings, f"image {name}"):
                        estimates[name] = readings.solver(name)(decoded.coefficients)
                who = f"image method {name!r}"
                estimate = checked_image(who, estimates[name], self._shape)
                images[name] = estimate.image
                if not readings.has_dc:  # assume that the darkest pixel is dark
                    images[name] = estimate.image - estimate.image.min()
                if estimate.sigma is not None:
                    sigmas[name] = estimate.sigma
                if estimate.note is not None:
                    notes[f"image {name}"] = estimate.note
        if not images:
            raise InputError("every image method failed")
        return images, sigmas

    def _brightness(
        self,
        images: Mapping[str, Floats],
        sigmas: Mapping[str, Floats],
        readings: UsableReadings,
        spots: Spots | None,
    ) -> Brightness | None:
        """The first image that has a sigma, at the spots; None without one or its DC coefficient.

        AC coupling loses the DC coefficient.
        """
        name = next((each for each in images if each in sigmas), None)
        setup = self.setup
        if (
            setup.optics is None
            or spots is None
            or name is None
            or setup.buckets.baseline_electrons > 0
            or setup.buckets.unit != "electron"
            or not readings.has_dc
        ):
            return None
        pixels = pixel_of(spots.directions, setup.optics, self._shape)
        return brightness_at(pixels, images[name], sigmas[name])

    @property
    def _shape(self) -> tuple[int, int]:
        return self.setup.plan.shape


class _Decoded(NamedTuple):
    """A decoded frame, and those of its images that were made together with other frames'."""

    frame: Frames
    readings: UsableReadings
    coefficients: Coefficients
    outliers: NDArray[np.bool_]
    timings: dict[str, float]
    estimates: dict[str, Estimate]


@usual_float_errors
def reconstruct(
    recording: Recording,
    frame: int = 0,
    *,
    image: Methods = None,
    ranging: Methods = None,
    depth: Methods = None,
    weather: str | float | None = None,
    min_free: float = MIN_FREE,
) -> Result:
    """Reconstruct one frame of a recording.

    Parameters
    ----------
    recording
        A capture in memory or in its file.
    frame
        Index of the frame. Methods that carry state from frame to frame start `WARM_UP` frames
        before it.
    image, ranging, depth
        As for `Reconstructor`; if None, all usual methods, to compare the default one with.
    weather, min_free
        As for `Reconstructor`.

    Raises
    ------
    InputError
        As `Reconstructor`, and if there is no such frame or none of its readings is usable.
    """
    recording.batch(frame, frame + 1)  # a missing frame is reported first
    reconstructor = Reconstructor(
        recording.setup,
        image="usual" if image is None else image,
        ranging="usual" if ranging is None else ranging,
        depth="usual" if depth is None else depth,
        weather=weather,
        min_free=min_free,
    )
    warm_up = warm_up_frames(recording.setup, frame, image=image, ranging=ranging, depth=depth)
    for earlier in range(frame - warm_up, frame):
        reconstructor(recording.batch(earlier, earlier + 1))
    return reconstructor(recording.batch(frame, frame + 1))


def _notes_without_image(rangings: Mapping[str, Ranges]) -> dict[str, str]:
    """Notes on ranges whose prior over the weather no image has narrowed."""
    note = (
        "uncertain about fog for lack of the image (no sigma, DC coefficient or optics): state the "
        "weather to get more ranges, with smaller sigma"
    )
    return {
        f"ranging {name}": note for name, each in rangings.items() if "weather prior" in each.status
    }


def _note_of_readings(
    frame: int, outliers: NDArray[np.bool_], varying: NDArray[np.bool_], decoded: Coefficients
) -> dict[str, str]:
    """A note on the readings (M,) of a frame and its ``varying`` coefficients (K,)."""
    notes = []
    if outliers.any():
        why = "repeated exposures disagree there (lost or disturbed?)"
        notes.append(f"without {outliers.sum()} of its {outliers.size} readings: {why}")
    ratio = decoded.signal_over_noise(varying)
    if varying.any() and not decoded.values[varying].any():
        notes.append("without an image: the readings of all its patterns are equal")
    elif ratio is not None and ratio < 1:
        notes.append(
            f"hardly above its noise: signal over noise is about {ratio:.2g} per coefficient"
        )
    return {f"frame {frame}": "; ".join(notes)} if notes else {}


def _single(arrays: Mapping[str, Floats | None]) -> dict[str, Image]:
    return {name: array.astype(np.float32) for name, array in arrays.items() if array is not None}


def _present(values: Mapping[str, T | None]) -> dict[str, T]:
    return {name: each for name, each in values.items() if each is not None}

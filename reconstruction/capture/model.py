"""One recording, real or simulated: its parts, and its frames one by one.

The annotations of the data classes are the file's schema (docs/reference/capture-format.md):
reading, writing and checking follow them. Everything geometric is in the projector's optical frame:
x right, y down, z forward, origin at its pinhole.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Annotated, Any, Literal, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import InputError
from ..base.notebook import displayed, drawing, figure, picture, reported
from ..base.plotting import draw_map, panels
from ..operators import PatternPlan
from .buckets import Buckets
from .pattern_taps import PatternTaps
from .schema import FRAMES, Stored, between, check_shape, stored_fields
from .spots import SPOTS_AXIS, Spots

Image = NDArray[np.float32]

SOURCES = ("simulation", "hardware")
SURROGATE = "surrogate light"
"""What the software of a simulation adds to its name where its light was not traced."""


@dataclass(frozen=True, eq=False)
class Optics:
    """Projector pinhole and bucket detector, as far as a recording states them.

    Tangents of the half angles to the outer edges of the pattern. The detector is a number of alike
    photodiodes whose currents add up; each is a round aperture that sees a cone of half angle
    ``detector_half_field_rad`` about the optical axis, within it falling off with
    cos^``detector_falloff`` of the angle. ``pixel_electrons`` are the primary electrons of one
    exposure if all light of one pixel, fully on, reached an aperture. What is not known is nan;
    only ranging in fog needs it, to compare the image with the echoes of the lasers.
    """

    tan_half_width: Annotated[float, Stored("1", sign="positive")]
    tan_half_height: Annotated[float, Stored("1", sign="positive")]
    detector_positions_m: Annotated[Floats, Stored("m", ("photodiodes", 3), nan=True)] = field(
        default_factory=lambda: np.full((1, 3), np.nan)
    )
    detector_half_field_rad: Annotated[float, Stored("rad", sign="positive", nan=True)] = np.nan
    detector_falloff: Annotated[float, Stored("1", sign="not negative", nan=True)] = np.nan
    detector_aperture_radius_m: Annotated[float, Stored("m", sign="positive", nan=True)] = np.nan
    pixel_electrons: Annotated[
        float | Floats,
        Stored("electron", ("height", "width"), sign="not negative", nan=True, one_for_all=True),
    ] = np.nan


@dataclass(frozen=True, eq=False)
class FrameTruth:
    """What a simulation knows of one frame; nan where nothing is hit.

    ``image`` (H, W) is the electrons per exposure that each virtual pixel alone, fully on,
    contributes, ``image_error`` the standard error of the light transport that found it;
    ``spot_range_m`` (spots,), nan where a laser meets nothing.
    """

    image: Image
    image_error: Image
    range_m: Image
    depth_m: Image
    reflectance: Image
    spot_range_m: Floats


@dataclass(frozen=True, eq=False)
class Truth:
    """What a simulation knows of its frames: only evaluation reads it.

    ``frame`` (T,) are the frames that the other fields, (T, ...) as in `FrameTruth`, are the truth
    of; ``still``: nothing moves, and one truth is that of every frame.
    """

    frame: Annotated[NDArray[np.int64], Stored("1", ("truths",), "int64", sign="not negative")]
    still: Annotated[bool, Stored("1", dtype="bool")]
    image: Annotated[Image, Stored("electron", ("truths", "height", "width"), "float32", nan=True)]
    image_error: Annotated[
        Image, Stored("electron", ("truths", "height", "width"), "float32", nan=True)
    ]
    range_m: Annotated[
        Image, Stored("m", ("truths", "height", "width"), "float32", "not negative", nan=True)
    ]
    depth_m: Annotated[
        Image, Stored("m", ("truths", "height", "width"), "float32", "not negative", nan=True)
    ]
    reflectance: Annotated[
        Image, Stored("1", ("truths", "height", "width"), "float32", "not negative", nan=True)
    ]
    spot_range_m: Annotated[
        Floats, Stored("m", ("truths", SPOTS_AXIS), sign="not negative", nan=True)
    ]

    @classmethod
    def of(cls, frames: Sequence[FrameTruth], *, still: bool = False) -> Self:
        """Truth of the first frames, in turn; ``still``: one, of all frames."""
        names = [field.name for field in fields(FrameTruth)]
        stacked = {name: np.stack([getattr(each, name) for each in frames]) for name in names}
        return cls(np.arange(len(frames)), still, **stacked)

    def knows(self, frame: int) -> bool:
        """Whether the truth of a frame is known."""
        return bool(self._positions(frame).size)

    def at(self, frame: int) -> FrameTruth:
        """The truth of one frame; InputError if it is not known."""
        result = self._positions(frame)
        if not result.size:
            available = ", ".join(map(str, self.frame.tolist()))
            raise InputError(
                f"frame {frame}: the capture holds the truth of frames {available} alone"
            )
        names = (field.name for field in fields(FrameTruth))
        return FrameTruth(**{name: getattr(self, name)[result[0]] for name in names})

    def _positions(self, frame: int) -> NDArray[np.intp]:
        return np.flatnonzero((self.frame == frame) | self.still)


@dataclass(frozen=True)
class Provenance:
    """Where a capture comes from: ``created`` is an ISO time, or empty.

    ``instrument``, ``scene`` and the ``settings`` of the simulator are YAML text.
    """

    source: Literal["simulation", "hardware"]
    software: str
    created: str
    instrument: str
    scene: str = ""
    seed: int | None = None
    settings: str = ""

    @property
    def is_surrogate(self) -> bool:
        """Whether the light of a simulation is a fast stand-in."""
        return self.source == "simulation" and self.software.endswith(SURROGATE)


@dataclass(frozen=True, eq=False)
class Setup:
    """What all frames of a recording have in common. Its parts hold no readings.

    ``plan`` is that of the first frame; ``later_plans`` as in `Capture`.
    """

    plan: PatternPlan
    optics: Optics | None
    buckets: Buckets
    spots: Spots | None
    pattern_taps: PatternTaps | None
    later_plans: tuple[PatternPlan, ...] = ()

    def __repr__(self) -> str:
        return reported("Setup", self.facts)

    @property
    def facts(self) -> dict[str, Any]:
        """What it is, in a few words by name."""
        plan, shape = self.plan, " × ".join(map(str, self.plan.shape))
        displayed = {
            "patterns": f"{plan.sampled} of {shape} pixels, {plan.basis}",
            "exposures": plan.exposures,
        }
        return {
            **(displayed if plan.shows_image else {"patterns": "none"}),
            "ranging": "none" if self.spots is None else self.spots.summary,
        }

    @property
    def plans(self) -> tuple[PatternPlan, ...]:
        """Of successive frames, over and over."""
        return (self.plan, *self.later_plans)

    def plan_of(self, frame: int) -> PatternPlan:
        """What a frame shows."""
        return self.plans[frame % len(self.plans)]

    def digest(self, frame: int) -> bytes:
        """SHA-256 over the pattern plan of a frame."""
        return self._digests[frame % len(self.plans)]

    @cached_property
    def _digests(self) -> list[bytes]:
        digests = []
        for plan in self.plans:
            arrays = [getattr(plan.patterns, name) for name in plan.patterns.arrays]
            digest = _digest(np.array(plan.shape), plan.index, plan.polarity, *arrays)
            digest.update(plan.basis.encode())
            digests.append(bytes(digest.digest()))
        return digests


@dataclass(frozen=True, eq=False)
class Frames:
    """Readings of frames that follow each other, ``first`` the number of the first of them."""

    first: int
    buckets: Buckets
    spots: Spots | None
    pattern_taps: PatternTaps | None

    def __repr__(self) -> str:
        facts: dict[str, Any] = {"first": self.first, "frames": len(self)}
        if self.spots is not None:
            facts["ranging"] = self.spots.summary
        return reported("Frames", facts | {"exposures": self.buckets.counts.shape[1]})

    def __len__(self) -> int:
        """Number of frames."""
        return int(self.buckets.counts.shape[0])

    def between(self, start: int, stop: int) -> "Frames":
        """Some of them, counted from the first of these."""
        parts = (self.buckets, self.spots, self.pattern_taps)
        cut = (None if part is None else between(part, start, stop) for part in parts)
        return Frames(self.first + start, *cut)  # type: ignore[arg-type]

    def digest(self, setup: Setup) -> str:
        """SHA-256 over patterns and readings, by which a result knows its frames."""
        readings = [self.buckets.counts]
        if self.spots is not None:
            readings.append(self.spots.readings)
        if self.pattern_taps is not None:
            readings.append(self.pattern_taps.taps)
        digest = _digest(*readings)
        digest.update(setup.digest(self.first))
        return digest.hexdigest()


class Recording(Protocol):
    """A capture in memory or in its file: frames on demand."""

    @property
    def setup(self) -> Setup:
        """What its frames have in common."""

    @property
    def frames(self) -> int:
        """Number of frames."""

    def batch(self, start: int, stop: int) -> Frames:
        """Frames ``start`` to ``stop``, the last not included; InputError if there are none."""


@dataclass(frozen=True, eq=False)
class Capture:
    """One recording in memory. Raises InputError if its parts do not fit together.

    Where there are ``pattern_taps``, the buckets hold their sums over the taps. Where frames show
    different patterns, ``plan`` is that of the first and ``later_plans`` are those of the next
    ones: frame t shows that of t mod C, with C of them altogether.
    """

    plan: PatternPlan
    buckets: Buckets
    spots: Spots | None
    optics: Optics | None
    provenance: Provenance
    truth: Truth | None = None
    pattern_taps: PatternTaps | None = None
    later_plans: tuple[PatternPlan, ...] = ()

    def __post_init__(self) -> None:
        check(self)

    @property
    def frames(self) -> int:
        """Number of frames."""
        return int(self.buckets.counts.shape[0])

    def __repr__(self) -> str:
        return reported("Capture", self._facts)

    @property
    def _facts(self) -> dict[str, Any]:
        return {
            "source": self.provenance.source,
            "frames": self.frames,
            **self.setup.facts,
            "saturated": f"{100 * self.buckets.saturated.mean():.3g} %",
        }

    def _repr_html_(self) -> str:
        readings = np.asarray(self.buckets.counts[0], np.float64)
        low, high = float(readings.min()), float(readings.max())
        heights = (readings - low) / max(high - low, 1e-300) * readings.size
        points = " ".join(f"{at},{height:.4g}" for at, height in enumerate(heights))
        line = f'<polyline points="{points}" vector-effect="non-scaling-stroke"/>'
        lines = drawing([line], (0, 0), (readings.size, readings.size))
        pictures = [figure(lines, f"readings of frame 0, {low:.4g} to {high:.4g} counts")]
        if self.truth is not None:
            pictures.append(picture(self.truth.image[0], "true image", "electrons"))
        return displayed("Capture", self._facts, pictures)

    def plot(self, frame: int = 0) -> Any:
        """Draw a frame's readings and, where they are known, its true image and depth.

        Returns the axes of Matplotlib, (panels,). InputError if there is no such frame, or no
        Matplotlib.
        """
        counts = self.frame(frame).buckets.counts[0]
        valid = self.truth is not None and self.truth.knows(frame)
        axes = panels(3 if valid else 1)
        axes[0].plot(counts, ".", markersize=3)
        axes[0].set(title=f"readings of frame {frame}", xlabel="exposure", ylabel="counts")
        if valid:
            assert self.truth is not None
            truth = self.truth.at(frame)
            draw_map(axes[1], truth.image, "true image", "electrons")
            draw_map(axes[2], truth.depth_m, "true depth", "m", "viridis_r")
        return axes

    @cached_property
    def setup(self) -> Setup:
        """What its frames have in common."""
        none = self._all.between(0, 0)
        return Setup(
            self.plan, self.optics, none.buckets, none.spots, none.pattern_taps, self.later_plans
        )

    def frame(self, frame: int = 0) -> Frames:
        """Readings of one frame; InputError if there is no such frame."""
        return self.batch(frame, frame + 1)

    def batch(self, start: int, stop: int) -> Frames:
        """Frames ``start`` to ``stop``, the last not included; InputError if there are none."""
        check_frames(start, stop, self.frames)
        return self._all.between(start, stop)

    @property
    def _all(self) -> Frames:
        return Frames(0, self.buckets, self.spots, self.pattern_taps)


PARTS = ("buckets", "spots", "pattern_taps", "optics", "truth")
"""Names of the parts that are data classes, of capture and file."""


def check(capture: Capture) -> None:
    """Raise InputError unless the parts fit together and their numbers make sense."""
    if capture.provenance.source not in SOURCES:
        raise InputError(f"source is {capture.provenance.source!r}; allowed: {', '.join(SOURCES)}")
    check_plans((capture.plan, *capture.later_plans))
    sizes = axis_sizes(capture.plan)
    for group in PARTS:
        part = getattr(capture, group)
        if part is not None:
            check_part(group, part, sizes)
    if sizes[FRAMES] < 1:
        raise InputError("buckets/counts holds no frame")
    check_parts(capture)


def check_plans(plans: Sequence[PatternPlan]) -> None:
    """Raise InputError unless frames with these plans can be of one recording."""
    first, *others = plans
    for frame, plan in enumerate(others, 1):
        for what, result, expected in (
            ("shape", plan.shape, first.shape),
            ("basis", plan.basis, first.basis),
            ("exposures", plan.exposures, first.exposures),
        ):
            if result != expected:
                raise InputError(
                    f"the patterns of frame {frame} have {what} {result}, those of the first "
                    f"{expected}"
                )


def check_part(group: str, part: object, sizes: dict[str, int]) -> None:
    """Raise InputError unless shapes and values of a part are as its schema says."""
    for name, stored in stored_fields(type(part)):
        value = np.asarray(getattr(part, name))
        check_shape(f"{group}/{name}", value.shape, stored, sizes)
        stored.retained(f"{group}/{name}", value)


def check_parts(capture: "Capture | Frames | Setup") -> None:
    """Raise InputError unless the values of each part fit together."""
    if not isinstance(capture, Frames):
        _check_times(capture.buckets)
        if capture.buckets.dead_time_s > 0:
            for plan in (capture.plan, *capture.later_plans):
                _check_dead_time(capture.buckets, plan)
    for readings in (capture.spots, capture.pattern_taps):
        if readings is not None:
            readings.check()


def check_frames(start: int, stop: int, frames: int) -> None:
    """Raise InputError unless there are frames ``start`` to ``stop``."""
    if not 0 <= start < stop <= frames:
        wanted = f"frame {start}" if stop == start + 1 else f"frames {start} to {stop}"
        raise InputError(f"{wanted}: the capture has frames 0..{frames - 1}")


def axis_sizes(plan: PatternPlan) -> dict[str, int]:
    """Sizes of the named axes that the plan sets."""
    height, width = plan.shape
    return {"exposures": plan.exposures, "height": height, "width": width}


def _check_times(buckets: Buckets) -> None:
    """Raise InputError unless an exposure ends before the next pattern does."""
    if buckets.exposure_time_s > buckets.pattern_period_s * (1 + 1e-6):
        raise InputError(
            f"buckets/exposure_time_s is {buckets.exposure_time_s:g}, longer than "
            f"buckets/pattern_period_s, {buckets.pattern_period_s:g} s"
        )


def _check_dead_time(buckets: Buckets, plan: PatternPlan) -> None:
    """Raise InputError unless readings can be corrected for the dead time."""
    dead = f"buckets/dead_time_s is {buckets.dead_time_s:g} s"
    for name in ("exposure_time_s", "electrons_per_count"):
        if not np.isfinite(getattr(buckets, name)):
            raise InputError(f"{dead}; then buckets/{name} must be known, not nan")
    if (plan.polarity == 0).any():
        raise InputError(
            f"{dead}, but patterns/polarity 0 marks readings as differences, which cannot be "
            "corrected for it: store what was counted, or dead_time_s 0"
        )


def _digest(*arrays: NDArray[Any]) -> Any:
    digest = hashlib.sha256()
    for values in arrays:
        digest.update(f"{values.shape}".encode())
        digest.update(values.astype(np.float64).tobytes())  # of whichever type the file has
    return digest

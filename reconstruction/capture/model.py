"""A recording, real or simulated: its parts and its frames.

The annotations of the data classes are the file's schema (docs/reference/capture-format.md);
reading, writing and checking follow them. Geometry is in the projector's optical frame: x right, y
down, z forward, origin at its pinhole.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Annotated, Any, Literal, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.display import draw_map, drawing, figure, html_summary, panels, picture, text_summary
from ..base.errors import InputError
from ..operators import PatternPlan
from .buckets import Buckets
from .charge import PatternTaps
from .poses import Poses
from .schema import FRAMES, Stored, between, check_shape, joined, present_fields
from .spots import Spots
from .truth import Truth

SOURCES = ("simulation", "hardware")
SURROGATE = "surrogate light"
"""Suffix of the software name of a simulation whose light was not traced."""


@dataclass(frozen=True, eq=False)
class Optics:
    """Projector pinhole and bucket detector, as far as the recording states them.

    ``tan_half_width`` and ``tan_half_height`` are to the outer edges of the pattern. The detector
    is a set of equal photodiodes whose currents add. Each is a round aperture that sees a cone of
    half angle ``detector_half_field_rad`` about the optical axis, with a response of
    cos^``detector_falloff`` of the angle. ``pixel_electrons`` are the primary electrons of one
    exposure if an aperture collected all light of one pixel, fully on. Unknown values are nan; only
    ranging in fog needs them, to compare the image with the echoes of the lasers.
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


@dataclass(frozen=True)
class Provenance:
    """Origin of a capture: ``created`` is an ISO time, or empty.

    ``instrument``, ``scene`` and the simulator's ``settings`` are YAML text.
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
        """Whether the light of a simulation is a fast surrogate."""
        return self.source == "simulation" and self.software.endswith(SURROGATE)


@dataclass(frozen=True, eq=False)
class Setup:
    """What all frames of a recording share; its parts hold no readings.

    ``plan`` is that of the first frame, ``following_plans`` are as in `Capture`.
    """

    plan: PatternPlan
    optics: Optics | None
    buckets: Buckets
    spots: Spots | None
    pattern_taps: PatternTaps | None
    following_plans: tuple[PatternPlan, ...] = ()
    poses: Poses | None = None

    def __repr__(self) -> str:
        return text_summary("Setup", self.facts)

    @property
    def facts(self) -> dict[str, Any]:
        """Description by name."""
        plan, shape = self.plan, " × ".join(map(str, self.plan.shape))
        patterns = {
            "patterns": f"{plan.sampled} of {shape} pixels, {plan.basis}",
            "exposures": plan.exposures,
        }
        return {
            **(patterns if plan.shows_image else {"patterns": "none"}),
            "ranging": "none" if self.spots is None else self.spots.summary,
            **({"spots": "steered"} if self.spots and self.spots.pointing is not None else {}),
        }

    @property
    def plans(self) -> tuple[PatternPlan, ...]:
        """Plans of successive frames, which repeat."""
        return (self.plan, *self.following_plans)

    def plan_of(self, frame: int) -> PatternPlan:
        """Plan of a frame."""
        return self.plans[frame % len(self.plans)]

    def digest(self, frame: int) -> bytes:
        """SHA-256 of a frame's pattern plan."""
        return self._digests[frame % len(self.plans)]

    @cached_property
    def _digests(self) -> list[bytes]:
        digests = []
        for plan in self.plans:
            arrays = [getattr(plan.patterns, name) for name in plan.patterns.arrays]
            digest = _digest(np.array(plan.shape), plan.index, plan.polarity, *arrays)
            digest.update(plan.basis.encode())
            if plan.throughput is not None:
                digest.update(_digest(plan.throughput).digest())
            digests.append(bytes(digest.digest()))
        return digests


@dataclass(frozen=True, eq=False)
class Frames:
    """Readings of successive frames; ``first`` is the number of the first."""

    first: int
    buckets: Buckets
    spots: Spots | None
    pattern_taps: PatternTaps | None
    poses: Poses | None = None

    def __repr__(self) -> str:
        facts: dict[str, Any] = {"first": self.first, "frames": len(self)}
        if self.spots is not None:
            facts["ranging"] = self.spots.summary
        return text_summary("Frames", facts | {"exposures": self.buckets.counts.shape[1]})

    def __len__(self) -> int:
        """Number of frames."""
        return int(self.buckets.counts.shape[0])

    def between(self, start: int, stop: int) -> "Frames":
        """Frames ``start`` to ``stop``, exclusive, counted from the first of these."""
        parts = [(group, getattr(self, group)) for group in READING_PARTS]
        cut = {group: part and between(part, start, stop) for group, part in parts}
        return Frames(self.first + start, **cut)

    @classmethod
    def joined(cls, frames: "Sequence[Frames]") -> Self:
        """Frames that follow one another as one."""
        parts = [(group, [getattr(each, group) for each in frames]) for group in READING_PARTS]
        return cls(frames[0].first, **{group: each[0] and joined(each) for group, each in parts})

    @property
    def aimed(self) -> "Frames":
        """A frame whose spots have its own directions; see `Spots.aimed`."""
        return self if self.spots is None else replace(self, spots=self.spots.aimed)

    def digest(self, setup: Setup) -> str:
        """SHA-256 of patterns and readings, which identifies the frames of a result."""
        readings = [self.buckets.counts]
        if self.spots is not None:
            readings.append(self.spots.readings)
            if self.spots.pointing is not None:
                readings.append(self.spots.pointing)
        if self.pattern_taps is not None:
            readings.append(self.pattern_taps.taps)
        digest = _digest(*readings)
        digest.update(setup.digest(self.first))
        return digest.hexdigest()


class Recording(Protocol):
    """A capture in memory or in its file, with frames on demand."""

    @property
    def setup(self) -> Setup:
        """What its frames share."""

    @property
    def frames(self) -> int:
        """Number of frames."""

    def batch(self, start: int, stop: int) -> Frames:
        """Frames ``start`` to ``stop``, exclusive; raises InputError if they do not exist."""


@dataclass(frozen=True, eq=False)
class Capture:
    """A recording in memory; raises InputError if its parts are inconsistent.

    With ``pattern_taps``, the buckets hold their sums over the taps. A flight has ``poses``. If
    frames show different patterns, ``plan`` is that of the first frame and ``following_plans`` are
    those of the next: frame t has plan t mod C of all C.
    """

    plan: PatternPlan
    buckets: Buckets
    spots: Spots | None
    optics: Optics | None
    provenance: Provenance
    truth: Truth | None = None
    pattern_taps: PatternTaps | None = None
    following_plans: tuple[PatternPlan, ...] = ()
    poses: Poses | None = None

    def __post_init__(self) -> None:
        check(self)

    @property
    def frames(self) -> int:
        """Number of frames."""
        return int(self.buckets.counts.shape[0])

    def __repr__(self) -> str:
        return text_summary("Capture", self._facts)

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
        return html_summary("Capture", self._facts, pictures)

    def plot(self, frame: int = 0) -> Any:
        """Draw readings of a frame, and its true image and depth if known, in axes (panels,).

        Raises InputError if there is no such frame, or Matplotlib is missing.
        """
        counts = self.frame(frame).buckets.counts[0]
        has_truth = self.truth is not None and self.truth.knows(frame)
        axes = panels(3 if has_truth else 1)
        axes[0].plot(counts, ".", markersize=3)
        axes[0].set(title=f"readings of frame {frame}", xlabel="exposure", ylabel="counts")
        if has_truth:
            assert self.truth is not None
            truth = self.truth.at(frame)
            draw_map(axes[1], truth.image, "true image", "electrons")
            draw_map(axes[2], truth.depth_m, "true depth", "m", "viridis_r")
        return axes

    @cached_property
    def setup(self) -> Setup:
        """What its frames share."""
        empty = self._all.between(0, 0)
        parts = {group: getattr(empty, group) for group in READING_PARTS}
        return Setup(self.plan, self.optics, following_plans=self.following_plans, **parts)

    def frame(self, frame: int = 0) -> Frames:
        """Readings of one frame; raises InputError if it does not exist."""
        return self.batch(frame, frame + 1)

    def batch(self, start: int, stop: int) -> Frames:
        """Frames ``start`` to ``stop``, exclusive; raises InputError if they do not exist."""
        check_frames(start, stop, self.frames)
        return self._all.between(start, stop)

    @property
    def _all(self) -> Frames:
        return Frames(0, self.buckets, self.spots, self.pattern_taps, self.poses)


READING_PARTS = ("buckets", "spots", "pattern_taps", "poses")
"""Names of the parts that hold a row for each frame."""
PARTS = (*READING_PARTS, "optics", "truth")
"""Names of the parts that are data classes, in captures and files."""


def check(capture: Capture) -> None:
    """Raise InputError unless the parts of a capture are valid and consistent."""
    if capture.provenance.source not in SOURCES:
        raise InputError(f"source is {capture.provenance.source!r}; allowed: {', '.join(SOURCES)}")
    check_plans((capture.plan, *capture.following_plans))
    sizes = axis_sizes(capture.plan)
    for group in PARTS:
        part = getattr(capture, group)
        if part is not None:
            check_part(group, part, sizes)
    if sizes[FRAMES] < 1:
        raise InputError("buckets/counts holds no frame")
    check_parts(capture)


def check_plans(plans: Sequence[PatternPlan]) -> None:
    """Raise InputError unless frames with these plans can belong to one recording."""
    first, *others = plans
    for frame, plan in enumerate(others, 1):
        for what, value, expected in (
            ("shape", plan.shape, first.shape),
            ("basis", plan.basis, first.basis),
            ("exposures", plan.exposures, first.exposures),
        ):
            if value != expected:
                raise InputError(
                    f"the patterns of frame {frame} have {what} {value}, those of the first "
                    f"{expected}"
                )
        if not np.array_equal(plan.factors_of(first.index), first.factors):
            raise InputError(f"the throughput of frame {frame} is not that of the first")


def check_part(group: str, part: object, sizes: dict[str, int]) -> None:
    """Raise InputError unless shapes and values of a part follow its schema."""
    for name, stored in present_fields(part):
        value = np.asarray(getattr(part, name))
        check_shape(f"{group}/{name}", value.shape, stored, sizes)
        stored.converted(f"{group}/{name}", value)


def check_parts(capture: "Capture | Frames | Setup") -> None:
    """Raise InputError unless the values within each part are consistent."""
    if not isinstance(capture, Frames):
        _check_times(capture.buckets)
        if capture.buckets.dead_time_s > 0:
            for plan in (capture.plan, *capture.following_plans):
                _check_dead_time(capture.buckets, plan)
    for readings in (capture.spots, capture.pattern_taps, capture.poses):
        if readings is not None:
            readings.check()


def check_frames(start: int, stop: int, frames: int) -> None:
    """Raise InputError unless frames ``start`` to ``stop``, exclusive, exist among ``frames``."""
    if not 0 <= start < stop <= frames:
        wanted = f"frame {start}" if stop == start + 1 else f"frames {start} to {stop}"
        raise InputError(f"{wanted}: the capture has frames 0..{frames - 1}")


def axis_sizes(plan: PatternPlan) -> dict[str, int]:
    """Sizes of the named axes that the plan determines."""
    height, width = plan.shape
    return {"exposures": plan.exposures, "height": height, "width": width}


def _check_times(buckets: Buckets) -> None:
    """Raise InputError if an exposure is longer than the pattern period."""
    if buckets.exposure_time_s > buckets.pattern_period_s * (1 + 1e-6):
        raise InputError(
            f"buckets/exposure_time_s is {buckets.exposure_time_s:g}, longer than "
            f"buckets/pattern_period_s, {buckets.pattern_period_s:g} s"
        )


def _check_dead_time(buckets: Buckets, plan: PatternPlan) -> None:
    """Raise InputError unless readings can be corrected for dead time."""
    dead = f"buckets/dead_time_s is {buckets.dead_time_s:g} s"
    for name in ("exposure_time_s", "electrons_per_count"):
        if not np.isfinite(getattr(buckets, name)):
            raise InputError(f"{dead}, which requires buckets/{name}, not nan")
    if (plan.polarity == 0).any():
        raise InputError(
            f"{dead}, but differences (patterns/polarity 0) cannot be corrected for dead time: "
            "store the counts themselves, or dead_time_s 0"
        )


def _digest(*arrays: NDArray[Any]) -> Any:
    digest = hashlib.sha256()
    for values in arrays:
        digest.update(f"{values.shape}".encode())
        digest.update(values.astype(np.float64).tobytes())  # independent of the stored type
    return digest

"""Time-of-flight readings of the laser spots: what all measurement methods share.

The lasers leave from the projector's pinhole; L is the optical path from there via the spot to the
detector.
"""

from dataclasses import dataclass, field, replace
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import InputError
from .schema import FRAMES, Stored

UNKNOWN: Any = np.nan
"""Default of fields per spot; expanded to their shapes."""
SPOTS_AXIS, MAX_SPOTS = "spots", 64
"""Axis of the spots, and their maximum number."""
USUAL_SPOTS = 4
"""Number of spots of readings without directions, and those the depth network learned from."""
ALIGNED = 1e-6
"""Maximum difference of the components of a detector's axis and its beam that are parallel."""
MAX_PULSE_S = 1e-3
"""Maximum duration of pulses and time bins, in which light travels 300 km."""


def check_duration(name: str, duration_s: float) -> None:
    """Raise InputError for a pulse or time bin too long to measure a range."""
    if duration_s > MAX_PULSE_S:
        raise InputError(
            f"{name} is {duration_s:g} s, must be at most {MAX_PULSE_S:g} s; if it is in "
            f"nanoseconds, write {duration_s:g}e-9"
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class SpotOptics:
    """Lasers and their detectors: unit vectors from the pinhole to the spots, and the detectors.

    Each detector is a round aperture that sees a cone of half angle ``half_fields_rad`` about its
    axis (a unit vector), with a response of cos^``falloffs`` of the angle. A zone is stored the
    other way round, as light is the same both ways: its axis is a beam from the receiver, and the
    flood of light is its detector, with an aperture that makes the light equal. Beams are Gaussian
    in angle and position, with standard deviations per axis. ``clear_probability`` (1 is clear air,
    0 is fog) and the ``visibility_m`` of that fog are the stated weather. ``electrons_per_joule``
    are primary electrons per joule of laser light on an aperture. Unknown values are nan; only
    ranging in fog needs them.
    """

    directions: Annotated[Floats, Stored("1", (SPOTS_AXIS, 3))]
    detector_positions_m: Annotated[Floats, Stored("m", (SPOTS_AXIS, 3))]
    detector_axes: Annotated[Floats, Stored("1", (SPOTS_AXIS, 3), nan=True)] = UNKNOWN
    half_fields_rad: Annotated[Floats, Stored("rad", (SPOTS_AXIS,), sign="positive", nan=True)] = (
        UNKNOWN
    )
    falloffs: Annotated[Floats, Stored("1", (SPOTS_AXIS,), nan=True)] = UNKNOWN
    aperture_radii_m: Annotated[
        Floats, Stored("m", (SPOTS_AXIS,), sign="not negative", nan=True)
    ] = UNKNOWN
    beam_divergence_rad: Annotated[float, Stored("rad", sign="not negative", nan=True)] = np.nan
    beam_waist_m: Annotated[float, Stored("m", sign="not negative", nan=True)] = np.nan
    clear_probability: Annotated[float, Stored("1", sign="not negative", nan=True)] = np.nan
    visibility_m: Annotated[float, Stored("m", sign="positive", nan=True)] = np.nan
    electrons_per_joule: Annotated[float, Stored("electron/J", sign="positive", nan=True)] = np.nan

    def __post_init__(self) -> None:
        for name, shape in _DEFAULTS.items():
            if np.ndim(getattr(self, name)) == 0:
                value = np.full((len(self.directions), *shape), getattr(self, name))
                object.__setattr__(self, name, value)


_DEFAULTS: dict[str, tuple[int, ...]] = {
    "detector_axes": (3,),
    "half_fields_rad": (),
    "falloffs": (),
    "aperture_radii_m": (),
}
"""Shape per spot of fields that may be unknown."""


@dataclass(frozen=True, eq=False)
class Spots(SpotOptics):
    """Readings of the spots; base class of the measurement methods.

    ``pointing`` are the unit vectors of each frame, as a mirror's sensor reads them, (frames,
    spots, 3); None if all frames point along ``directions``.
    """

    method: ClassVar[str]
    pointing: Annotated[Floats | None, Stored("1", (FRAMES, SPOTS_AXIS, 3))] = field(
        default=None, kw_only=True
    )

    @property
    def readings(self) -> NDArray[Any]:
        """Readings of the detectors, frames first."""
        raise NotImplementedError

    @property
    def summary(self) -> str:
        """Description of the measurement in a few words."""
        return f"{self.method}, {self.readings.shape[-1]} readings of each spot"

    @property
    def aimed(self) -> Self:
        """The same with ``directions``, and axes of detectors that follow, of the first frame."""
        if self.pointing is None:
            return self
        axes = self.pointing[0] if self.detectors_follow else self.detector_axes
        return replace(self, directions=self.pointing[0], detector_axes=axes)

    @property
    def detectors_follow(self) -> bool:
        """Whether detectors turn with the beams: each looks along its own of ``directions``."""
        return bool((np.abs(self.detector_axes - self.directions) < ALIGNED).all())

    def check(self) -> None:
        """Raise InputError unless the values are consistent."""
        if not 1 <= len(self.directions) <= MAX_SPOTS:
            raise InputError(
                f"spots/directions has {len(self.directions)} spots; allowed: 1..{MAX_SPOTS}"
            )
        _check_directions("directions", self.directions)
        if self.pointing is not None:
            _check_directions("pointing", self.pointing)
        axes = np.linalg.norm(self.detector_axes, axis=1)
        if (np.abs(axes - 1) > 1e-3).any():
            raise InputError(
                "spots/detector_axes must be unit vectors, or nan where unknown; "
                f"their lengths are {np.round(axes, 4).tolist()}"
            )
        if self.clear_probability > 1:
            raise InputError(
                f"spots/clear_probability is {self.clear_probability:g}; allowed: 0..1"
            )
        if (self.half_fields_rad > np.pi / 2).any():
            raise InputError(
                f"spots/half_fields_rad is {np.nanmax(self.half_fields_rad):g}; "
                "must be at most pi/2"
            )


def _check_directions(name: str, directions: Floats) -> None:
    """Raise InputError unless all (..., 3) are unit vectors that point forward."""
    lengths = np.linalg.norm(directions, axis=-1)
    sound = (np.abs(lengths - 1) <= 1e-3) & (directions[..., 2] > 0)
    if not sound.all():
        raise InputError(
            f"spots/{name} must be unit vectors that point forward (z > 0); one is "
            f"{np.round(directions[~sound][0], 4).tolist()}"
        )

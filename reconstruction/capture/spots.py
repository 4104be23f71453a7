"""Time-of-flight readings of the laser spots: what all methods of measuring share.

The lasers leave from the projector's pinhole; L is the whole optical path from there over the spot
to the detector.
"""

from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import InputError
from .schema import Stored


def _unknown() -> Floats:
    """Stands for nan of all spots."""
    return np.array(np.nan)


SPOTS_AXIS, MAX_SPOTS = "spots", 64
"""Name of the axis of the spots, and the most of them."""
USUAL_SPOTS = 4
"""As many as methods of ranging and depth take."""
MAX_PULSE_S = 1e-3
"""Duration of pulses and time bins: light goes 300 km meanwhile."""


def check_four(who: str, spots: "Spots | None") -> None:
    """Raise InputError for spots of another number than methods of ranging and depth take."""
    if spots is not None and not spots.are_four:
        raise InputError(
            f"{who} needs {USUAL_SPOTS} spots; the recording has {len(spots.directions)}"
        )


def check_duration(name: str, duration_s: float) -> None:
    """Raise InputError for a pulse or a time bin that tells no range."""
    if duration_s > MAX_PULSE_S:
        raise InputError(
            f"{name} is {duration_s:g} s, must be at most {MAX_PULSE_S:g} s; if it is in "
            f"nanoseconds, write {duration_s:g}e-9"
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class SpotOptics:
    """Lasers and their detectors: unit vectors from the pinhole to the spots, and what looks.

    Each detector is a round aperture that sees a cone of half angle ``half_fields_rad`` about its
    axis (a unit vector), within it falling off with cos^``falloffs`` of the angle. Beams are
    Gaussian in angle and place, with standard deviations per axis. ``clear_probability`` and
    ``visibility_m`` are what is stated of the weather: 1 is clear air, 0 is fog, of
    that visibility. ``electrons_per_joule`` are primary electrons per joule of laser light on an
    aperture. What is not known is nan; only ranging in fog needs it.
    """

    directions: Annotated[Floats, Stored("1", (SPOTS_AXIS, 3))]
    detector_positions_m: Annotated[Floats, Stored("m", (SPOTS_AXIS, 3))]
    detector_axes: Annotated[Floats, Stored("1", (SPOTS_AXIS, 3), nan=True)] = field(
        default_factory=_unknown
    )
    half_fields_rad: Annotated[Floats, Stored("rad", (SPOTS_AXIS,), sign="positive", nan=True)] = (
        field(default_factory=_unknown)
    )
    falloffs: Annotated[Floats, Stored("1", (SPOTS_AXIS,), sign="not negative", nan=True)] = field(
        default_factory=_unknown
    )
    aperture_radii_m: Annotated[
        Floats, Stored("m", (SPOTS_AXIS,), sign="not negative", nan=True)
    ] = field(default_factory=_unknown)
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
"""Of a spot, the shape of what may be unknown."""


@dataclass(frozen=True, eq=False)
class Spots(SpotOptics):
    """What all methods of measuring share."""

    method: ClassVar[str]

    @property
    def readings(self) -> NDArray[Any]:
        """What the detectors have recorded, frames first."""
        raise NotImplementedError

    @property
    def are_four(self) -> bool:
        """Whether they are as many as methods of ranging and depth take."""
        return len(self.directions) == USUAL_SPOTS

    @property
    def summary(self) -> str:
        """How they were measured, in a few words."""
        return f"{self.method}, {self.readings.shape[-1]} readings of each spot"

    def check(self) -> None:
        """Raise InputError unless the numbers fit together."""
        if not 1 <= len(self.directions) <= MAX_SPOTS:
            raise InputError(
                f"spots/directions has {len(self.directions)} spots; allowed are 1 to {MAX_SPOTS}"
            )
        lengths = np.linalg.norm(self.directions, axis=1)
        if np.abs(lengths - 1).max() > 1e-3 or self.directions[:, 2].min() <= 0:
            raise InputError(
                "spots/directions must be unit vectors that point forward (z > 0); "
                f"their lengths are {np.round(lengths, 4).tolist()}"
            )
        axes = np.linalg.norm(self.detector_axes, axis=1)
        if (np.abs(axes - 1) > 1e-3).any():
            raise InputError(
                "spots/detector_axes must be unit vectors, or nan where they are not known; "
                f"their lengths are {np.round(axes, 4).tolist()}"
            )
        if self.clear_probability > 1:
            raise InputError(
                f"spots/clear_probability is {self.clear_probability:g}; a probability is at most 1"
            )
        if (self.half_fields_rad > np.pi / 2).any():
            raise InputError(
                f"spots/half_fields_rad is {np.nanmax(self.half_fields_rad):g}; the half angle of "
                "a field is at most pi/2"
            )

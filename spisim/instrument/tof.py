"""The interface of time-of-flight methods, and checks that they share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from scipy.constants import c

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from reconstruction.capture import Spots
from reconstruction.capture.spots import SpotOptics
from spisim.instrument.detector import TofDetector
from spisim.instrument.sensor import Reading

#: Bins of the path length per edge of what the readings respond to: light between two is split,
#: which flattens a Gaussian pulse by 0.3 % at most.
BINS_PER_EDGE = 10


@dataclass(frozen=True, eq=False)
class SpotLight:
    """Light on the ranging detectors, in primary electrons.

    `echo_per_s` (frames, spots, bins) is the rate per bin of the path length `path_length_m`
    (bins,), ascending, while the laser is on; `steady_per_s` (frames, spots) is that of daylight,
    the projector's patterns and dark current. `laser_power_w` is that of one laser. Rates are means
    over each frame; `of_part` gives those over a part of it where they change within a frame.
    """

    path_length_m: Floats
    echo_per_s: Floats
    steady_per_s: Floats
    laser_power_w: float
    of_part: Callable[[float, float], SpotLight] | None = None

    def during(self, start: float, stop: float) -> SpotLight:
        """Light in a part of each frame, of which 1 is the whole."""
        return self if self.of_part is None else self.of_part(start, stop)


class Emission(NamedTuple):
    """Emission of one beam: mean power, and energy and duration of its pulses."""

    mean_w: float
    pulse_j: float
    pulse_s: float


class Tof(Protocol):
    """A time-of-flight method with its parameters: a section of an instrument file."""

    @property
    def method(self) -> str:
        """The name that it is registered by, also of its readings in a capture."""

    @property
    def detector(self) -> TofDetector:
        """The photodiodes of the spots."""

    @property
    def unambiguous_range_m(self) -> float:
        """Range beyond which a spot is confused with a nearer one, or not seen."""

    @property
    def frame_time_s(self) -> float:
        """Time per frame; per spot, if all share a photodiode."""

    @property
    def reading(self) -> Reading:
        """Integration times of one reading."""

    @property
    def edge_s(self) -> float:
        """Shortest edge of its response to the delay of light: height over steepest slope."""

    def check_bins(self, bin_width_m: float) -> None:
        """Raise InputError if path-length bins of this width do not resolve its light."""

    def record(
        self, light: SpotLight, optics: SpotOptics, rng: np.random.Generator | None
    ) -> Spots:
        """The recorded readings, as fields of a capture.

        Parameters
        ----------
        light : SpotLight
            Light on the detectors.
        optics : SpotOptics
            Fields common to all methods.
        rng : Generator or None
            Without one, the expected readings of an ideal instrument with unknown noise, which the
            reconstruction trusts completely.
        """

    def path_sigma_m(self, path_m: Floats, echo_per_s: Floats, steady_per_s: Floats) -> Floats:
        """Standard deviation (...) of measured path lengths, in closed form.

        For echoes (...) of one path length each, at rates while the laser is on.
        """

    def emission(self, power_w: float) -> Emission:
        """Emission of one beam of this power in continuous operation."""

    def warnings(self, steady_per_s: float, echo_per_s: float) -> list[str]:
        """Warnings about saturation by so many electrons per second on one detector."""


def check_charge(method: str, detector: TofDetector) -> None:
    """Raise InputError unless the detector integrates charge, background included."""
    if detector.sensor.counts:
        raise InputError(
            f"{method} integrates charge; a {detector.sensor.type} sensor counts: choose method "
            "dtof"
        )
    if detector.amplifier is not None and detector.amplifier.coupling == "ac":
        raise InputError(
            f"detector.amplifier.coupling should be dc: {method} subtracts the background itself"
        )


def overflow(tof: Tof, steady_per_s: float, echo_per_s: float) -> list[str]:
    """Warnings about the charge of one reading, of constant light and echo, that overflows."""
    detector, time_s = tof.detector, tof.reading.steady_s
    background = steady_per_s * time_s
    whole = background + echo_per_s * time_s
    return detector.sensor.warnings("tof.detector", detector, time_s, background, whole)


def path_step_m(tof: Tof) -> float:
    """Maximum width of path-length bins that resolve its light."""
    return c * tof.edge_s / BINS_PER_EDGE


def check_pulse(tof: Tof, field: str, pulse_s: float, bin_width_m: float) -> None:
    """Raise InputError, naming the field, for a pulse with an edge shorter than its bins."""
    if path_step_m(tof) < bin_width_m:
        shortest = pulse_s * bin_width_m / path_step_m(tof)
        raise InputError(
            f"tof.{field} {pulse_s:g}: an edge of the pulse is shorter than {BINS_PER_EDGE} bins "
            f"of the path-length histogram; at least {shortest:.4g}"
        )

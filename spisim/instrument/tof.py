"""What a method of ranging the spots is."""

from __future__ import annotations

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

#: Bins of the light's path lengths that resolve a pulse.
BINS_PER_PULSE = 4


@dataclass(frozen=True, eq=False)
class SpotLight:
    """What reaches the ranging detectors, in primary electrons.

    `echo_per_s` (frames, spots, bins) is the rate per histogram bin of the path length
    `path_length_m` (bins,), ascending, for a laser that is on; `steady_per_s` (frames, spots) that
    of daylight, the projector's patterns and the dark current. `laser_power_w` is that of one
    laser.
    """

    path_length_m: Floats
    echo_per_s: Floats
    steady_per_s: Floats
    laser_power_w: float


class Emission(NamedTuple):
    """What one beam sends: its mean power and its pulses."""

    mean_w: float
    pulse_j: float
    pulse_s: float


class Tof(Protocol):
    """A method with its settings: a section of an instrument's file."""

    @property
    def method(self) -> str:
        """The name that it is registered by; that of its readings in a capture too."""

    @property
    def detector(self) -> TofDetector:
        """The photodiodes of the spots."""

    @property
    def unambiguous_range_m(self) -> float:
        """Range from which on a spot is not told from a nearer one, or not seen."""

    @property
    def frame_time_s(self) -> float:
        """Time that a frame takes; of each spot, where all share a photodiode."""

    @property
    def reading(self) -> Reading:
        """What one reading collects."""

    def check_bins(self, bin_width_m: float) -> None:
        """Raise InputError where path lengths in such bins do not resolve its light."""

    def record(
        self, light: SpotLight, optics: SpotOptics, rng: np.random.Generator | None
    ) -> Spots:
        """What is recorded; its fields that all methods have in common are `vars(optics)`.

        Without `rng`: the expected readings of an ideal instrument, whose noise is unknown, so that
        reconstruction takes every reading at its word.
        """

    def path_sigma_m(self, path_m: Floats, echo_per_s: Floats, steady_per_s: Floats) -> Floats:
        """Standard deviation (...) of the path lengths measured, in closed form.

        For echoes (...) of one path length each, at rates while the laser is on.
        """

    def emission(self, power_w: float) -> Emission:
        """What one beam of this power sends, taken as always in use."""

    def warnings(self, steady_per_s: float, echo_per_s: float) -> list[str]:
        """Sentences about so many electrons per second on one detector that overwhelm it."""


def check_charge(method: str, detector: TofDetector) -> None:
    """Raise InputError unless the detector integrates charge, the background included."""
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
    """Sentences about charge of one reading, the steady light's and the echo's, that overflows."""
    detector, time_s = tof.detector, tof.reading.steady_s
    background = steady_per_s * time_s
    whole = background + echo_per_s * time_s
    return detector.sensor.warnings("tof.detector", detector, time_s, background, whole)


def check_pulse(field: str, pulse_s: float, bin_width_m: float) -> None:
    """Raise InputError, naming the field, for a pulse shorter than a few bins."""
    shortest = BINS_PER_PULSE * bin_width_m / c
    if pulse_s < shortest:
        raise InputError(
            f"tof.{field} {pulse_s:g}: a pulse is shorter than {BINS_PER_PULSE} bins of the "
            f"path-length histogram; at least {shortest:.4g}"
        )

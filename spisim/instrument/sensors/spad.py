"""Single-photon avalanche diodes: counts with dead time and after-pulses."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field
from scipy.constants import c, h

from reconstruction.base.arrays import Floats
from spisim.base.config import NonNegative, Number
from spisim.instrument.sensor import (
    FWHM_PER_SIGMA,
    Each,
    FrontEnd,
    PulseTiming,
    Random,
    Readings,
    Sensor,
    Spectral,
    covers,
    spectral_value,
)
from spisim.instrument.stamping.first_photons import PILE_UP, FirstPhotons

#: Mean count above which a normal distribution replaces the renewal process.
LARGE_COUNT = 1000.0
#: Counts above this fraction of one per dead time carry no information about the light.
MAX_FRACTION_OF_FULL = 0.95


class Spad(Sensor):
    """Avalanche diode in Geiger mode: a counter with `dead_time_s` after each detection.

    Each detection is followed by another, of a trapped carrier, with `afterpulse_probability`.
    """

    counts: ClassVar[bool] = True
    type: Literal["spad"]
    """Type discriminator."""
    detection_efficiency: Spectral
    """Detections per photon; one value, or rows of wavelength in nm and value."""
    dark_count_rate_hz: NonNegative
    """Dark count rate, without after-pulses."""
    dead_time_s: NonNegative
    """Dead time after a detection."""
    afterpulse_probability: Annotated[Number, Field(ge=0, lt=1)] = 0.0
    """Probability that a detection is followed by an after-pulse."""
    jitter_fwhm_s: NonNegative = 0.0
    """Full width at half maximum of the time stamp's Gaussian jitter."""

    @property
    def gain(self) -> float:
        return 1.0

    @property
    def excess_noise_factor(self) -> float:
        """Excess noise of a count with its geometric cascade of after-pulses."""
        return 1 + self.afterpulse_probability

    @property
    def dark_rate_hz(self) -> float:
        """Dark counts per second, without after-pulses."""
        return self.dark_count_rate_hz

    @property
    def dead_time_per_primary_s(self) -> float:
        """Dead time of a primary detection with its cascade of after-pulses."""
        return self.dead_time_s / (1 - self.afterpulse_probability)

    def electrons_per_joule(self, wavelength_nm: ArrayLike) -> Floats:
        """Primary detections per joule on the diode."""
        at = np.asarray(wavelength_nm, dtype=np.float64)
        return spectral_value(self.detection_efficiency, at) * at * 1e-9 / (h * c)

    def at_band(self, band_nm: tuple[float, float], old_nm: float, new_nm: float) -> Self:
        if covers(self.detection_efficiency, band_nm):
            return self
        old = float(spectral_value(self.detection_efficiency, old_nm))
        return self.model_copy(update={"detection_efficiency": old})

    def too_efficient(self, shortest_nm: float) -> str:
        return "detection_efficiency is more than 1"

    def read(
        self,
        detector: FrontEnd,
        electrons: Floats,
        time_s: Each,
        rng: Random,
        taken_off: Each = 0.0,
    ) -> Readings:
        """Counts of all diodes of the detector, each with its own dead time; see `Sensor.read`."""
        diodes = len(detector.positions_m)
        each = electrons / diodes
        if rng is None:
            counts: Any = diodes * self.expected_counts(each, time_s)
        else:
            counts = sum(self.draw_counts(each, time_s, rng) for _ in range(diodes))
        maximum = diodes * time_s / self.dead_time_s if self.dead_time_s > 0 else np.inf
        return Readings(
            counts,
            np.asarray(counts >= MAX_FRACTION_OF_FULL * maximum),
            electrons_per_count=1 - self.afterpulse_probability,
            offset_counts=0.0,
            noise_electrons=0.0,
            excess_noise_factor=self.excess_noise_factor,
            dead_time_s=self.dead_time_per_primary_s / diodes,
        )

    def expected_counts(self, primaries: Floats, time_s: Each) -> Floats:
        """Mean counts for mean primaries N without dead time, after-pulses included.

        Non-paralysable: m = N / (1 + N τ / T).
        """
        blind = primaries * self.dead_time_per_primary_s / time_s
        return np.asarray(primaries / (1 + blind) / (1 - self.afterpulse_probability))

    def draw_counts(
        self, primaries: Floats, time_s: Each, rng: np.random.Generator
    ) -> NDArray[np.int32]:
        """Draw counts (frames, ...) for mean detections `primaries`.

        A renewal process: an exponential wait, a detection with a geometric number of after-pulses,
        and a dead time for each (J. W. Müller, Nucl. Instrum. Methods 112, 47 (1973)). Large counts
        are normal, of variance (1 + p) N / (1 + N τ / T)³ / (1 - p)².
        """
        expected = self.expected_counts(primaries, time_s)
        many = expected > LARGE_COUNT
        counts = np.empty(primaries.shape)
        counts[~many] = self._events(primaries[~many], time_s, rng)
        p = self.afterpulse_probability
        blind = primaries[many] * self.dead_time_per_primary_s / time_s
        sigma = np.sqrt((1 + p) * primaries[many] / (1 + blind) ** 3) / (1 - p)
        counts[many] = np.rint(rng.normal(expected[many], sigma))
        return counts.astype(np.int32)

    def _events(self, primaries: Floats, time_s: Each, rng: np.random.Generator) -> Floats:
        """Counts, simulated detection by detection for all readings at once.

        A reading begins live; after-pulses beyond its end are not counted.
        """
        counts = np.zeros(primaries.shape)
        with np.errstate(divide="ignore"):
            waits = time_s / primaries
        going = np.flatnonzero(np.isfinite(waits))
        waits, times = waits[going], np.zeros(going.size)
        while going.size:
            times += waits * rng.standard_exponential(going.size)
            on = times < time_s
            going, waits, times = going[on], waits[on], times[on]
            cascade = rng.geometric(1 - self.afterpulse_probability, going.size)
            counts[going] += np.minimum(cascade, self._room(time_s - times))
            times += cascade * self.dead_time_s
        return counts

    def _room(self, left_s: Floats) -> Floats:
        """Detections one dead time apart, from now on, within the times that are left."""
        if self.dead_time_s == 0:
            return np.full_like(left_s, np.inf)
        return np.asarray(np.ceil(left_s / self.dead_time_s))

    def warnings(
        self, name: str, detector: FrontEnd, time_s: float, background: float, whole: float
    ) -> list[str]:
        """Warnings about pile-up; see `Sensor.warnings`."""
        blind = whole / len(detector.positions_m) / time_s * self.dead_time_s
        if blind < PILE_UP:
            return []
        return [
            f"{name} would fire {blind:.2g} times per dead time, so counts pile up; "
            f"below {PILE_UP:g} they would not"
        ]

    def stamping(self, tof: PulseTiming) -> FirstPhotons:
        """Stamps the first detection of a gate."""
        jitter_s = self.jitter_fwhm_s / FWHM_PER_SIGMA
        return FirstPhotons(tof, jitter_s, self.dead_time_s, self.afterpulse_probability)


SENSOR = Spad

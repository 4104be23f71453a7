"""Interfaces of sensors, which convert light into electrons, and electrons into readings.

Electrons are *primary* throughout: one per detected photon, before any gain.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import AfterValidator, Field
from scipy.constants import c, h

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.base.config import Number, Positive, Section, Vector
from spisim.instrument.electronics import Adc, Amplifier
from spisim.instrument.response import Response

Random = np.random.Generator | None
Each = float | Floats
PositiveFraction = Annotated[Number, Field(gt=0, le=1)]

FWHM_PER_SIGMA = 2 * math.sqrt(2 * math.log(2))


def _rising(table: Any) -> Any:
    if isinstance(table, tuple):
        wavelengths = [row[0] for row in table]
        if len(table) < 2 or wavelengths != sorted(set(wavelengths)):
            raise InputError("a table needs rows [wavelength_nm, value] of rising wavelength")
    return table


#: One value for the whole band, or rows of wavelength (nm) and value, linear between.
Spectral = Annotated[Positive | tuple[tuple[Positive, Positive], ...], AfterValidator(_rising)]


def spectral_value(curve: Any, wavelength_nm: ArrayLike) -> Floats:
    """Values of a `Spectral` field at some wavelengths; a table is constant beyond its ends."""
    at = np.asarray(wavelength_nm, dtype=np.float64)
    if isinstance(curve, tuple):
        return np.asarray(np.interp(at, *np.transpose(curve)))
    return np.full(at.shape, float(curve))


def covers(curve: Any, band_nm: tuple[float, float]) -> bool:
    """Whether a `Spectral` field is a table that covers a band."""
    return isinstance(curve, tuple) and curve[0][0] <= band_nm[0] and band_nm[1] <= curve[-1][0]


@dataclass(frozen=True, eq=False)
class Readings:
    """Counts (frames, ...) and their calibration; see `reconstruction.capture.Charge`."""

    counts: NDArray[Any]
    saturated: NDArray[np.bool_]
    electrons_per_count: float
    offset_counts: float
    noise_electrons: Any
    excess_noise_factor: float
    dead_time_s: float = 0.0

    @property
    def charge(self) -> dict[str, Any]:
        """Calibration of a converter's counts, as fields of `Charge`."""
        names = ("electrons_per_count", "offset_counts", "noise_electrons", "excess_noise_factor")
        return {name: getattr(self, name) for name in names}


@dataclass(frozen=True)
class Reading:
    """Effective integration times of one reading of a ranging detector.

    `echo_s` is the time for which a laser left on would collect as much.
    """

    name: str  # as "tap"
    steady_s: float
    echo_s: float
    amplifier_s: float
    converted: bool = True  # by an ADC


class FrontEnd(Protocol):
    """The detector around a sensor, as the sensor's readings need it."""

    @property
    def sensor(self) -> Sensor: ...
    @property
    def amplifier(self) -> Amplifier | None: ...
    @property
    def adc(self) -> Adc | None: ...
    @property
    def positions_m(self) -> tuple[Vector, ...]: ...
    def amplifier_noise_electrons(self, time_s: ArrayLike) -> Any: ...
    def electronics_noise_electrons(self, time_s: ArrayLike) -> Any: ...


class PulseTiming(Protocol):
    """Pulse, gate and detector of direct time of flight, as time stamps need them."""

    @property
    def detector(self) -> FrontEnd: ...
    @property
    def pulses(self) -> int: ...
    @property
    def pulse_sigma_s(self) -> float: ...
    @property
    def bins(self) -> int: ...
    @property
    def bin_width_s(self) -> float: ...
    @property
    def gate_s(self) -> float: ...
    @property
    def threshold_sigma(self) -> float | None: ...
    @property
    def diodes(self) -> int: ...
    @property
    def response(self) -> Response | None: ...


class Stamping(Protocol):
    """How a detector stamps the times of single arrivals, at most one per cycle."""

    @property
    def piles_up(self) -> bool:
        """Whether the first of many photons ends a cycle and hides later ones."""

    @property
    def dead_time_s(self) -> float:
        """Dead time after a stamp."""

    @property
    def response_sigma_s(self) -> float:
        """Standard deviation of pulse and time stamp together; nan if it varies."""

    @property
    def delay_offset_s(self) -> float:
        """Calibrated delay of the pulse that ranging sees."""

    @property
    def reading(self) -> Reading:
        """What one reading collects."""

    def check(self) -> None:
        """Raise InputError if the fields do not fit."""

    def chances(self, path_m: Floats, echo_per_s: Floats, steady_per_s: float) -> Floats:
        """Probability (bins,) of a cycle's time stamp in each bin of the gate; laser on.

        Of one diode, which receives this light.
        """

    def sigma_s(self, path_m: Floats, echo_per_s: Floats, steady_per_s: Floats) -> Floats:
        """Standard deviation (...) of measured delays, in closed form."""

    def warnings(self, steady_per_s: float) -> list[str]:
        """Warnings about effects of constant light."""


class Sensor(Section, ABC):
    """Base of all sensors; `type` is the name that each is registered by."""

    counts: ClassVar[bool] = False
    """Whether it counts pulses, rather than integrating charge."""

    photoactive_area_mm2: Positive
    """Area of one photodiode."""
    fill_factor: PositiveFraction = 1.0
    """Active fraction of the area."""

    if TYPE_CHECKING:  # fields of some sensors, which properties here would shadow

        @property
        def type(self) -> str:
            """Name of the sensor."""

        @property
        def gain(self) -> float:
            """Electrons per primary electron; 1 of a counter."""

    @property
    def effective_area_m2(self) -> float:
        """Active area."""
        return self.photoactive_area_mm2 * 1e-6 * self.fill_factor

    @property
    @abstractmethod
    def excess_noise_factor(self) -> float:
        """Variance of the charge per primary electron, in primary electrons squared."""

    @property
    @abstractmethod
    def dark_rate_hz(self) -> float:
        """Primary dark electrons per second."""

    @abstractmethod
    def electrons_per_joule(self, wavelength_nm: ArrayLike) -> Floats:
        """Primary electrons per joule on the sensor, by wavelength (...)."""

    @abstractmethod
    def at_band(self, band_nm: tuple[float, float], old_nm: float, new_nm: float) -> Self:
        """For light of another band: as efficient as at `old_nm`, unless a table covers it."""

    @abstractmethod
    def too_efficient(self, shortest_nm: float) -> str:
        """Error message for more than one electron per photon, with its field."""

    @abstractmethod
    def read(
        self,
        detector: FrontEnd,
        electrons: Floats,
        time_s: Each,
        rng: Random,
        taken_off: Each = 0.0,
    ) -> Readings:
        """One recording.

        Signal, daylight and dark current arrive as one Poisson process.

        Parameters
        ----------
        detector : FrontEnd
            The detector with this sensor.
        electrons : (frames, ...) array
            Mean primary electrons.
        time_s : float or (...) array
            Durations of the windows.
        rng : Generator or None
            Without one, the expected readings of an ideal instrument with unknown noise.
        taken_off : float or (...) array
            Electrons removed by an AC-coupled amplifier, whose noise stays.
        """

    @abstractmethod
    def warnings(
        self, name: str, detector: FrontEnd, time_s: float, background: float, whole: float
    ) -> list[str]:
        """Warnings about readings of `time_s` that saturate with these mean electrons.

        `background` excludes image or echo, `whole` includes it; `name` is the detector's field.
        """

    @abstractmethod
    def stamping(self, tof: PulseTiming) -> Stamping:
        """How it stamps the times of single arrivals."""


def quantum_efficiency(sensor: Sensor, wavelength_nm: ArrayLike) -> Floats:
    """Detected electrons per photon at wavelengths (...), nm."""
    photon_energy = h * c / (np.asarray(wavelength_nm, dtype=np.float64) * 1e-9)
    return sensor.electrons_per_joule(wavelength_nm) * photon_energy

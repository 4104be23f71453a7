"""The paper's equations (1) to (3), as printed and corrected, and its integration time.

"Evaluation of a 3D imaging vision system based on a single-pixel InGaAs detector and the
Time-of-Flight principle for drones". Eq. (1) counts the electrons of a photodiode behind a lens
that looks at a lit Lambertian target, Eq. (2) its noise, Eq. (3) the standard deviation of a range.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.constants import c, elementary_charge

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.instrument import Instrument, Photodiode

#: What equals the noise floor at maximum range: the signal, which is physical, or all of Eq. (1),
#: in which daylight counts as signal, as in the paper's step 4.
Criterion = Literal["signal", "total"]

MIN_TIME_S, MAX_TIME_S = 1e-12, 1e3
RELATIVE_TOLERANCE = 1e-6
#: Times tried for several goals together.
TIMES = 4001


@dataclass(frozen=True)
class Flood:
    """A flood light and one photodiode behind a lens, as in Eq. (1), in clear air.

    `half_angle_deg` is α_FOV: the light covers the disc π z² tan²α uniformly. Table 1 has 20°, and
    does not say whether half or full. Valid if the photodiode sees just this disc.
    """

    power_w: float
    half_angle_deg: float
    effective_area_m2: float  # A_ph, fill factor included
    f_number: float
    electrons_per_joule: float  # QE λ / hc times the lens's transmittance
    daylight_w_per_m2: float  # in the filter's band, on the target
    dark_per_s: float
    noise_a_per_sqrt_hz: float  # of the amplifier, one-sided, at its input
    gain: float = 1.0
    excess_noise_factor: float = 1.0

    @classmethod
    def of(
        cls,
        instrument: Instrument,
        *,
        power_w: float,
        half_angle_deg: float,
        illuminance_klx: float,
        noise_a_per_sqrt_hz: float,
        sensor: Photodiode | None = None,
    ) -> Flood:
        """Lens, filter and photodiode of an instrument's bucket detector, or another `sensor`."""
        detector = instrument.imaging.detector
        diode = sensor or detector.sensor
        assert detector.f_number is not None
        wavelength = instrument.wavelength_nm
        through = detector.lens_transmittance * instrument.filter.transmittance
        return cls(
            power_w=power_w,
            half_angle_deg=half_angle_deg,
            effective_area_m2=diode.effective_area_m2,
            f_number=detector.f_number,
            electrons_per_joule=through * float(diode.electrons_per_joule(wavelength)),
            daylight_w_per_m2=instrument.daylight_irradiance(illuminance_klx),
            dark_per_s=diode.dark_rate_hz,
            noise_a_per_sqrt_hz=noise_a_per_sqrt_hz,
            gain=diode.gain,
            excess_noise_factor=diode.excess_noise_factor,
        )

    @property
    def signal_per_s(self) -> float:
        """Electrons/s of the light from a white target at 1 m; falls as z⁻²."""
        disc_m2 = math.pi * math.tan(math.radians(self.half_angle_deg)) ** 2
        return self._per_irradiance * self.power_w / disc_m2

    @property
    def background_per_s(self) -> float:
        """Electrons/s of daylight from a white target at any distance."""
        return self._per_irradiance * self.daylight_w_per_m2

    @property
    def _per_irradiance(self) -> float:
        return self.electrons_per_joule * self.effective_area_m2 / (4 * self.f_number**2)

    def read_noise_electrons(self, time_s: ArrayLike) -> Floats:
        """Rms charge of the amplifier in a window, in primary electrons."""
        charge = self.noise_a_per_sqrt_hz * np.sqrt(np.asarray(time_s) / 2)
        return np.asarray(charge / (elementary_charge * self.gain))


def eq1(flood: Flood, time_s: ArrayLike, distance_m: ArrayLike, reflectance: ArrayLike) -> Floats:
    """Eq. (1) corrected: electrons of signal and background in the time T_int.

    E = ρ T_int [S / z² + B]: T_int once, and in-band light in place of δ(λ - λ₂).
    """
    rate = flood.signal_per_s / np.square(distance_m) + flood.background_per_s
    return np.asarray(np.asarray(reflectance) * np.asarray(time_s) * rate)


def eq1_as_printed(
    flood: Flood, time_s: ArrayLike, distance_m: ArrayLike, reflectance: ArrayLike
) -> Floats:
    """Eq. (1) as printed, with T_int twice: electron seconds, no count, and squared in T_int."""
    return eq1(flood, time_s, distance_m, reflectance) * np.asarray(time_s)


def eq2(flood: Flood, time_s: ArrayLike, reflectance: ArrayLike) -> Floats:
    """Eq. (2): noise floor, electrons rms, of background and dark shot noise and read noise.

    The paper calls it a variance. It lacks the shot noise of the signal.
    """
    background = np.asarray(reflectance) * flood.background_per_s
    shot = flood.excess_noise_factor * (background + flood.dark_per_s) * np.asarray(time_s)
    return np.sqrt(shot + flood.read_noise_electrons(time_s) ** 2)


def tap_factor(width: float) -> float:
    """F(x) = √x sinc(x) of Eq. (3), x = T_TAP / T_p: 0.4502 at ¼ and ½, at most 0.4803."""
    return math.sqrt(width) * float(np.sinc(width))


def eq3(
    d_max_m: float,
    signal: ArrayLike,
    background: ArrayLike,
    periods: ArrayLike,
    tap_width: float,
    *,
    excess_noise_factor: float = 1.0,
    tap_noise: float = 0.0,
) -> Floats:
    """Eq. (3): standard deviation of a range, m.

    σ = d_max / A_R √((A_R + 2B) / N_acc) / (2π F(x)) holds for four taps of width x of a period,
    each for all N_acc periods. `signal` A_R are the electrons per period at the peak of the raised
    cosine, twice the mean; `background` B those that arrive; d_max = c / 2f. As printed it ignores
    amplifier and avalanche; with the noise factor F_x and the rms electrons `tap_noise` of a tap in
    one period, F_x (A_R + 2B) + 2 σ_tap² / x stands under the root.
    """
    signal = np.asarray(signal, dtype=np.float64)
    shot = excess_noise_factor * (signal + 2 * np.asarray(background))
    noise = np.sqrt((shot + 2 * tap_noise**2 / tap_width) / np.asarray(periods))
    return np.asarray(d_max_m / signal * noise / (2 * math.pi * tap_factor(tap_width)))


def range_sigma_eq3_m(
    flood: Flood,
    distance_m: ArrayLike,
    reflectance: ArrayLike,
    periods: ArrayLike,
    *,
    d_max_m: float,
    tap_width: float,
) -> Floats:
    """Eq. (3) with A_R and B from Eq. (1) and an amplifier; the light's power is its peak."""
    period_s = 2 * d_max_m / c
    reflectance = np.asarray(reflectance)
    return eq3(
        d_max_m,
        reflectance * flood.signal_per_s / np.square(distance_m) * period_s,
        (reflectance * flood.background_per_s + flood.dark_per_s) * period_s,
        periods,
        tap_width,
        excess_noise_factor=flood.excess_noise_factor,
        tap_noise=float(flood.read_noise_electrons(tap_width * period_s)),
    )


def max_range_m(
    flood: Flood, time_s: ArrayLike, reflectance: ArrayLike, criterion: Criterion
) -> Floats:
    """Step 4: distance where the count equals Eq. (2); inf if daylight alone exceeds it."""
    brightness = np.asarray(reflectance, dtype=np.float64)
    needed = eq2(flood, time_s, brightness) / np.asarray(time_s)
    if criterion == "total":
        needed = needed - brightness * flood.background_per_s
    with np.errstate(divide="ignore"):
        squared = brightness * flood.signal_per_s / np.maximum(needed, 0)
    return np.sqrt(squared)


def integration_time_s(
    flood: Flood, reflectance: float, goal_m: float, criterion: Criterion
) -> float:
    """Step 5: time at which the maximum range meets the goal; InputError beyond 1000 s."""

    def enough(time_s: float) -> bool:
        return bool(max_range_m(flood, time_s, reflectance, criterion) >= goal_m)

    low = high = MIN_TIME_S
    while not enough(high):
        low, high = high, 2 * high
        if high > MAX_TIME_S:
            raise InputError(
                f"no integration time up to {MAX_TIME_S:g} s brings the light of "
                f"{flood.power_w:g} W to {goal_m:g} m"
            )
    while high > low * (1 + RELATIVE_TOLERANCE):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if enough(middle) else (middle, high)
    return high


def common_integration_time_s(
    flood: Flood, goals_m: Mapping[float, float], criterion: Criterion
) -> float:
    """The time whose maximum ranges fit the goals by reflectance best, in least squares of logs."""
    alone = [integration_time_s(flood, rho, goal, criterion) for rho, goal in goals_m.items()]
    times = np.geomspace(min(alone), max(alone), TIMES)
    goals = np.array(list(goals_m.values()))
    ranges_m = max_range_m(flood, times[:, None], np.array(list(goals_m)), criterion)
    misfit = np.sum(np.log(ranges_m / goals) ** 2, axis=-1)
    return float(times[np.argmin(misfit)])

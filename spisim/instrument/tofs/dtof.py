"""Direct time of flight: histograms of single arrivals."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator
from scipy.constants import c

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from reconstruction.capture.readings.dtof import HistogramSpots
from reconstruction.capture.spots import SpotOptics
from spisim.base.config import Count, Number, Positive, Section
from spisim.instrument.detector import TofDetector
from spisim.instrument.response import Response
from spisim.instrument.sensor import FWHM_PER_SIGMA, Reading, Stamping
from spisim.instrument.tof import Emission, SpotLight, check_pulse

#: Saturation: too few cycles remain without a photon to tell late light from early.
MAX_FRACTION_OF_CYCLES = 0.99


class DirectTof(Section):
    """Direct time of flight: each pulse gives at most one time stamp for a histogram.

    A single-photon diode stamps its first detection in the gate. A charge detector stamps the first
    crossing of a threshold, `threshold_sigma` times the rms noise of the current, as the midpoint
    between rising and falling edge, which does not depend on the pulse's height.
    """

    method: Literal["dtof"]
    """Method discriminator."""
    pulse_fwhm_s: Positive
    """Full width at half maximum of the Gaussian pulse of light."""
    pulses: Count
    """Pulses per frame."""
    response: Response | None = None
    """Measured response, in place of Gaussian pulse and jitter; the pulse keeps its energy."""
    diodes: Count = 1
    """Diodes of a spot, which share its light and stamp independently."""
    speckle_contrast: Annotated[Number, Field(ge=0, le=0.5)] = 0.0
    """Standard deviation of a spot's echo from frame to frame over its mean."""
    repetition_rate_hz: Positive
    """Pulses per second; the gate fits between them."""
    bin_width_s: Positive
    """Width of a histogram bin."""
    bins: Annotated[int, Field(ge=3, le=2**20)]
    """Histogram bins, which make the gate."""
    threshold_sigma: Number | None = None
    """Threshold of a photodiode over the rms noise of its current, at least 1."""
    detector: TofDetector
    """Detectors of the spots."""

    @property
    def gate_s(self) -> float:
        """Duration of a cycle's gate, from the centre of the pulse."""
        return self.bins * self.bin_width_s

    @property
    def unambiguous_range_m(self) -> float:
        """Range beyond which light arrives after the gate."""
        return c * self.gate_s / 2

    @property
    def pulse_sigma_s(self) -> float:
        """Standard deviation of the pulse of light."""
        return self.pulse_fwhm_s / FWHM_PER_SIGMA

    @property
    def stamping(self) -> Stamping:
        """How the detector stamps times."""
        return self.detector.sensor.stamping(self)

    @property
    def frame_time_s(self) -> float:
        return self.pulses / self.repetition_rate_hz

    @property
    def reading(self) -> Reading:
        return self.stamping.reading

    @property
    def edge_s(self) -> float:
        if self.response is not None:
            return self.response.edge_s
        return self.pulse_sigma_s * math.sqrt(math.e)  # of a Gaussian

    def check_bins(self, bin_width_m: float) -> None:
        if self.response is None:
            check_pulse(self, "pulse_fwhm_s", self.pulse_fwhm_s, bin_width_m)
        else:
            check_pulse(self, "response", self.response.edge_s, bin_width_m)

    def record(
        self, light: SpotLight, optics: SpotOptics, rng: np.random.Generator | None
    ) -> HistogramSpots:
        """The histograms; see `Tof.record`."""
        if rng is not None and self.speckle_contrast:
            gain = 1 + self.speckle_contrast * rng.standard_normal(light.steady_per_s.shape)
            light = replace(light, echo_per_s=light.echo_per_s * np.maximum(gain, 0)[..., None])
        stamping, chances, cycles = self.stamping, self._chances(light), self.pulses * self.diodes
        if rng is None:
            counts: NDArray[Any] = cycles * chances
        else:
            none = np.maximum(1 - chances.sum(axis=-1, keepdims=True), 0)
            cases = np.concatenate([chances, none], axis=-1)
            drawn = rng.multinomial(cycles, cases / cases.sum(axis=-1, keepdims=True))
            counts = drawn[..., :-1].astype(np.int32)
        response = {}
        if self.response is not None:
            times_ns, rates = np.transpose(self.response.samples_ns)
            response = {
                "response_s": 1e-9 * times_ns - stamping.delay_offset_s,
                "response": rates,
            }
        return HistogramSpots(
            **vars(optics),
            **response,
            counts=counts,
            saturated=stamping.piles_up & (chances.sum(axis=-1) > MAX_FRACTION_OF_CYCLES),
            bin_width_s=self.bin_width_s,
            start_s=0.0,
            pulses=cycles,
            response_sigma_s=stamping.response_sigma_s,
            delay_offset_s=stamping.delay_offset_s,
            piles_up=stamping.piles_up,
            laser_energy_j=self.pulses * self.emission(light.laser_power_w).pulse_j,
        )

    def _chances(self, light: SpotLight) -> Floats:
        """Probabilities (frames, spots, bins) of a time stamp, computed once for equal light."""
        cached: dict[bytes, Floats] = {}
        stamping = self.stamping

        def chances(echo: Floats, steady: Any) -> Floats:
            key = echo.tobytes() + steady.tobytes()
            if key not in cached:
                cached[key] = stamping.chances(
                    light.path_length_m, echo / self.diodes, float(steady) / self.diodes
                )
            return cached[key]

        return np.array(
            [
                [chances(*spot) for spot in zip(*frame, strict=True)]
                for frame in zip(light.echo_per_s, light.steady_per_s, strict=True)
            ]
        )

    def path_sigma_m(self, path_m: Floats, echo_per_s: Floats, steady_per_s: Floats) -> Floats:
        each = (rate / self.diodes for rate in (echo_per_s, steady_per_s))
        return c * self.stamping.sigma_s(path_m, *each)

    def emission(self, power_w: float) -> Emission:
        energy = power_w * self.pulse_sigma_s * math.sqrt(2 * math.pi)
        return Emission(energy * self.repetition_rate_hz, energy, self.pulse_fwhm_s)

    def warnings(self, steady_per_s: float, echo_per_s: float) -> list[str]:
        return self.stamping.warnings(steady_per_s / self.diodes)

    @model_validator(mode="after")
    def _fits(self) -> DirectTof:
        self.stamping.check()
        highest = 1 / (self.gate_s + self.stamping.dead_time_s)
        if self.repetition_rate_hz > highest * (1 + 1e-9):
            raise InputError(
                f"repetition_rate_hz {self.repetition_rate_hz:g}: the gate of bins · bin_width_s, "
                f"{self.gate_s:.4g} s, and the dead time do not fit a period; at most {highest:.4g}"
            )
        return self


TOF = DirectTof

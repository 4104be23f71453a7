"""Amplifier and converter behind a photodiode."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.base.config import NonNegative, Number, Positive, Section


class Amplifier(Section):
    """Transimpedance amplifier with one pole at `bandwidth_hz`, or without a relevant one.

    Noise is one-sided and input-referred. With AC coupling, changes slower than `low_cut_hz` are
    removed, above all daylight, whose shot noise remains.
    """

    noise_pa_per_sqrt_hz: NonNegative
    """One-sided, input-referred current noise."""
    corner_hz: NonNegative = 0.0
    """Corner frequency of 1/f noise, below which it exceeds the white noise; bucket detectors."""
    drift_pa_per_min: Number = 0.0
    """Drift of the input current over a recording; bucket detectors."""
    bandwidth_hz: Positive | None = None
    """Frequency of its pole; no relevant pole by default."""
    coupling: Literal["dc", "ac"] = "dc"
    """Whether the mean current passes."""
    low_cut_hz: Positive | None = None
    """High-pass frequency; goes with coupling `ac`."""

    @model_validator(mode="after")
    def _low_cut_goes_with_ac(self) -> Amplifier:
        if (self.coupling == "ac") != (self.low_cut_hz is not None):
            raise InputError("low_cut_hz goes with coupling ac, and ac needs it")
        return self

    @property
    def is_steady(self) -> bool:
        """Whether noise is white and the current does not drift."""
        return self.corner_hz * self.noise_pa_per_sqrt_hz == 0 and self.drift_pa_per_min == 0

    @property
    def time_constant_s(self) -> float:
        """Time constant of the pole; 0 without one."""
        return 0.0 if self.bandwidth_hz is None else 1 / (2 * math.pi * self.bandwidth_hz)

    def response(self, frequency_hz: Any) -> Any:
        """Complex response to a modulation, 1 / (1 + i f / B)."""
        return 1 / (1 + 2j * math.pi * self.time_constant_s * frequency_hz)


class Adc(Section):
    """Analogue-to-digital converter, scaled to primary photo-electrons."""

    bits: Annotated[int, Field(ge=1, le=31)]
    """Resolution."""
    full_scale_electrons: Annotated[Number, Field(gt=0, le=1e18)]
    """Primary electrons at full scale."""
    offset_counts: Annotated[int, Field(ge=0)]
    """Count at zero charge, below the saturated count."""

    @model_validator(mode="after")
    def _offset_leaves_room(self) -> Adc:
        if self.offset_counts >= self.max_count:
            raise InputError(
                f"offset_counts {self.offset_counts} leaves no room for light: a converter of "
                f"{self.bits} bits ends at {self.max_count}"
            )
        return self

    @property
    def max_count(self) -> int:
        """The saturated count."""
        return 2**self.bits - 1

    @property
    def electrons_per_count(self) -> float:
        """Electrons per count."""
        return self.full_scale_electrons / 2**self.bits

    @property
    def quantisation_noise_electrons(self) -> float:
        """Rms quantisation error, a step over √12."""
        return self.electrons_per_count / math.sqrt(12)

    def converted(self, electrons: Floats) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
        """Rounded and clipped counts, and whether each is at an end of the range."""
        counts = np.rint(electrons / self.electrons_per_count + self.offset_counts)
        clipped = np.clip(counts, 0, self.max_count).astype(np.int32)
        return clipped, (counts <= 0) | (counts >= self.max_count)

    @property
    def headroom_electrons(self) -> float:
        """Maximum charge that is not clipped."""
        return (self.max_count - self.offset_counts) * self.electrons_per_count

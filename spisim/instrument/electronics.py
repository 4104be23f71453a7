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
    """Transimpedance amplifier with one pole at `bandwidth_hz`, or none that matters.

    Noise is one-sided and referred to the current before the amplifier. Coupled by alternating
    current it takes off what changes more slowly than `low_cut_hz`, daylight above all; the
    daylight's shot noise stays.
    """

    noise_pa_per_sqrt_hz: NonNegative
    """One-sided noise of the current before it."""
    bandwidth_hz: Positive | None = None
    """Its pole; without, none that matters."""
    coupling: Literal["dc", "ac"] = "dc"
    """Whether the mean current gets through."""
    low_cut_hz: Positive | None = None
    """What changes more slowly is taken off; goes with coupling `ac`."""

    @model_validator(mode="after")
    def _low_cut_goes_with_ac(self) -> Amplifier:
        if (self.coupling == "ac") != (self.low_cut_hz is not None):
            raise InputError("low_cut_hz goes with coupling ac, and ac needs it")
        return self

    @property
    def time_constant_s(self) -> float:
        """Of the pole; 0 without one."""
        return 0.0 if self.bandwidth_hz is None else 1 / (2 * math.pi * self.bandwidth_hz)

    def response(self, frequency_hz: Any) -> Any:
        """Complex amplitude of a modulation behind the pole, 1 / (1 + i f / B)."""
        return 1 / (1 + 2j * math.pi * self.time_constant_s * frequency_hz)


class Adc(Section):
    """Analogue-to-digital converter, scaled to primary photo-electrons."""

    bits: Annotated[int, Field(ge=1, le=31)]
    """Resolution."""
    full_scale_electrons: Annotated[Number, Field(gt=0, le=1e18)]
    """Primary electrons that fill the range."""
    offset_counts: Annotated[int, Field(ge=0)]
    """Count of no charge, below the count of saturation."""

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
        """The count of saturation."""
        return 2**self.bits - 1

    @property
    def electrons_per_count(self) -> float:
        """Width of a step."""
        return self.full_scale_electrons / 2**self.bits

    @property
    def quantisation_noise_electrons(self) -> float:
        """Rms error of rounding, a step over √12."""
        return self.electrons_per_count / math.sqrt(12)

    def converted(self, electrons: Floats) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
        """Counts of charges, rounded and clipped, and which are at an end of the range."""
        counts = np.rint(electrons / self.electrons_per_count + self.offset_counts)
        clipped = np.clip(counts, 0, self.max_count).astype(np.int32)
        return clipped, (counts <= 0) | (counts >= self.max_count)

    @property
    def headroom_electrons(self) -> float:
        """The largest charge that is not clipped."""
        return (self.max_count - self.offset_counts) * self.electrons_per_count

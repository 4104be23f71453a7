"""Measured response of pulse and detector, in place of a Gaussian."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field, field_validator
from scipy.signal import fftconvolve

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from reconstruction.ranging.histogram import find_pulses
from reconstruction.ranging.shape import fraction_arrived
from spisim.base.config import NonNegative, Number, Section

#: Positions within a bin over which a calibrated delay is averaged.
PHASES = 8
#: Arrivals and cycles of the calibration: so few arrivals hide none.
ARRIVALS, CYCLES = 1e6, 10**12


class Response(Section):
    """Rate of time stamps over the time since a surface reflects the pulse's time zero.

    Pulse, jitter and the diode's tail together, as a wall shows them, linear between samples. Only
    the shape counts.
    """

    samples_ns: Annotated[tuple[tuple[Number, NonNegative], ...], Field(min_length=3)]
    """Rows of rising time in ns and rate; nothing arrives outside."""

    @property
    def start_s(self) -> float:
        """Time of the first sample."""
        return 1e-9 * self.samples_ns[0][0]

    @property
    def end_s(self) -> float:
        """Time of the last sample."""
        return 1e-9 * self.samples_ns[-1][0]

    @property
    def reach_s(self) -> float:
        """Time from zero within which everything arrives."""
        return max(-self.start_s, self.end_s)

    @property
    def edge_s(self) -> float:
        """Highest rate over its steepest slope."""
        times, rates = np.transpose(self.samples_ns)
        return float(1e-9 * rates.max() / np.abs(np.diff(rates) / np.diff(times)).max())

    def arrived(self, time_s: Floats) -> Floats:
        """Fraction (...) of all time stamps before times (...)."""
        times, rates = np.transpose(self.samples_ns)
        return fraction_arrived(times, rates, 1e9 * np.asarray(time_s))

    def applied(self, rate: Floats, step_s: float) -> Floats:
        """A rate (times,) in even steps, spread out by the response."""
        before, after = math.ceil(-self.start_s / step_s) + 1, math.ceil(self.end_s / step_s) + 1
        before, after = max(before, 0), max(after, 0)
        edges: Floats = (np.arange(-before, after + 2, dtype=np.float64) - 0.5) * step_s
        spread = fftconvolve(rate, np.diff(self.arrived(edges)))
        return np.asarray(np.maximum(spread[before : before + rate.size], 0))

    def as_gaussian(self, bin_width_s: float) -> tuple[float, float]:
        """Delay and standard deviation, s, of the Gaussian pulse fitted to histograms of it.

        What a rig finds that calibrates itself on a flat target.
        """
        before, after = math.ceil(-self.start_s / bin_width_s), math.ceil(self.end_s / bin_width_s)
        phases = (np.arange(PHASES) + 0.5) / PHASES
        edges = np.arange(-before - 2, max(after, 1) + 3) - phases[:, None]
        counts = ARRIVALS * np.diff(self.arrived(edges * bin_width_s), axis=-1)
        pulses = find_pulses(counts, CYCLES, None)
        delay = np.mean(pulses.delay + edges[:, 0])
        return float(delay) * bin_width_s, float(pulses.width.mean()) * bin_width_s

    @field_validator("samples_ns")
    @classmethod
    def _rising(cls, rows: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        times = [row[0] for row in rows]
        if times != sorted(set(times)):
            raise InputError("rows [time_ns, rate] need rising times")
        if not any(row[1] for row in rows):
            raise InputError("needs a rate above 0")
        return rows

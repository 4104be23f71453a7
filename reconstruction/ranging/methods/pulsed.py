"""Pulsed indirect time of flight: light in adjacent windows -> delay -> path length.

A rectangular pulse as long as the windows that arrives within the first one leaves a fraction r of
its light in the second: r = (S2 - S0) / (S1 + S2 - 2 S0), with S0 the background window (S.
Kawahito et al., "A CMOS time-of-flight range image sensor with gates-on-field-oxide structure",
IEEE Sensors J. 7, 1578 (2007)). Rounded pulse edges bend this near r = 0 and 1. With more than two
windows for the echo, the two neighbours with most light are used.
"""

import numpy as np

from ...base.arrays import Floats
from ...base.constants import c
from ...capture import Optics, Spots
from ...capture.readings.pulsed import PulsedSpots
from ..brightness import Brightness
from ..method import RangingSolver
from ..ranges import MIN_SIGNAL, Paths, Ranges, ranges_from_paths


class Pulsed:
    """Fraction of a pulse in the second of two windows.

    A pulse below MIN_SIGNAL standard deviations is no signal. It is ambiguous if one of the two
    windows has no significant light, as it may then lie partly outside both.
    """

    title = "share of windows"
    reads = PulsedSpots

    def compile(self, spots: Spots, optics: Optics | None = None) -> RangingSolver:
        """Solver for a recording's windows; raises InputError if their noise is unknown."""
        assert isinstance(spots, PulsedSpots)
        spots.check_noise(len(spots.directions))
        return _solve

    def unambiguous_range_m(self, spots: Spots) -> float:
        """Range beyond which a spot appears nearer than it is."""
        return np.inf


def _solve(spots: Spots, brightness: Brightness | None = None) -> Ranges:
    assert isinstance(spots, PulsedSpots)
    every = spots.electrons(spots.taps[0])
    first = np.argmax(every[:, 1:-1] + every[:, 2:], axis=1) + 1
    taken = np.stack([np.zeros_like(first), first, first + 1], axis=1)
    electrons = np.take_along_axis(every, taken, axis=1)
    variance = np.take_along_axis(spots.variance(every), taken, axis=1)
    fraction, signal, sigma = second_window_fraction(electrons, variance)
    delay = spots.window_starts_s[first] + fraction * spots.pulse_width_s - spots.delay_offset_s
    echoes = electrons[:, 1:] - electrons[:, :1]
    in_each = echoes > MIN_SIGNAL * np.sqrt(variance[:, 1:] + variance[:, :1])
    noise = np.sqrt(variance @ [4, 1, 1])
    paths = Paths(
        path_m=c * delay,
        sigma_m=c * spots.pulse_width_s * sigma,
        signal_electrons=signal,
        background_electrons=electrons[:, 0],
        saturated=spots.saturated[0].any(axis=1),
        no_signal=signal <= MIN_SIGNAL * noise,
        ambiguous=~np.all(in_each, axis=1),
    )
    return ranges_from_paths(paths, spots)


def second_window_fraction(windows: Floats, variance: Floats) -> tuple[Floats, Floats, Floats]:
    """Fraction r of the pulse in the second window, total signal s, and sigma of r, each (...,).

    From background, first and second window (..., 3) and their variances. To first order var(r) =
    [r^2 v1 + (1 - r)^2 v2 + (1 - 2 r)^2 v0] / s^2, which for shot noise of the signal and another
    variance v in each window is r (1 - r) / s + v [r^2 + (1 - r)^2 + (1 - 2 r)^2] / s^2. The
    second-order bias -3 v (1 - 2 r) / s^2 is not corrected. Without signal, r is 0 and its sigma
    infinite.
    """
    background, first, second = np.moveaxis(windows, -1, 0)
    signal = first + second - 2 * background
    seen = signal > 0
    safe = np.where(seen, signal, 1.0)
    fraction = np.where(seen, (second - background) / safe, 0.0)
    slopes = np.stack([1 - 2 * fraction, fraction, 1 - fraction], axis=-1)
    sigma = np.sqrt((slopes**2 * variance).sum(axis=-1)) / safe
    return fraction, signal, np.where(seen, sigma, np.inf)


METHOD = Pulsed()

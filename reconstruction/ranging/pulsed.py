"""Pulsed indirect time of flight: light in two adjacent windows -> delay -> path length.

A rectangular pulse as long as the windows that arrives within the first one leaves the share r of
its light in the second: r = (S2 - S0) / (S1 + S2 - 2 S0), with S0 the window that sees background
only (S. Kawahito et al., "A CMOS time-of-flight range image sensor with gates-on-field-oxide
structure", IEEE Sensors J. 7, 1578 (2007)). Rounded edges of the pulse bend this near r = 0 and 1.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.constants import c

from ..spots import PulsedSpots
from .ranges import LEAST_SIGNAL, Paths

Floats = NDArray[np.float64]


def pulsed_paths(spots: PulsedSpots, frame: int) -> Paths:
    """Paths of one frame.

    No signal is a pulse below LEAST_SIGNAL standard deviations. It is ambiguous where one of the
    two windows has none of it so far as noise can tell: the pulse may then as well lie partly
    outside of both.
    """
    electrons = spots.electrons(spots.taps[frame])
    variance = spots.variance(electrons)
    share, signal, deviation = share_in_second(electrons, variance)
    delay = spots.window_starts_s[1] + share * spots.pulse_width_s - spots.delay_offset_s
    echoes = electrons[:, 1:] - electrons[:, :1]
    in_each = echoes > LEAST_SIGNAL * np.sqrt(variance[:, 1:] + variance[:, :1])
    noise = np.sqrt(variance @ [4, 1, 1])
    return Paths(
        path_m=c * delay,
        sigma_m=c * spots.pulse_width_s * deviation,
        signal_electrons=signal,
        background_electrons=electrons[:, 0],
        saturated=spots.saturated[frame].any(axis=1),
        no_signal=signal <= LEAST_SIGNAL * noise,
        ambiguous=~np.all(in_each, axis=1),
    )


def share_in_second(windows: Floats, variance: Floats) -> tuple[Floats, Floats, Floats]:
    """Share r of the pulse in the second window, its whole signal s, and the deviation of r.

    Each (...,), from background, first and second window (..., 3) and their variances, carried to
    first order: var(r) = [r^2 v1 + (1 - r)^2 v2 + (1 - 2 r)^2 v0] / s^2, which for shot noise of
    the signal and a variance v of all else in each window is r (1 - r) / s + v [r^2 + (1 - r)^2 +
    (1 - 2 r)^2] / s^2. Where there is no signal, r is 0 and its deviation infinite.
    """
    background, first, second = np.moveaxis(windows, -1, 0)
    signal = first + second - 2 * background
    seen = signal > 0
    safe = np.where(seen, signal, 1.0)
    share = np.where(seen, (second - background) / safe, 0.0)
    slopes = np.stack([1 - 2 * share, share, 1 - share], axis=-1)
    deviation = np.sqrt((slopes**2 * variance).sum(axis=-1)) / safe
    return share, signal, np.where(seen, deviation, np.inf)

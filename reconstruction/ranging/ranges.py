"""What every method of ranging gives, and when a spot counts as seen."""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats, Mask
from ..capture import Spots

Status = Literal[
    "ok", "saturated", "no signal", "too close", "ambiguous", "fog", "weak", "weather prior"
]
RANGED: tuple[Status, ...] = ("ok", "weather prior")
"""With a range: the readings alone give it, or these and a prior over the weather."""

MIN_SIGNAL = 3.0
"""A spot counts as seen when its signal exceeds its own standard deviation this many times."""
MAX_FOG_RANGE_M = 150.0
"""Farther targets are not looked for in fog: where it matters, a drone's laser shows none there."""


@dataclass(frozen=True, eq=False)
class Paths:
    """What a method finds of the four spots, each (4,): path lengths, or why there is none.

    ``sigma_m`` is the standard deviation of ``path_m``; the last three are true or false.
    """

    path_m: Floats
    sigma_m: Floats
    signal_electrons: Floats
    background_electrons: Floats
    saturated: Mask
    no_signal: Mask
    ambiguous: Mask


class Alternative(NamedTuple):
    """One of the ranges that a spot may have, with its standard deviation.

    ``weight`` is its probability, or of several echoes that are there at once, its share of them.
    """

    range_m: float
    sigma_m: float
    weight: float


class FogOptics(NamedTuple):
    """What ranging found of the fog: the mean of its extinction, and its backscattering.

    ``log_sigma`` is the standard deviation of the latter's logarithm.
    """

    extinction_per_m: float
    backscatter_per_m_sr: float
    log_sigma: float


@dataclass(frozen=True, eq=False)
class Ranges:
    """Ranges of the four spots of one frame, each (4,).

    ``range_m`` from the projector's pinhole along the spot's direction, ``sigma_m`` its standard
    deviation. Of methods that know of no fog it is that of shot and electronics noise, without the
    bias of light that came another way, such as the echo of fog. ``status`` is "ok", or "weather
    prior" where sigma holds what the readings leave open of the fog (see `reconstruction.ranging.
    fog.underdetermined`). Elsewhere both are nan: "saturated", "no signal", "too close" (the path
    is no longer than the way from laser to detector), "ambiguous" (frequencies that contradict each
    other, a pulse outside of windows or bins, several ranges nearly as likely), "weak" (a target
    that may as well be noise or fog) or "fog" (one that fog leaves too uncertain).

    ``signal_electrons`` and ``background_electrons`` are A and B of a tap of the first frequency
    (cw), the whole pulse and the background of one window (pulsed), or arrivals of the pulse and
    background arrivals per bin (dtof).

    ``alternatives`` are all ranges that a spot may have, likeliest first, also where ``status`` is
    not "ok"; none of methods that know of one only. ``fog`` is None where a method does not tell.
    """

    range_m: Floats
    sigma_m: Floats
    signal_electrons: Floats
    background_electrons: Floats
    status: tuple[Status, ...]
    alternatives: tuple[tuple[Alternative, ...], ...] = ((), (), (), ())
    fog: FogOptics | None = None

    @property
    def likeliest(self) -> tuple[Floats, Floats]:
        """Ranges and their standard deviations, each (4,), also of spots that are not valid.

        Of several alternatives their mean, with their spread in its deviation; nan where nothing is
        known.
        """
        mean, sigma = self.range_m.copy(), self.sigma_m.copy()
        for spot, given in enumerate(self.alternatives):
            if given and not np.isfinite(mean[spot]):
                ranges_m, sigmas_m, weights = np.array(given).T
                weights = weights / weights.sum()
                mean[spot] = weights @ ranges_m
                sigma[spot] = np.sqrt(weights @ (sigmas_m**2 + (ranges_m - mean[spot]) ** 2))
        return mean, sigma

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Where there is a range (4,)."""
        return np.isin(self.status, RANGED)


def range_from_path(
    path_m: Floats, directions: Floats, detector_positions_m: Floats
) -> tuple[Floats, Floats]:
    """Range r (...,) along unit directions d (..., 3) from the path r + |r d - b|; its derivative.

    r = (L^2 - |b|^2) / 2 (L - d.b), dr/dL = (L - r) / (L - d.b), b (..., 3) the detector's
    position. Only L > |b| is the length of a path.
    """
    squared = (detector_positions_m**2).sum(axis=-1)
    along = (directions * detector_positions_m).sum(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        range_m = (path_m**2 - squared) / (2 * (path_m - along))
        return range_m, (path_m - range_m) / (path_m - along)


def ranges_from_paths(paths: Paths, spots: Spots) -> Ranges:
    """Ranges along the spots' directions; where there is none, the status is the first reason."""
    range_m, slope = range_from_path(paths.path_m, spots.directions, spots.detector_positions_m)
    reasons = {
        "saturated": paths.saturated,
        "no signal": paths.no_signal,
        "ambiguous": paths.ambiguous,
        "too close": paths.path_m <= np.linalg.norm(spots.detector_positions_m, axis=1),
    }
    status = np.array(
        [
            next((reason for reason, there in reasons.items() if there[spot]), "ok")
            for spot in range(len(range_m))
        ]
    )
    return Ranges(
        range_m=np.where(status == "ok", range_m, np.nan),
        sigma_m=np.where(status == "ok", slope * paths.sigma_m, np.nan),
        signal_electrons=paths.signal_electrons,
        background_electrons=paths.background_electrons,
        status=tuple(status.tolist()),
    )

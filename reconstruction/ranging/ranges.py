"""Ranges as every ranging method gives them, and when a spot counts as detected."""

from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats, Mask
from ..capture import Spots
from .visibility import Visibility

Status = Literal[
    "ok",
    "saturated",
    "no signal",
    "too close",
    "ambiguous",
    "fog",
    "weak",
    "weather prior",
    "uneven fog",
]
RANGED: tuple[Status, ...] = ("ok", "weather prior")
"""Statuses with a range: from the readings alone, or with a prior of the weather."""

MIN_SIGNAL = 3.0
"""Minimum signal of a detected spot, in standard deviations."""
MIN_BEYOND = 2 / 3
"""Minimum probability that a target lies beyond the unambiguous range for it to be taken there."""
MAX_FOG_RANGE_M = 150.0
"""Maximum range of targets in fog: where fog matters, a drone's laser shows none beyond."""


@dataclass(frozen=True, eq=False)
class Paths:
    """Path lengths of the spots, each (spots,), or the reasons for none.

    ``sigma_m`` is the standard deviation of ``path_m``.
    """

    path_m: Floats
    sigma_m: Floats
    signal_electrons: Floats
    background_electrons: Floats
    saturated: Mask
    no_signal: Mask
    ambiguous: Mask


class Alternative(NamedTuple):
    """A possible range of a spot and its standard deviation.

    ``weight`` is its probability, or for simultaneous echoes its fraction of their light.
    """

    range_m: float
    sigma_m: float
    weight: float


class FogOptics(NamedTuple):
    """Estimated fog: mean extinction, and backscattering with the sigma of its logarithm."""

    extinction_per_m: float
    backscatter_per_m_sr: float
    log_sigma: float


@dataclass(frozen=True, eq=False)
class Ranges:
    """Ranges of the spots of a frame, each (spots,).

    ``range_m`` is measured from the projector's pinhole along the spot's direction, ``sigma_m`` its
    standard deviation. Methods without a fog model include shot and electronics noise in it, but
    not the bias of other light such as the fog's echo. ``status`` is "ok", or "weather prior" if
    sigma includes what the readings leave open about the fog (see
    `reconstruction.ranging.fog.underdetermined`). Otherwise both are nan: "saturated", "no signal",
    "too close" (the path is not longer than from laser to detector), "ambiguous" (contradictory
    frequencies, a pulse outside windows or bins, several likely ranges), "weak" (a target that may
    be noise or fog), "fog" (too uncertain in fog) or "uneven fog" (the same, as the spots' fogs
    differ).

    ``signal_electrons`` and ``background_electrons`` are A and B of a tap of the first frequency
    (cw), the whole pulse and the background of a window (pulsed), or pulse arrivals and background
    arrivals per bin (dtof).

    ``alternatives`` are all possible ranges of a spot, likeliest first, whatever its ``status``;
    empty for methods that only find one. The weights of a spot sum to 1: they are probabilities if
    there is a target at all within reach. ``nothing`` is the probability that there is none, nan if
    the method does not state it. Alternatives beyond ``unambiguous_range_m`` have the phases of
    nearer ones. ``fog`` is None if a method does not estimate it,
    ``visibility`` if the readings and their scale do not show it.
    """

    range_m: Floats
    sigma_m: Floats
    signal_electrons: Floats
    background_electrons: Floats
    status: tuple[Status, ...]
    alternatives: tuple[tuple[Alternative, ...], ...] = ()
    nothing: Floats = field(default_factory=lambda: np.empty(0))
    unambiguous_range_m: float = np.inf
    fog: FogOptics | None = None
    visibility: Visibility | None = None

    def __post_init__(self) -> None:
        if not self.alternatives:
            object.__setattr__(self, "alternatives", ((),) * len(self.status))
        if not self.nothing.size:
            object.__setattr__(self, "nothing", np.full(len(self.status), np.nan))

    @property
    def likeliest(self) -> tuple[Floats, Floats]:
        """Ranges and sigmas, each (spots,), also of spots that are not valid.

        Several alternatives are averaged, and sigma includes their spread; nan if there is none.
        Those beyond the unambiguous range count alone if they have `MIN_BEYOND` of the probability,
        else not at all.
        """
        mean, sigma = self.range_m.copy(), self.sigma_m.copy()
        for spot, given in enumerate(self.alternatives):
            if given and not np.isfinite(mean[spot]):
                ranges_m, sigmas_m, weights = np.array(given).T
                beyond = ranges_m > self.unambiguous_range_m
                far = weights[beyond].sum() >= MIN_BEYOND * weights.sum()
                weights = np.where(beyond == far, weights, 0)
                weights = weights / weights.sum()
                mean[spot] = weights @ ranges_m
                sigma[spot] = np.sqrt(weights @ (sigmas_m**2 + (ranges_m - mean[spot]) ** 2))
        return mean, sigma

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Mask (spots,) of spots with a range."""
        return np.isin(self.status, RANGED)


def range_from_path(
    path_m: Floats, directions: Floats, detector_positions_m: Floats
) -> tuple[Floats, Floats]:
    """Range along a ray from the length of the path, and its derivative.

    Solves r + |r d - b| = L: r = (L^2 - |b|^2) / 2 (L - d.b), dr/dL = (L - r) / (L - d.b), for L >
    |b|.

    Parameters
    ----------
    path_m : array, (...,)
        Path lengths L.
    directions : array, (..., 3)
        Unit vectors d.
    detector_positions_m : array, (..., 3)
        Positions b.
    """
    squared = (detector_positions_m**2).sum(axis=-1)
    along = (directions * detector_positions_m).sum(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        range_m = (path_m**2 - squared) / (2 * (path_m - along))
        return range_m, (path_m - range_m) / (path_m - along)


def redirected(ranges: Ranges, home: Spots, spots: Spots) -> Ranges:
    """Ranges along the directions of ``spots``, from those of equal paths along ``home``.

    Detectors beside the projector's pinhole make the path depend on the direction, by b (d - d0);
    sigmas, whose relative change is as small as that of the range, stay.
    """

    possible = [(spot, each) for spot, some in enumerate(ranges.alternatives) for each in some]
    spot = np.array([*range(len(ranges.status)), *(spot for spot, _ in possible)])
    range_m = np.array([*ranges.range_m, *(each.range_m for _, each in possible)])
    detectors = home.detector_positions_m[spot]
    ends = range_m[:, None] * home.directions[spot]
    path_m = range_m + np.linalg.norm(ends - detectors, axis=-1)
    moved = iter(range_from_path(path_m, spots.directions[spot], detectors)[0].tolist())
    return replace(
        ranges,
        range_m=np.array([next(moved) for _ in ranges.status]),
        alternatives=tuple(
            tuple(each._replace(range_m=next(moved)) for each in some)
            for some in ranges.alternatives
        ),
    )


def ranges_from_paths(paths: Paths, spots: Spots) -> Ranges:
    """Ranges along the spots' directions; the status of the others is the first reason."""
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

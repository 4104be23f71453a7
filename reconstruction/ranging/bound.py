"""Cramér–Rao bound of ranges in fog, for targets and fog together.

The mean of a reading is rho A(z) + beta G(z) + steady light, with A and G the readings of unit
reflectance at z and of unit backscattering in front of it (see `reconstruction.ranging.fog`).
Unknown are range, reflectance and steady light of every spot, and the shared extinction and
backscattering, whose prior adds to the information (H. L. Van Trees, "Detection, Estimation, and
Modulation Theory", part I, Wiley 1968, section 2.4). The variance of the readings is taken as
known, as it says little about the light. The fog is homogeneous and scatters once; no unbiased
method does better.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import ndtr

from ..base.arrays import Floats
from ..base.errors import InputError
from ..capture import Spots
from ..capture.readings.cw import CwSpots
from ..capture.readings.dtof import HistogramSpots
from ..capture.readings.pulsed import PulsedSpots
from ..capture.spots import SpotOptics
from .fog.modes import LOG_SIGMA
from .fog.numerics import inverse
from .fog.overlap import overlap, require_optics
from .fog.templates import EXTINCTIONS_PER_M
from .histogram import coates

MIN_RANGE_M, STEP_M = 0.01, 0.01
"""Start of the fog integral, and its step beyond 1 m; below 1 m steps are proportional."""
NEAR, OVERLAPS = 400, 300
"""Steps below 1 m, and number of ranges at which the smooth overlap is computed."""
DIFFERENCE_M = 2e-4
"""Half the range difference from which slopes are computed."""
PRIOR = float(np.log(EXTINCTIONS_PER_M).std()), LOG_SIGMA
"""Prior standard deviations of ln extinction and of ln (backscattering / extinction)."""

Bound = Callable[["Targets", Floats], Floats]
"""Maps targets and mean readings (spots, n) of a frame to standard deviations (spots,) in m."""


class Sigmas(NamedTuple):
    """Standard deviations: of ranges (spots,), ln reflectances (spots,), and ln extinction."""

    range_m: Floats
    log_reflectance: Floats
    log_extinction: float


@dataclass(frozen=True, eq=False)
class Targets:
    """Targets of the lasers, with ranges and reflectances (spots,), and the fog's coefficients.

    ``reflectance`` includes the cosine of the angle of incidence. ``backscatter`` is the scattering
    coefficient times the phase function at 180 degrees, 1 / (m sr).
    """

    range_m: Floats
    reflectance: Floats
    extinction_per_m: float = 0.0
    backscatter: float = 0.0


def make_bound(spots: Spots, max_range_m: float, prior: tuple[float, float] = PRIOR) -> Bound:
    """Bound of the range errors of a recording; as `make_bounds`."""
    bounds = make_bounds(spots, max_range_m, prior)
    return lambda targets, readings: bounds(targets, readings).range_m


def make_bounds(
    spots: Spots, max_range_m: float, prior: tuple[float, float] = PRIOR, frames: int = 1
) -> Callable[[Targets, Floats], Sigmas]:
    """Bounds of the errors of all that a recording's light depends on.

    Raises InputError if the recording lacks what `fog.overlap` needs, or the laser light in each
    reading.

    Parameters
    ----------
    spots : Spots
        Optics and settings; readings are ignored.
    max_range_m : float
        Maximum range of targets.
    prior : tuple of float
        Standard deviations as in `PRIOR`; infinite for no prior.
    frames : int
        How many equal frames are taken together.
    """
    require_optics(spots)
    lights = _lights(spots, max_range_m)
    if any(np.isnan(light.table[:, -1]).any() for light in lights):
        raise InputError(
            "the laser's light in each reading is unknown (nan), but the bound needs it"
        )
    steady, precision = _steady(spots), _precision(spots)
    size = 2 + steady.shape[1]
    fog = size * len(lights)  # index of its coefficients, after those of the spots

    def bounds(targets: Targets, readings: Floats) -> Sigmas:
        information = np.zeros((fog + 2, fog + 2))
        information[-2:, -2:] = _prior_information(*prior)
        weights = frames * precision(readings)
        for spot, light in enumerate(lights):
            of_spot, of_fog = _slopes(light, targets, spot)
            jacobian = np.concatenate([of_spot, steady, of_fog], axis=1)
            at = [*range(spot * size, (spot + 1) * size), fog, fog + 1]
            information[np.ix_(at, at)] += (jacobian.T * weights[spot]) @ jacobian
        sigmas = _sigmas(information)
        return Sigmas(sigmas[:fog:size], sigmas[1:fog:size], float(sigmas[fog]))

    return bounds


@dataclass(frozen=True, eq=False)
class _Light:
    """Readings (n,) of one laser's light by the range of the scatterer."""

    range_m: Floats  # (R,)
    path_m: Floats  # (R,)
    weight: Floats  # (R,): the overlap times range squared, which hardly changes
    table: Floats  # (n, R): `kernel` of these paths
    kernel: Callable[[Floats], Floats]  # (n, ...) for a detector that gets all, by path (...)

    def collected(self, range_m: Floats, extinction_per_m: float) -> tuple[Floats, Floats]:
        """Fraction collected of a diffuser of unit radiance, and path to it, (...)."""
        path_m = np.interp(range_m, self.range_m, self.path_m)
        weight = np.interp(range_m, self.range_m, self.weight) / range_m**2
        return weight * np.exp(-extinction_per_m * path_m), path_m


def smooth_overlap(optics: SpotOptics, range_m: Floats) -> tuple[Floats, Floats]:
    """As `fog.overlap` for many ranges (R,), faster: weights in sr, paths in m, (spots, R)."""
    coarse_m = np.geomspace(range_m.min() / 2, 2 * range_m.max(), OVERLAPS)
    slowly = overlap(optics, coarse_m)[0] * coarse_m**2
    weights = [np.interp(range_m, coarse_m, each) / range_m**2 for each in slowly]
    points = range_m[:, None] * optics.directions[:, None]
    back_m = np.linalg.norm(points - optics.detector_positions_m[:, None], axis=-1)
    return np.array(weights), range_m + back_m


def _lights(spots: Spots, max_range_m: float) -> list[_Light]:
    near = np.geomspace(MIN_RANGE_M, 1.0, NEAR)
    range_m = np.concatenate([near, np.arange(1 + STEP_M, max_range_m + 2 * STEP_M, STEP_M)])
    kernel = _kernel(spots)
    return [
        _Light(range_m, path_m, weight * range_m**2, kernel(path_m), kernel)
        for weight, path_m in zip(*smooth_overlap(spots, range_m), strict=True)
    ]


def _slopes(light: _Light, targets: Targets, spot: int) -> tuple[Floats, Floats]:
    """Slopes (n, 2) of readings along range and ln reflectance, and along ln of fog
    coefficients."""
    z, radiance = float(targets.range_m[spot]), float(targets.reflectance[spot]) / np.pi
    extinction, beta = targets.extinction_per_m, targets.backscatter
    fraction, path_m = light.collected(z + DIFFERENCE_M * np.array([-1.0, 0.0, 1.0]), extinction)
    before, here, after = (fraction * light.kernel(path_m)).T
    along = radiance * (after - before) / (2 * DIFFERENCE_M) + beta * here

    inner = int(np.searchsorted(light.range_m, z))
    range_m = np.append(light.range_m[:inner], z)
    fractions, paths_m = light.collected(range_m, extinction)
    steps = np.diff(range_m, prepend=range_m[0], append=range_m[-1])
    fog = beta * fractions * (steps[:-1] + steps[1:]) / 2  # trapezoids
    table = np.concatenate([light.table[:, :inner], light.kernel(path_m[1:2])], axis=1)
    echo, delayed = (table @ np.stack([fog, fog * paths_m], axis=1)).T
    taken = radiance * here * path_m[1] + delayed
    return np.stack([along, radiance * here], axis=1), np.stack([-extinction * taken, echo], axis=1)


def _sigmas(information: Floats) -> Floats:
    """Standard deviations of all parameters; infinite without information."""
    informed = np.flatnonzero(np.diagonal(information) > 0)
    sigmas = np.full(len(information), np.inf)
    sigmas[informed] = np.sqrt(np.diagonal(inverse(information[None, informed][:, :, informed])[0]))
    return sigmas


def _prior_information(log_extinction: float, log_ratio: float) -> Floats:
    """Information (2, 2) about ln extinction and ln backscattering."""
    together = np.array([[1.0, -1.0], [-1.0, 1.0]])
    return np.diag([log_extinction**-2, 0.0]) + together * log_ratio**-2


def _kernel(spots: Spots) -> Callable[[Floats], Floats]:
    scale = spots.electrons_per_joule
    if isinstance(spots, HistogramSpots):
        arrivals = scale * spots.laser_energy_j / spots.pulses
        width = spots.response_sigma_s / spots.bin_width_s
        edges = np.arange(spots.counts.shape[-1] + 1.0)
        return lambda path_m: (
            arrivals
            * np.diff(
                ndtr((edges.reshape(-1, *[1] * np.ndim(path_m)) - spots.delay(path_m)) / width),
                axis=0,
            )
        )
    assert isinstance(spots, CwSpots | PulsedSpots)
    return lambda path_m: scale * spots.response(path_m)


def _steady(spots: Spots) -> Floats:
    """Readings (n, m) of steady light, up to scale."""
    if isinstance(spots, HistogramSpots):
        return np.ones((spots.counts.shape[-1], 1))
    assert isinstance(spots, CwSpots | PulsedSpots)
    return spots.steady


def _precision(spots: Spots) -> Callable[[Floats], Floats]:
    """Information in each of the readings (spots, n) about its mean."""
    if isinstance(spots, HistogramSpots):
        cycles = spots.pulses

        def of_counts(counts: Floats) -> Floats:
            rate, watched = coates(counts, cycles)
            return np.asarray(watched / np.expm1(np.maximum(rate, 1e-12)))

        return of_counts
    assert isinstance(spots, CwSpots | PulsedSpots)
    return lambda counts: 1 / spots.variance(spots.electrons(counts))

"""Ranging in fog, in closed form: the echo of fog, the bias of plain ranges, and the bound.

Light scattered once by uniform fog, as in `reconstruction.ranging.fog`, is recorded without noise
by the instrument's own method. The resulting ranges have the bias of the echo, whether in a phase,
in windows or in a histogram. The Cramér-Rao bound of wall and fog together, with the noise of
readings that include the echo, limits a joint fit. Valid as the link is, and without multiple
scattering, which matters in dense fog and wide fields.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from reconstruction.capture import Spots
from reconstruction.capture.readings.dtof import HistogramSpots
from reconstruction.capture.schema import between
from reconstruction.ranging import measure_ranges, reads
from reconstruction.ranging.bound import Sigmas, Targets, make_bounds, smooth_overlap
from spisim.atmosphere import Atmosphere
from spisim.budget.link import Target, spot_link
from spisim.budget.ranging import last_below
from spisim.instrument import Instrument, SpotLight
from spisim.instrument.tof import path_step_m

#: Widest steps of the path-length bins, and steps of the fog along the beam.
PATH_STEP_M, FOG_STEP_M = 0.01, 0.0025
#: Distances searched for the longest range.
MIN_DISTANCE_M, MAX_DISTANCE_M, DISTANCES = 0.3, 40.0, 60


@dataclass(frozen=True)
class FogBudget:
    """Ranging of a wall in fog; None where a method gives nothing.

    `echo_fraction` is the fog's fraction of a laser's light on its detector, `plain_bias_m` the
    error of the instrument's own method without noise, both averaged over the spots; `sigma_m` and
    `longest_m` are those of the bound for the worst spot, as is `reflectance_sigma`, relative.
    `extinction_sigma`, of the logarithm, is that of the visibility, too; ranging's prior is in it.
    """

    echo_fraction: float
    plain_bias_m: float | None
    sigma_m: float | None
    longest_m: float | None
    reflectance_sigma: float | None
    extinction_sigma: float | None


def fog_budget(
    instrument: Instrument, target: Target, air: Atmosphere, limit_m: float
) -> FogBudget:
    """Echo, bias and bound for one target, and the range up to which the bound holds a limit.

    Parameters
    ----------
    instrument : Instrument
        What is budgeted.
    target : Target
        Plain numbers.
    air : Atmosphere
        The fog.
    limit_m : float
        Maximum standard deviation of a range, for `longest_m`.
    """
    here = np.array([float(target.distance_m)])
    light, fraction = _light(instrument, target, air, here)
    spots = instrument.ranging.tof.record(light, instrument.spot_optics, None)
    error_m = measure_ranges(spots).range_m - here / instrument.ranging.lasers.directions[:, 2]
    farthest_m = min(instrument.ranging.tof.unambiguous_range_m, MAX_DISTANCE_M)
    distances_m = np.geomspace(MIN_DISTANCE_M, farthest_m, DISTANCES)
    bounds = _bounds(instrument, target, air, np.append(distances_m, here))
    sigma_m = None if bounds is None else np.array([each.range_m.max() for each in bounds])
    finite = sigma_m is not None and np.isfinite(sigma_m[-1])
    at_target = bounds[-1] if bounds is not None and finite else None
    return FogBudget(
        echo_fraction=fraction,
        plain_bias_m=float(np.nanmean(error_m)) if np.isfinite(error_m).any() else None,
        sigma_m=float(sigma_m[-1]) if sigma_m is not None and finite else None,
        longest_m=(
            None if sigma_m is None else float(last_below(distances_m, sigma_m[:-1], limit_m))
        ),
        reflectance_sigma=(None if at_target is None else float(at_target.log_reflectance.max())),
        extinction_sigma=None if at_target is None else at_target.log_extinction,
    )


def _light(
    instrument: Instrument, target: Target, air: Atmosphere, distance_m: Floats
) -> tuple[SpotLight, float]:
    """Light of walls at distances (D,), one per frame, and the mean fraction of the fog in it."""
    link = spot_link(instrument, replace(target, distance_m=distance_m))
    longest_m = float(distance_m.max()) / instrument.ranging.lasers.directions[:, 2].min()
    range_m = np.arange(FOG_STEP_M / 2, longest_m, FOG_STEP_M)
    weight, path_m = smooth_overlap(instrument.spot_optics, range_m)
    per_watt = instrument.electrons_per_joule(instrument.ranging.tof.detector, "laser")
    scattered = instrument.ranging.lasers.power_w * per_watt * _backscatter(air) * FOG_STEP_M
    fog = scattered * weight * np.exp(-air.extinction_per_m * path_m)
    ranges_m = distance_m[:, None] / instrument.ranging.lasers.directions[:, 2]
    step_m = min(PATH_STEP_M, path_step_m(instrument.ranging.tof))
    bins = int(np.ceil(link.path_m.max() / step_m)) + 2
    echo, fraction = np.zeros((len(distance_m), instrument.ranging.spots, bins)), []
    for frame, spot in np.ndindex(len(distance_m), instrument.ranging.spots):
        before = range_m < ranges_m[frame, spot]
        echo[frame, spot] = _sorted(path_m[spot, before] / step_m, fog[spot, before], bins)
        wall = link.echo_per_s[frame, spot]
        fraction.append(echo[frame, spot].sum() / max(echo[frame, spot].sum() + wall, 1e-300))
        echo[frame, spot] += _sorted(link.path_m[frame, spot, None] / step_m, wall[None], bins)
    lengths: Floats = step_m * np.arange(bins, dtype=np.float64)
    light = SpotLight(lengths, echo, link.steady_per_s, instrument.ranging.lasers.power_w)
    return light, float(np.mean(fraction))


def _sorted(position: Floats, rate: Floats, bins: int) -> Floats:
    """Rates (bins,) of light of paths in bins, each split linearly between two."""
    low = position.astype(int)
    above = rate * (position - low)
    result = np.bincount(low, rate - above, bins) + np.bincount(low + 1, above, bins)
    return np.asarray(result)


def _bounds(
    instrument: Instrument, target: Target, air: Atmosphere, distance_m: Floats
) -> list[Sigmas] | None:
    """Bounds at distances (D,); None for readings that the fit in fog does not support."""
    light, _ = _light(instrument, target, air, distance_m)
    optics, tof = instrument.spot_optics, instrument.ranging.tof
    readings = _as_recorded(instrument, light)
    if not reads("fog", readings) or (
        isinstance(readings, HistogramSpots) and not readings.piles_up
    ):
        return None
    mean: NDArray[Any] = tof.record(light, optics, None).readings
    cosine = instrument.ranging.lasers.directions[:, 2]
    bounds = make_bounds(readings, float(distance_m.max() / cosine.min()))
    reflectance = float(target.reflectance) * cosine
    coefficients = air.extinction_per_m, _backscatter(air)
    return [
        bounds(Targets(each / cosine, reflectance, *coefficients), expected)
        for each, expected in zip(distance_m, mean, strict=True)
    ]


def _as_recorded(instrument: Instrument, light: SpotLight) -> Spots:
    """Readings of no frame, with the response and noise of a capture."""
    one = replace(light, echo_per_s=light.echo_per_s[:1], steady_per_s=light.steady_per_s[:1])
    spots = instrument.ranging.tof.record(one, instrument.spot_optics, np.random.default_rng(0))
    return between(spots, 0, 0)


def _backscatter(air: Atmosphere) -> float:
    return air.scattering_per_m * air.backscatter_per_sr

"""Precision of ranges in closed form, by the instrument's own method.

Covers the noise of readings only, not the bias of indirect light or of waveforms that violate the
method's assumptions.
"""

import numpy as np

from reconstruction.base.arrays import Floats, usual_float_errors
from spisim.budget.link import Target, spot_link
from spisim.instrument import Instrument

MIN_DISTANCE_M, MAX_DISTANCE_M, STEPS = 0.05, 100.0, 400


@usual_float_errors
def range_sigma_m(instrument: Instrument, target: Target) -> Floats:
    """Standard deviation of the ranges of the spots along their rays.

    Returns
    -------
    (..., spots) array
        Metres; infinite without an echo or beyond the unambiguous range.
    """
    link = spot_link(instrument, target)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        of_paths = instrument.ranging.tof.path_sigma_m(
            link.path_m, link.echo_per_s, link.steady_per_s
        )
        sigma = of_paths * link.range_per_path
    beyond = link.path_m > 2 * instrument.ranging.tof.unambiguous_range_m
    return np.where(np.isnan(sigma) | beyond, np.inf, sigma)


def longest_range_m(
    instrument: Instrument,
    limit_m: float,
    *,
    reflectance: float | Floats = 0.5,
    illuminance_klx: float | Floats = 0.0,
    extinction_per_m: float = 0.0,
) -> Floats:
    """Maximum distance of a target at which all ranges meet a limit.

    Parameters
    ----------
    instrument : Instrument
    limit_m : float
        Maximum standard deviation of a range.
    reflectance, illuminance_klx : float or (...) array
    extinction_per_m : float

    Returns
    -------
    (...) array
        Metres, up to 100, interpolated between 400 distances; 0 if there is none.
    """
    distance = np.geomspace(MIN_DISTANCE_M, MAX_DISTANCE_M, STEPS)
    conditions = np.broadcast_arrays(reflectance, illuminance_klx)
    brightness, daylight = (np.asarray(value, np.float64)[..., None] for value in conditions)
    target = Target(distance, brightness, daylight, extinction_per_m)
    sigma = range_sigma_m(instrument, target).max(axis=-1)  # (..., distances)
    return last_below(distance, sigma, limit_m)


def last_below(distance: Floats, sigma: Floats, limit: float) -> Floats:
    """Maximum distance (...) at which sigma (..., distances) is below a limit; 0 if nowhere."""
    holds = sigma <= limit
    last = sigma.shape[-1] - 1 - np.argmax(holds[..., ::-1], axis=-1)
    after = np.minimum(last + 1, sigma.shape[-1] - 1)
    here, there = (
        np.log(np.take_along_axis(sigma, at[..., None], axis=-1)[..., 0]) for at in (last, after)
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        fraction = np.clip(np.nan_to_num((np.log(limit) - here) / (there - here)), 0, 1)
    longest = distance[last] * (distance[after] / distance[last]) ** fraction
    return np.where(holds.any(axis=-1), longest, 0.0)

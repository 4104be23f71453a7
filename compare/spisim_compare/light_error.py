"""Error of a simulation's light, which its captures state: noise when they are compared."""

from dataclasses import replace

import numpy as np
import yaml
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from reconstruction.capture import Capture
from reconstruction.capture.readings.cw import CwSpots
from reconstruction.capture.readings.dtof import HistogramSpots
from reconstruction.capture.readings.pulsed import PulsedSpots
from spisim.instrument import SpotLight, embedded_instrument

from .gaussian import Covariance
from .midpoint import Midpoint
from .patterns import constant, light_error

FEW_PATHS = 2.0
"""Factor on the error of steady light, which is stated from few paths."""
UNSTATED = 0.004
"""Relative error of the image beyond those stated, common to its pixels: paths so rare and bright
that few launches meet them, as of retro-reflectors and gloss."""
UNSTATED_OF_SPOT = 0.007
"""The same of the echo of a spot."""
UNSTATED_TURN_DEG = 0.015
"""What such an error of single pixels looks like: a turn, in degrees."""

DECODED = 1.5
"""Variance of a coefficient over four times that of a reading, 2 y - all - dark: the light's error
is stated for coefficients, in which that of pixels near each other is not independent."""


def with_light_error(noise: Covariance, capture: Capture, midpoint: Midpoint) -> Covariance:
    """Noise of patterns and spots, with the error of a capture's light, if it is a simulation."""
    if capture.provenance.source != "simulation":
        return noise
    stated = StatedAccuracy(capture)
    patterns, spots = midpoint.patterns.size, midpoint.spots
    variance = noise.variance.copy()
    own, total = image_error_of(capture)
    number = 0 if capture is midpoint.real else 1
    mean = midpoint.means[number]
    least = DECODED * stated("noise_share") ** 2 * np.nan_to_num(mean.variance) * mean.frames
    variance[:patterns] += np.maximum(own, least)
    on = constant(capture.setup.plans)
    dark, dark_of_spots = _dark(capture)
    daylight = max(abs(midpoint.background) - dark, 0.0)
    steady = FEW_PATHS * stated("daylight_relative_error") * daylight * on
    image = [total, steady, UNSTATED * (midpoint.patterns - on * midpoint.background)]
    if midpoint.turned_per_deg is not None:
        image += [*(UNSTATED_TURN_DEG * midpoint.turned_per_deg).T]
    factors = np.zeros((variance.size, len(image)))
    factors[:patterns] = np.column_stack(image)
    added = [factors]
    if spots is not None:
        mean = spots.means[number]
        of_frame = mean.variance * mean.frames
        parts = _parts_of_spots(of_frame, spots.spot, stated.errors_of_spots)
        variance[patterns:] += stated("spot_noise_share") ** 2 * parts * of_frame
        relative = np.hypot(
            stated("spot_daylight_relative_error"), stated("spot_crosstalk_relative_error")
        )
        of_spots = spots.steady_of_spots
        seen = np.maximum(of_spots.sum(axis=0), np.finfo(np.float64).tiny)
        of_spots = of_spots * np.maximum(1 - dark_of_spots / seen, 0.0)
        shared = np.hstack([relative * of_spots, UNSTATED_OF_SPOT * spots.echo_of_spots])
        added.append(np.vstack([np.zeros((patterns, shared.shape[1])), shared]))
    return replace(noise, variance=variance).plus(added)


def _parts_of_spots(noise: Floats, spot: NDArray[np.intp], errors: Floats) -> Floats:
    """Square of each reading's noise share over the mean square (n,), 1 without errors of spots.

    The noise share is a mean of all spots, of which one on gloss may make nearly all.
    """
    if errors.size != spot.max(initial=-1) + 1 or not errors.any():
        return np.ones(noise.size)
    own = errors**2 / (np.bincount(spot, noise) / np.bincount(spot))
    return np.asarray(own / own.mean())[spot]


def image_error_of(capture: Capture) -> tuple[Floats, Floats]:
    """Variance (n,) of each reading of a pattern, and standard error (n,) common to all.

    In electrons, by the light of a simulation; zero for any other capture.
    """
    plans = capture.setup.plans
    if capture.truth is None or not capture.plan.shows_image:
        none = np.zeros(constant(plans).size)
        return none, none
    return light_error(plans, np.nan_to_num(capture.truth.image_error[0].astype(np.float64)) ** 2)


def _dark(capture: Capture) -> tuple[float, Floats]:
    """Dark electrons of a reading of a pattern, and the sum of those of each spot (spots,).

    They are exact in a simulation. Arrivals of histograms are per cycle. Zero if the capture does
    not hold its instrument.
    """
    spots = capture.spots
    none = np.zeros(0 if spots is None else len(spots.directions))
    try:
        instrument = embedded_instrument(capture.provenance.instrument)
    except InputError:
        return 0.0, none
    of_patterns = 0.0
    if instrument.images:
        detector = instrument.imaging.detector
        one = detector.dark_electrons(instrument.imaging.exposure_time_s)
        of_patterns = len(detector.positions_m) * one
    if spots is None or not instrument.ranges:
        return of_patterns, none
    rate_per_s = np.full((1, none.size), instrument.ranging.tof.detector.sensor.dark_rate_hz)
    paths_m = np.array([1.0, 1.02])
    nothing = np.zeros((1, none.size, paths_m.size))
    light = SpotLight(paths_m, nothing, rate_per_s, instrument.ranging.lasers.power_w)
    dark = instrument.ranging.tof.record(light, instrument.spot_optics, None)
    if isinstance(dark, HistogramSpots):
        return of_patterns, dark.counts[0].sum(axis=1) / dark.pulses
    assert isinstance(dark, CwSpots | PulsedSpots)
    return of_patterns, dark.electrons(dark.taps)[0].sum(axis=1)


class StatedAccuracy:
    """Accuracy of a simulation's light by its name in the settings, 0 where it is not stated."""

    def __init__(self, capture: Capture) -> None:
        try:
            light = yaml.safe_load(capture.provenance.settings)["light"]
        except (yaml.YAMLError, KeyError, TypeError):
            light = {}
        self._light = light if isinstance(light, dict) else {}

    def __call__(self, name: str) -> float:
        return _number(self._light.get(name))

    @property
    def errors_of_spots(self) -> Floats:
        """Standard errors (spots,) of the light on each spot; empty if they are not stated."""
        values = self._light.get("spot_errors")
        return np.array([_number(each) for each in values] if isinstance(values, list) else [])


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) and np.isfinite(value) else 0.0

"""From a frame to the input of the depth network."""

from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import Floats
from ..base.errors import InputError
from ..capture import Optics, Setup, Spots
from ..capture.readings.cw import CwSpots
from ..ranging import RANGING_METHODS, FogOptics, Ranges, RangingSolver
from .method import View
from .network_input import Anchors, NetworkInput

LOST = ("no signal", "weak")
"""Statuses of spots without a return."""
MAX_FOG_SIGMA = 0.4
"""Maximum standard deviation of log backscattering for fog to count as known; a priori it is 0.6.
"""
USUAL_NOISE = 0.03
"""Noise of readings that do not state theirs."""
MAX_SIGMA = 2.0
"""Relative sigma at which a range carries no information."""
LOG_REFLECTANCE = -6.0, 3.0
"""Limits of log reflectance."""


@dataclass(frozen=True, eq=False)
class Observer:
    """Data shared by the frames of a recording; ``fog`` is None if fog cannot be estimated.

    ``gain``: amplitude of the first taps, in electrons, if all of a laser's light returned; nan if
    unknown. ``fraction``: distinct patterns over pixels.
    """

    optics: Optics
    spots: Spots
    plain: RangingSolver
    fog: RangingSolver | None
    gain: float
    max_range_m: float
    fraction: float

    @classmethod
    def of(cls, setup: Setup) -> "Observer":
        """Observer of a recording with optics and spots."""
        assert setup.optics is not None
        assert setup.spots is not None
        spots = setup.spots
        plain = RANGING_METHODS[spots.method]
        return cls(
            optics=setup.optics,
            spots=spots,
            plain=plain.compile(spots),
            fog=_fog_solver(spots),
            gain=_gain(spots),
            max_range_m=plain.unambiguous_range_m(spots),
            fraction=setup.plan.sampling_ratio,
        )

    def __call__(self, view: View) -> NetworkInput:
        """Network input for a frame with ranges; missing plain or fitted ranges are computed."""
        assert view.ranges is not None
        assert view.frame.spots is not None
        own = self.plain(view.frame.spots)
        if view.ranges.fog is None:
            plain = view.ranges
            fitted = None if self.fog is None else self.fog(view.frame.spots)
        else:
            plain, fitted = own, view.ranges
        fog = None if fitted is None else fitted.fog
        if fog is None or fog.log_sigma >= MAX_FOG_SIGMA:
            fog = FogOptics(np.nan, np.nan, np.nan)
        directions = view.directions
        unknown = np.full(len(directions), np.nan)
        frame = NetworkInput(
            image=view.image,
            optics=self.optics,
            directions=directions,
            plain=_anchors(plain, directions),
            fitted=Anchors(unknown, unknown) if fitted is None else _anchors(fitted, directions),
            lost=np.isin(plain.status, LOST),
            log_reflectance=unknown,
            noise=_noise(view),
            fraction=self.fraction,
            max_range_m=self.max_range_m,
            extinction_per_m=fog.extinction_per_m,
            backscatter_per_m_sr=fog.backscatter_per_m_sr,
        )
        return replace(frame, log_reflectance=self._log_reflectance(frame, own.signal_electrons))

    def _log_reflectance(self, frame: NetworkInput, amplitudes: Floats) -> Floats:
        """Log reflectance of Lambertian surfaces facing the instrument, corrected for known fog."""
        range_m = np.exp(frame.best.log_depth) / frame.directions[:, 2]
        collected = self.spots.aperture_radii_m**2 / range_m**2
        with np.errstate(divide="ignore", invalid="ignore"):
            result = np.log(amplitudes / (self.gain * collected))
        lost = 2 * np.nan_to_num(frame.extinction_per_m) * range_m
        return np.where(np.isfinite(result), np.clip(result + lost, *LOG_REFLECTANCE), np.nan)


def _anchors(ranges: Ranges, directions: Floats) -> Anchors:
    range_m, sigma_m = ranges.likeliest
    with np.errstate(divide="ignore", invalid="ignore"):
        return Anchors(np.log(range_m * directions[:, 2]), np.minimum(sigma_m / range_m, MAX_SIGMA))


def _fog_solver(spots: Spots) -> RangingSolver | None:
    """Solver for ranging in fog, None if the recording lacks what it needs."""
    try:
        return RANGING_METHODS["fog"].compile(spots)
    except InputError:
        return None


def _gain(spots: Spots) -> float:
    """Amplitude in electrons of the taps of the first frequency, for all of a laser's light."""
    if not isinstance(spots, CwSpots):
        return np.nan
    first = spots.tap_frequencies_hz == spots.tap_frequencies_hz[0]
    energy, contrast = (
        np.broadcast_to(each, first.shape)[first].mean()
        for each in (spots.laser_energies_j, spots.contrasts)
    )
    return float(spots.electrons_per_joule * energy * contrast)


def _noise(view: View) -> float:
    """Rms noise of a reading over the spread of the readings."""
    buckets = view.frame.buckets
    usable, signal, variance = buckets.usable[0], buckets.signal[0], buckets.variance[0]
    if not usable.all():
        signal, variance = signal[usable], variance[usable]
    spread = float(signal.std())
    if not np.isfinite(variance).all() or not spread > 0:
        return USUAL_NOISE
    return float(np.sqrt(variance.mean()) / spread)


def brightness_noise(view: View) -> float:
    """Rms noise of an image's mean, as of a reading of all its pixels; nan if unknown."""
    buckets = view.frame.buckets
    return float(np.sqrt(buckets.variance[0][buckets.usable[0]].mean())) / view.image.size

"""What lies half way between two captures, where changes are linear to second order."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from reconstruction import Reconstructor, Result
from reconstruction.base.arrays import Floats
from reconstruction.capture import Capture, Optics
from reconstruction.capture.readings.cw import CwSpots
from reconstruction.capture.readings.dtof import HistogramSpots
from reconstruction.capture.readings.pulsed import PulsedSpots
from reconstruction.capture.schema import joined
from reconstruction.capture.spots import SpotOptics
from reconstruction.depth import MAX_RANGE_M, pixel_rays
from reconstruction.ranging import FogOptics
from reconstruction.ranging.brightness import bucket_optics
from reconstruction.ranging.fog.overlap import overlap, path_lengths

from .charges import ChargeModel, FogChange
from .histograms import HistogramModel
from .patterns import Mean, buckets_of, constant, exposed, patterns_mean

SpotModel = ChargeModel | HistogramModel
GRID, STEPS, NEAREST_M = 8, 400, 0.02
"""Rays per side on which the echo of fog is computed, ranges on each, and the nearest of them."""
BESIDE_PER_SR = 0.024
"""Albedo times phase function of droplets some 50 mrad off 180 degrees, beside the glory: what a
detector centimetres beside the projector receives from fog within a few metres."""
USUAL_RANGE_M = 5.0
"""Range of pixels where none is measured."""


def spot_model(real: Capture, simulated: Capture) -> SpotModel | None:
    """Model of the spots' readings; None without spots."""
    one, other = real.spots, simulated.spots
    if isinstance(one, HistogramSpots) and isinstance(other, HistogramSpots):
        return HistogramModel(one, other)
    if isinstance(one, CwSpots | PulsedSpots) and isinstance(other, CwSpots | PulsedSpots):
        return ChargeModel(one, other)
    return None


@dataclass(frozen=True, eq=False)
class Midpoint:
    """Two captures, their mean readings, and what is reconstructed from the mean of both."""

    real: Capture
    simulated: Capture
    means: tuple[Mean, Mean]
    spots: SpotModel | None

    @classmethod
    def of(cls, real: Capture, simulated: Capture) -> "Midpoint":
        """The captures must be comparable."""
        means = patterns_mean(real), patterns_mean(simulated)
        return cls(real, simulated, means, spot_model(real, simulated))

    @property
    def patterns(self) -> Floats:
        """Mean readings of patterns (n,)."""
        return np.asarray((self.means[0].value + self.means[1].value) / 2)

    @cached_property
    def results(self) -> list[Result]:
        """Reconstruction of a frame of each plan."""
        one, other = self.means
        variance = np.nansum([one.variance, other.variance], axis=0)
        capture = replace(
            self.simulated,
            buckets=buckets_of(
                self.patterns, variance / 4, one.usable & other.usable, self.simulated
            ),
            spots=None,
            pattern_taps=None,
            truth=None,
        )
        plans = len(capture.setup.plans)
        if self.spots is not None:
            capture = replace(capture, spots=joined([self.spots.between] * plans))
        return Reconstructor(capture.setup).batch(capture.batch(0, plans))

    @property
    def result(self) -> Result:
        """Reconstruction of the first frame."""
        return self.results[0]

    @cached_property
    def image(self) -> Floats:
        """Image (H, W), mean over the plans."""
        return np.mean([each.image.astype(np.float64) for each in self.results], axis=0)

    @cached_property
    def images(self) -> tuple[Floats, ...]:
        """Image (H, W) of each capture, from its mean readings."""
        images = []
        for capture, mean in zip((self.real, self.simulated), self.means, strict=True):
            buckets = buckets_of(mean.value, mean.variance, mean.usable, capture)
            still = replace(capture, buckets=buckets, spots=None, pattern_taps=None, truth=None)
            results = Reconstructor(still.setup).batch(still.batch(0, still.frames))
            images.append(np.mean([each.image.astype(np.float64) for each in results], axis=0))
        return tuple(images)

    @cached_property
    def background(self) -> float:
        """Steady light in a reading."""
        plans = self.simulated.setup.plans
        on = constant(plans) * (self.means[0].usable & self.means[1].usable)
        if not on.any():
            return 0.0
        return float(on @ (self.patterns - exposed(plans, self.image)) / on.sum())

    @cached_property
    def turned_per_deg(self) -> Floats | None:
        """Change of readings of patterns (n, 2) per degree that the view turns down and right.

        None if the optics are not stated.
        """
        optics = self.simulated.optics
        if optics is None:
            return None
        height, width = self.image.shape
        pixels_per_deg = (
            np.radians(1)
            / 2
            * np.array([height / optics.tan_half_height, width / optics.tan_half_width])
        )
        slopes = np.gradient(self.image)
        plans = self.simulated.setup.plans
        turned = [
            exposed(plans, slope * pixels)
            for slope, pixels in zip(slopes, pixels_per_deg, strict=True)
        ]
        return np.column_stack(turned)

    @property
    def fog(self) -> FogOptics | None:
        """Fog as ranging found it."""
        return next((each.fog for each in self.result.rangings.values() if each.fog), None)

    @property
    def range_of_spots_m(self) -> Floats:
        """Likeliest ranges (spots,), nan where there is none."""
        return self.result.ranges.likeliest[0] if self.result.ranges else np.zeros(0)

    @cached_property
    def range_of_pixels_m(self) -> Floats:
        """Ranges (H, W): the depth map's, or the mean of the spots'."""
        result = self.result
        spots = self.range_of_spots_m
        usual = float(np.nanmean(spots)) if np.isfinite(spots).any() else USUAL_RANGE_M
        if result.depth_m is None or result.range_over_depth is None:
            return np.full(self.image.shape, usual)
        range_m = result.depth_m.astype(np.float64) * result.range_over_depth
        return np.clip(np.nan_to_num(range_m, nan=usual), 0.0, MAX_RANGE_M)

    @cached_property
    def spots_in_fog(self) -> FogChange | None:
        """Change of the spots' readings by more fog."""
        return None if self.spots is None else self.spots.fog(self.range_of_spots_m, self.fog)

    @cached_property
    def image_in_fog(self) -> tuple[Floats, Floats]:
        """Change of the image (H, W) per 1/m of extinction: of surfaces, and by the fog's echo.

        The echo is zero if the optics or the brightness of pixels are not stated.
        """
        extinction = 0.0 if self.fog is None else self.fog.extinction_per_m
        path_m = 2 * self.range_of_pixels_m
        echo = np.zeros_like(self.image)
        if self.simulated.optics is not None:
            echo = fog_echo(self.simulated.optics, self.range_of_pixels_m, extinction)
        surfaces = self.image - extinction * echo
        return -path_m * surfaces, echo


def fog_echo(optics: Optics, range_m: Floats, extinction_per_m: float) -> Floats:
    """Electrons (H, W) of singly backscattered light in front of ranges (H, W), per 1/m of fog.

    Computed on a coarse grid of rays, as it is smooth.
    """
    from scipy.ndimage import zoom  # slow to import

    shape = range_m.shape
    side = (min(GRID, shape[0]), min(GRID, shape[1]))
    rays = pixel_rays(optics, side).reshape(-1, 3)
    directions = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    beams = SpotOptics(directions=directions, detector_positions_m=np.zeros_like(directions))
    steps = np.geomspace(NEAREST_M, max(float(range_m.max()), 2 * NEAREST_M), STEPS)
    in_front = np.zeros((len(rays), steps.size))
    for photodiode in bucket_optics(optics, beams):  # type: ignore[arg-type]
        weight, path_m = overlap(photodiode, steps)[0], path_lengths(photodiode, steps)
        seen = weight * np.exp(-extinction_per_m * path_m)
        cells = (seen[:, 1:] + seen[:, :-1]) / 2 * np.diff(steps)
        in_front[:, 1:] += np.cumsum(cells, axis=1)
    coarse = zoom(
        range_m, (side[0] / shape[0], side[1] / shape[1]), order=1, grid_mode=True, mode="nearest"
    )
    last = np.clip(np.searchsorted(steps, coarse.ravel()), 0, steps.size - 1)
    echo = in_front[np.arange(len(rays)), last].reshape(side)
    fine = zoom(
        echo, (shape[0] / side[0], shape[1] / side[1]), order=1, grid_mode=True, mode="nearest"
    )
    return np.asarray(BESIDE_PER_SR * fine * np.nan_to_num(optics.pixel_electrons))

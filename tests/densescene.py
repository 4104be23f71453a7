"""A small room in front of a dark opening, and what taps of every pattern read of it."""

import numpy as np
from scipy.constants import c

from reconstruction import Capture, PatternPlan, make_plan
from reconstruction.capture import Buckets, FrameTruth, Optics, PatternTaps, Provenance, Truth
from reconstruction.depth import pixel_rays
from reconstruction.operators import expose

SHAPE = (32, 32)
OPTICS = Optics(tan_half_width=0.3, tan_half_height=0.3)
SLOPE = pixel_rays(OPTICS, SHAPE)
RAYS = SLOPE / np.linalg.norm(SLOPE, axis=-1, keepdims=True)
DETECTOR = np.array([0.1, -0.05, 0.01])
CONTRAST = 0.8
BACKGROUND = 3e5


def scene():
    """Electrons per tap and pixel, and ranges: floor, back wall, box; 8 columns see nothing."""
    x, y, _ = np.moveaxis(SLOPE, -1, 0)
    depth = np.full(SHAPE, 6.0)
    reflectance = np.full(SHAPE, 0.5)
    floor = y > 1.0 / 6  # 1 m below
    depth[floor], reflectance[floor] = 1.0 / y[floor], 0.3
    box = (np.abs(x - 0.1) < 0.1) & (np.abs(y) < 0.12)
    depth[box], reflectance[box] = 3.5, 0.7
    range_m = depth * np.linalg.norm(SLOPE, axis=-1)
    light = 2e5 * reflectance / range_m**2
    light[:, :8] = 0
    return light, range_m


def record(light, range_m, plan: PatternPlan, frequencies=(15e6,), rng=None, **changes):
    """Taps of every exposure, four of each frequency; with shot and read noise if ``rng``.

    Without, the noise that the readings claim is next to none.
    """
    path = range_m + np.linalg.norm(range_m[..., None] * RAYS - DETECTOR, axis=-1)
    frequency = np.repeat(frequencies, 4)
    theta = np.tile(np.arange(4) * np.pi / 2, len(frequencies))
    offset = np.repeat(0.3 + np.arange(len(frequencies)), 4)
    phase = 2 * np.pi * frequency[:, None, None] * path / c + (offset - theta)[:, None, None]
    differences = plan.polarity == 0
    taps = expose(plan, light * (1 + CONTRAST * np.cos(phase))).T
    taps = taps + np.where(differences, 0, BACKGROUND)[:, None]
    values = {
        "noise_electrons": 0.0,
        "excess_noise_factor": 1e-12 if rng is None else 1.0,
        "electrons_per_count": 2.0,
        "offset_counts": 0.0 if differences.any() else 30.0,
    } | changes
    if rng is not None:
        taps = rng.poisson(taps) + rng.normal(0, values["noise_electrons"], taps.shape)
    return PatternTaps(
        **values,
        taps=(taps / 2 + values["offset_counts"])[None],
        saturated=np.zeros((1, *taps.shape), dtype=bool),
        tap_frequencies_hz=frequency,
        tap_phases_rad=theta,
        phase_offsets_rad=offset,
        detector_position_m=DETECTOR,
    )


def make_capture(patterns=None) -> Capture:
    """A noise-free capture without spots; the buckets are the sums over the taps."""
    light, range_m = scene()
    plan = make_plan(SHAPE, patterns)
    readings = record(light, range_m, plan)
    sums = readings.taps.sum(axis=-1)
    return Capture(
        plan=plan,
        buckets=Buckets(
            counts=sums,
            saturated=np.zeros(sums.shape, dtype=bool),
            exposure_time_s=1e-4,
            pattern_period_s=1e-4,
            electrons_per_count=2.0,
            offset_counts=4 * 30.0,
            noise_electrons=0.0,
            excess_noise_factor=1e-12,
            dead_time_s=0.0,
        ),
        spots=None,
        optics=OPTICS,
        provenance=Provenance("simulation", "test", "2026-01-01T00:00:00+00:00", ""),
        truth=Truth.of(
            [
                FrameTruth(
                    image=4 * light.astype(np.float32),
                    image_error=np.zeros(SHAPE, np.float32),
                    range_m=range_m.astype(np.float32),
                    depth_m=(range_m * RAYS[..., 2]).astype(np.float32),
                    reflectance=np.full(SHAPE, 0.5, np.float32),
                    spot_range_m=np.full(4, np.nan),
                )
            ]
        ),
        pattern_taps=readings,
    )

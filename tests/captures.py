"""A capture with every part, of random numbers, shared by the tests."""

from dataclasses import replace

import numpy as np

from instruments import some_of
from reconstruction.capture import (
    Buckets,
    Capture,
    FrameTruth,
    Optics,
    PatternTaps,
    Poses,
    Provenance,
    Truth,
)
from reconstruction.capture.readings.cw import CwSpots
from reconstruction.capture.readings.dtof import HistogramSpots
from reconstruction.capture.readings.pulsed import PulsedSpots
from reconstruction.operators import make_plan

DIRECTIONS = np.tile([0.0, 0.6, 0.8], (4, 1))
CHARGE = {
    "electrons_per_count": 1.5,
    "offset_counts": 20.0,
    "noise_electrons": 100.0,
    "excess_noise_factor": 5.5,
}


def make_spots(method):
    """Readings of two frames by any method."""
    rng = np.random.default_rng(1)
    common = {
        "directions": DIRECTIONS,
        "detector_positions_m": rng.random((4, 3)),
        "detector_axes": DIRECTIONS[::-1],
        "half_fields_rad": np.array([0.01, 0.02, np.nan, np.nan]),
        "falloffs": np.array([0.0, 0.0, 3.0, np.nan]),
        "aperture_radii_m": np.array([0.0, 1e-3, 2e-3, np.nan]),
        "beam_divergence_rad": 1e-3,
        "beam_waist_m": 2e-3,
        "electrons_per_joule": 5e18,
    }
    if method == "cw":
        return CwSpots(
            **common,
            **CHARGE | {"noise_electrons": np.array([100.0, 90.0, 80.0])},
            taps=rng.random((2, 4, 3)),
            saturated=np.zeros((2, 4, 3), dtype=bool),
            tap_frequencies_hz=np.full(3, 15e6),
            tap_phases_rad=np.array([0.0, 2.0, 4.0]),
            phase_offsets_rad=np.full(3, 0.1),
            periods=np.array([1000, 2000, 3000]),
            laser_energies_j=np.array([1e-6, 2e-6, 3e-6]),
            contrasts=np.array([0.9, 0.8, np.nan]),
        )
    if method == "pulsed":
        return PulsedSpots(
            **common,
            **CHARGE,
            taps=rng.random((2, 4, 3)),
            saturated=np.zeros((2, 4, 3), dtype=bool),
            window_starts_s=np.array([-70e-9, 0, 65e-9]),
            pulse_width_s=65e-9,
            pulses=1000,
            delay_offset_s=1e-9,
            laser_energy_j=2e-6,
        )
    return HistogramSpots(
        **common,
        counts=rng.integers(0, 9, (2, 4, 50), dtype=np.int32),
        saturated=np.zeros((2, 4), dtype=bool),
        bin_width_s=1e-9,
        start_s=5e-9,
        pulses=10_000,
        response_sigma_s=0.5e-9,
        delay_offset_s=1e-9,
        laser_energy_j=2e-6,
    )


def full_capture():
    """Two frames with spots by continuous wave, taps of every pattern, and truth."""
    rng = np.random.default_rng(0)
    plan = make_plan((4, 8), 10)
    images = rng.random((2, 4, 8)).astype(np.float32)
    return Capture(
        plan=plan,
        buckets=Buckets(
            counts=rng.integers(0, 65536, (2, 20), dtype=np.int32),
            saturated=rng.random((2, 20)) < 0.1,
            exposure_time_s=60e-6,
            pattern_period_s=67e-6,
            electrons_per_count=900.0,
            offset_counts=100.0,
            noise_electrons=5e4,
            excess_noise_factor=1.0,
            dead_time_s=1e-13,
        ),
        spots=make_spots("cw"),
        optics=Optics(tan_half_width=0.2, tan_half_height=0.1),
        provenance=Provenance(
            "simulation", "spisim 0", "2025-01-01T00:00:00+00:00", "λ: 1550", "s", 7, "spp: 1"
        ),
        truth=Truth.of(
            [
                FrameTruth(
                    image, image / 9, image, np.where(image > 0.5, image, np.nan), image, spots
                )
                for image, spots in zip(images, rng.random((2, 4)), strict=True)
            ]
        ),
        pattern_taps=PatternTaps(
            **CHARGE,
            taps=rng.integers(0, 4096, (2, 20, 6), dtype=np.int32),
            saturated=rng.random((2, 20, 6)) < 0.1,
            tap_frequencies_hz=np.repeat([15e6, 20e6], 3),
            tap_phases_rad=np.tile([0.0, 2.0, 4.0], 2),
            phase_offsets_rad=np.repeat([0.1, 0.2], 3),
            detector_position_m=rng.random(3),
        ),
        poses=make_poses(2),
    )


def make_poses(frames):
    """A drone that flies forward and yaws, with unknown covariance in its last frame."""
    angles, covariance = 0.1 * np.arange(frames), np.tile(1e-4 * np.eye(6), (frames, 1, 1))
    covariance[-1] = np.nan
    none = np.zeros(frames)
    return Poses(
        time_s=0.01 * (np.arange(frames) + 0.5),
        position_m=np.stack([none, none, angles], axis=1),
        orientation=np.stack([none, np.sin(angles / 2), none, np.cos(angles / 2)], axis=1),
        covariance=covariance,
    )


def with_spots(capture, order):
    """The same capture with the spots of these indices, in this order; some may come again."""
    truth = capture.truth
    if truth is not None:
        truth = replace(truth, spot_range_m=truth.spot_range_m[:, order])
    return replace(capture, spots=some_of(capture.spots, order), truth=truth)

"""Light of moving boards at the time of every reading, against integrals over their surface."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.constants import c

import spisim
import worlds
from instruments import changed
from reconstruction.operators import illumination
from spisim.simulation.light import trace
from spisim.simulation.measurement import bucket_light, spot_light
from spisim.simulation.measurement.light import background_electrons, pixel_electrons

WALL_M, REFLECTANCE = 4.0, 0.5
#: Where the edge of a board starts, within a pixel.
EDGE_M = 0.03
#: Parts of a pixel over which its light is integrated.
ROWS, COLUMNS = 16, 32


def light_of(instrument, velocity_m_s, shift_m=0.0, seed=0):
    """A board across the axis, moved aside by `shift_m` at the start."""
    board = worlds.plane(WALL_M, REFLECTANCE, half_size_m=20.0)
    board.mesh.apply_translation([shift_m, 0, 0])
    scene = worlds.scene(replace(board, velocity_m_s=velocity_m_s))
    return trace(
        scene, instrument, frames=1, spp=16, transport_noise_share=None, seed=seed, progress=None
    )


class Board:
    """Light of a board at a depth, by midpoints of `ROWS` and `COLUMNS` parts of each pixel.

    Σ over detectors of ρ/π cos² A / r² exp(i k L) is the fraction of its power that comes back.
    """

    def __init__(self, instrument, depth_m, k_per_m=0.0):
        projector, detector = instrument.projector, instrument.detector
        self.shape = height, width = projector.shape
        x = 2 * (np.arange(COLUMNS * width) + 0.5) / (COLUMNS * width) - 1
        y = 2 * (np.arange(ROWS * height) + 0.5) / (ROWS * height) - 1
        self.x_m = x * projector.tan_half_width * depth_m
        y_m = y * projector.tan_half_height * depth_m
        points = np.stack([*np.meshgrid(self.x_m, y_m), np.full((y.size, x.size), depth_m)], -1)
        self.light = np.zeros(points.shape[:2], complex)
        for position in detector.positions_m:
            back = points - position
            back_m = np.linalg.norm(back, axis=-1)
            cosine = back[..., 2] / back_m
            seen = cosine > np.cos(np.radians(detector.field_of_view_deg) / 2)
            light = seen * cosine ** (2 + detector.vignetting) * detector.aperture_area_m2
            path_m = np.linalg.norm(points, axis=-1) + back_m
            self.light += REFLECTANCE / np.pi * light / back_m**2 * np.exp(1j * k_per_m * path_m)
        self.light = self.light.reshape(height, ROWS, -1).mean(axis=1)

    def left_of(self, edge_m=np.inf):
        """Its image (H, W) where it ends at an edge; columns that the edge cuts count in part."""
        covered = np.clip((edge_m - self.x_m) / (self.x_m[1] - self.x_m[0]) + 0.5, 0, 1)
        return (self.light * covered).reshape(*self.shape, COLUMNS).mean(axis=2)


@pytest.mark.parametrize(("speed_m_s", "runs"), [(2.0, 6), (40.0, 1)])
def test_an_edge_that_moves_across_is_where_it_is_at_each_pattern(speed_m_s, runs):
    """Within chance if it moves by less than a pixel per frame, within a quarter of the noise by 8.

    Blended between key times half a frame apart it would be off by the noise.
    """
    one = changed("paper", projector__shape=[16, 16])
    plan, full, board = one.pattern_plan, pixel_electrons(one), Board(one, WALL_M)
    exact = background_electrons(one, [0.0]) + np.array(
        [
            np.vdot(
                illumination(plan, number) * full, board.left_of(EDGE_M + speed_m_s * time_s).real
            )
            for number, time_s in enumerate(one.exposure_times_s(1)[0])
        ]
    )
    readings = np.array(
        [
            bucket_light(one, light_of(one, (speed_m_s, 0, 0), EDGE_M - 20.0, seed), 1).buckets[0]
            for seed in range(runs)
        ]
    )
    error = np.sqrt(np.mean((readings.mean(axis=0) - exact) ** 2))
    electronics = one.detector.electronics_noise_electrons(one.imaging.exposure_time_s)
    if runs > 1:
        z = worlds.z_score_exact(readings[:, :-1], exact[:-1])  # without the dark one
        assert np.mean(z**2) < 3  # 1.7 of Student's t with 5 degrees of freedom
    assert error < 0.25 * np.sqrt(exact.mean() + electronics**2)


def coming(instrument, speed_m_s=20.0):
    """Light of a wall that comes closer along the axis."""
    return light_of(instrument, (0.0, 0.0, -speed_m_s))


def test_taps_of_a_modulated_projector_hold_the_path_of_their_own_pattern():
    modulation = {"frequencies_hz": [15e6], "light": "sine", "contrast": 1.0}
    one = changed("paper", projector__shape=[16, 16], projector__modulation=modulation)
    plan, k_per_m = one.pattern_plan, 2 * np.pi * 15e6 / c
    taps = bucket_light(one, coming(one), 1).taps[0]
    offset = one.projector.modulation.phase_offset_rad(15e6, one.detector.amplifier.response)
    measured = np.arctan2(taps[:, 1] - taps[:, 3], taps[:, 0] - taps[:, 2]) - offset
    for number in range(0, plan.exposures, 9):
        depth_m = WALL_M - 20.0 * one.exposure_times_s(1)[0, number]
        image = Board(one, depth_m, k_per_m).left_of()
        phase = np.angle(np.sum(illumination(plan, number) * image))
        assert measured[number] / k_per_m == pytest.approx(phase / k_per_m, abs=1e-3)


SHARED = {"tof__detector__positions_m": [[0, 0, 0]], "tof__detector__field_of_view_deg": 16}
IN_TURN = {"tof__modulation__taps": {"arrangement": "in-turn"}}


@pytest.mark.parametrize("changes", [{}, IN_TURN, SHARED], ids=["frequencies", "taps", "spots"])
def test_what_is_read_in_turn_sees_the_wall_where_it_is_then(changes):
    """Each frequency, tap, and spot of a shared photodiode has its part of the frame.

    A tap collects ∫ 1/z² [1 + C cos(k L - θ)] dt; the wall comes 10 cm closer over the frame.
    """
    one = changed("fog", projector__shape=[16, 16], projector__power_w=1e-9, **changes)
    tof, speed_m_s = one.tof, 0.1 / one.frame_time_s
    light = spot_light(one, coming(one, speed_m_s), 1)
    spots = tof.record(light, one.spot_optics, None)
    electrons = (spots.taps[0] - spots.offset_counts) * spots.electrons_per_count
    response, taps = tof.detector.amplifier.response, (3, 4)
    turns = np.arange(12).reshape(taps) / 12 if changes is IN_TURN else np.arange(3)[:, None] / 3
    duration = 1 / 12 if changes is IN_TURN else 1 / 3
    for spot, direction in enumerate(one.lasers.directions):
        first, part = (spot / 4, 1 / 4) if changes is SHARED else (0.0, 1.0)
        for (number, tap), turn in np.ndenumerate(np.broadcast_to(turns, taps)):
            within = first + part * (turn + duration * (np.arange(100) + 0.5) / 100)
            depth_m = WALL_M - 0.1 * within
            point = np.multiply.outer(depth_m, direction / direction[2])
            back = point - one.ranging.detector_positions_m[spot]
            path_m = np.linalg.norm(point, axis=1) + np.linalg.norm(back, axis=1)
            frequency = tof.modulation.frequencies_hz[number]
            contrast = tof.modulation.demodulation_contrast(frequency, response)
            phase = 2 * np.pi * frequency / c * path_m - np.pi / 2 * tap
            phase += tof.modulation.phase_offset_rad(frequency, response)
            echo = light.echo_per_s[0, spot].sum() * (WALL_M - 0.1 * (first + part / 2)) ** 2
            rate = np.mean((1 + contrast * np.cos(phase)) * echo / depth_m**2)
            rate += light.steady_per_s[0, spot]
            within_3_percent = 0.03 * tof.tap_time_s(frequency) * light.echo_per_s[0, spot].sum()
            exact = pytest.approx(tof.tap_time_s(frequency) * rate, abs=within_3_percent)
            assert electrons[spot, 4 * number + tap] == exact


def test_a_frame_of_ranges_alone_is_smeared_by_the_way_of_the_wall():
    """At 30 m/s over 20 ms: the paths of its light are those of the whole frame, by 1/z²."""
    one = spisim.load_instrument("rangefinder-905").at_wavelength(1550)
    light = spot_light(one, coming(one, 30.0), 1)
    z = WALL_M - 30.0 * one.frame_time_s * (np.arange(1000) + 0.5) / 1000
    echo = light.echo_per_s[0, 0] / light.echo_per_s.sum()
    mean_m = echo @ light.path_length_m
    exact_m = np.average(2 * z, weights=z**-2.0)
    assert mean_m == pytest.approx(exact_m, abs=2e-3)
    spread_m = np.sqrt(echo @ (light.path_length_m - mean_m) ** 2)
    exact_spread_m = np.sqrt(np.average((2 * z - exact_m) ** 2, weights=z**-2.0))
    assert spread_m == pytest.approx(exact_spread_m, rel=0.02)

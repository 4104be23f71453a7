"""What a capture is warned about: clipped readings, spots without range or beyond ambiguity."""

from dataclasses import replace

import numpy as np
from scipy.constants import c

from reconstruction import Capture, capture_warnings, reconstruct
from reconstruction.capture import PatternTaps
from reconstruction.capture.readings.pulsed import PulsedSpots
from reconstruction.operators import PatternPlan, decoder_for, expose
from reconstruction.ranging import FogOptics, measure_ranges, range_consistency


def test_a_good_capture_has_none(capture: Capture) -> None:
    assert capture_warnings(capture) == []
    assert capture_warnings(replace(capture, spots=None, truth=None)) == []


def test_saturated_readings_are_counted_per_frame(capture: Capture) -> None:
    saturated = np.zeros((2, capture.plan.exposures), bool)
    saturated[1, :64] = True
    buckets = replace(
        capture.buckets, counts=np.tile(capture.buckets.counts, (2, 1)), saturated=saturated
    )
    two = replace(capture, buckets=buckets, spots=None)
    assert capture_warnings(two, 0) == []
    (warning,) = capture_warnings(two, 1)
    assert "64 of 256 bucket readings (25 %) are marked saturated" in warning


def test_a_spot_without_a_range_is_told_with_the_reason(capture: Capture) -> None:
    assert capture.spots is not None
    taps, saturated = capture.spots.taps.copy(), capture.spots.saturated.copy()
    taps[0, 1] = 2e5
    saturated[0, 2, 3] = True
    spots = replace(capture.spots, taps=taps, saturated=saturated)
    assert capture_warnings(replace(capture, spots=spots)) == [
        "spot 1 has no signal: it has no range",
        "spot 2 is saturated: it has no range",
    ]


def test_a_spot_closer_than_the_baseline_is_told(capture: Capture) -> None:
    assert capture.spots is not None
    positions = np.zeros((4, 3))
    positions[3, 0] = 20.0
    spots = replace(capture.spots, detector_positions_m=positions)
    (warning,) = capture_warnings(replace(capture, spots=spots))
    assert warning.startswith("spot 3 is too close")


def test_an_ambiguous_spot_is_told(capture: Capture) -> None:
    assert capture.spots is not None
    spots = PulsedSpots(
        directions=capture.spots.directions,
        detector_positions_m=np.zeros((4, 3)),
        taps=np.array([[[0, 900, 900]] * 3 + [[0, 900, 0]]]),
        saturated=np.zeros((1, 4, 3), dtype=bool),
        window_starts_s=np.array([-50e-9, 0, 40e-9]),
        pulse_width_s=40e-9,
        pulses=10,
        delay_offset_s=0.0,
        electrons_per_count=1.0,
        offset_counts=0.0,
        noise_electrons=1.0,
        excess_noise_factor=1.0,
    )
    (warning,) = capture_warnings(replace(capture, spots=spots, truth=None))
    assert warning.startswith("spot 3 is ambiguous")


def test_a_spot_beyond_the_unambiguous_range_is_told(capture: Capture) -> None:
    assert capture.truth is not None
    assert capture.spots is not None
    limit = c / (2 * capture.spots.tap_frequencies_hz[0])
    for beyond in (False, True):
        true = np.array([[4.2, 4.4, limit + (0.01 if beyond else -0.01), 4.8]])
        truth = replace(capture.truth, spot_range_m=true)
        warnings = "; ".join(capture_warnings(replace(capture, truth=truth)))
        text = "spot 2 lies at 15.00 m, beyond the maximum unambiguous range of 14.99 m"
        assert (text in warnings) == beyond


def test_a_range_where_there_is_nothing_is_told(capture: Capture) -> None:
    assert capture.truth is not None
    truth = replace(capture.truth, spot_range_m=np.array([[4.2, np.nan, 4.3, 4.8]]))
    text = "spot 1 hits no surface: its range is that of noise or fog"
    assert capture_warnings(replace(capture, truth=truth)) == [text]


def test_dense_ranges_beyond_the_unambiguous_range_are_told(capture: Capture) -> None:
    assert capture.truth is not None
    farthest_m = float(np.nanmax(capture.truth.range_m))
    taps = np.ones((1, capture.plan.exposures, 4))
    readings = PatternTaps(
        taps=taps,
        saturated=np.zeros(taps.shape, dtype=bool),
        tap_frequencies_hz=np.full(4, c / (2 * (farthest_m + 0.01))),
        tap_phases_rad=np.arange(4) * np.pi / 2,
        phase_offsets_rad=np.zeros(4),
        electrons_per_count=1.0,
        offset_counts=0.0,
        noise_electrons=1.0,
        excess_noise_factor=1.0,
        detector_position_m=np.zeros(3),
    )
    assert capture_warnings(replace(capture, pattern_taps=readings)) == []
    short = replace(readings, tap_frequencies_hz=np.full(4, c / (2 * (farthest_m - 0.01))))
    (warning,) = capture_warnings(replace(capture, pattern_taps=short))
    assert f"scene extends to {farthest_m:.2f} m, beyond the" in warning
    assert f"range of {farthest_m - 0.01:.2f} m" in warning


def noisy_capture(capture: Capture, snr: float, frames: int = 1) -> Capture:
    """Frames of a grating of this signal over noise in the mean square of the coefficients."""
    plan, rng = capture.plan, np.random.default_rng(0)
    image = 100 + np.cos(2 * np.pi * np.arange(plan.shape[1]) / plan.shape[1]) * np.ones(plan.shape)
    decoder = decoder_for(plan)
    power = np.mean(decoder.decode(expose(plan, image))[decoder.operator.varying] ** 2)
    own = decoder.own_variance(np.ones(plan.exposures)).mean()
    sigma = np.sqrt(power / own) / snr
    counts = expose(plan, image) + sigma * rng.standard_normal((frames, plan.exposures))
    buckets = replace(
        capture.buckets,
        counts=counts,
        saturated=np.zeros(counts.shape, bool),
        electrons_per_count=1.0,
        offset_counts=0.0,
        noise_electrons=float(sigma),
        excess_noise_factor=1e-9,
    )
    return replace(capture, buckets=buckets, spots=None, truth=None)


def test_more_noise_than_image_is_told(capture: Capture) -> None:
    assert capture_warnings(noisy_capture(capture, 3.0)) == []
    (warning,) = capture_warnings(noisy_capture(capture, 0.7))
    assert warning.startswith("there is hardly an image: signal over noise is about 0.")
    assert "a flat image is closer to the truth than the zero-filled one" in warning
    reported = float(warning.partition("about ")[2].split()[0])
    assert abs(reported**2 - 0.7**2) < 4 * np.sqrt(2 / 255) * (1 + 0.7**2)
    (warning,) = capture_warnings(noisy_capture(capture, 0.5, frames=3))
    assert warning.startswith("in 3 of 3 frames there is hardly an image")


def test_where_the_noise_is_not_known_nothing_is_said_of_it(capture: Capture) -> None:
    noisy = noisy_capture(capture, 0.1)
    unknown = replace(noisy, buckets=replace(noisy.buckets, noise_electrons=np.nan))
    assert capture_warnings(unknown) == []


def test_readings_that_tell_no_image_are_told(capture: Capture) -> None:
    lonely = PatternPlan((2, 2), np.array([1, 2]), np.array([1, 1]))
    buckets = noisy_capture(capture, 3.0).buckets
    two = replace(buckets, counts=buckets.counts[:, :2], saturated=buckets.saturated[:, :2])
    (warning,) = capture_warnings(
        replace(capture, plan=lonely, buckets=two, spots=None, truth=None)
    )
    assert warning.startswith("there is no image: the background cannot be removed")


def test_patterns_that_are_all_the_same_are_told(capture: Capture) -> None:
    same = PatternPlan(
        capture.plan.shape,
        np.zeros(128, np.int32),
        np.ones(128, np.int8),
        "natural",
        capture.plan.patterns,
    )
    buckets = replace(
        capture.buckets,
        counts=capture.buckets.counts[:, :128],
        saturated=capture.buckets.saturated[:, :128],
    )
    warnings = capture_warnings(replace(capture, plan=same, buckets=buckets, spots=None))
    assert "all 128 exposures show pattern 0: there is no image in them" in warnings


def test_a_range_that_is_off_by_more_than_noise_is_told(capture: Capture) -> None:
    assert capture.truth is not None
    truth = replace(
        capture.truth, spot_range_m=capture.truth.spot_range_m + np.array([0, 0.7, 0, 0])
    )
    (warning,) = capture_warnings(replace(capture, truth=truth))
    assert warning.startswith("spot 1 is measured 0.70 m too near, with a sigma of 0.00")


def two_frequencies(capture: Capture, off_m: float) -> Capture:
    """Taps of 10 and 30 MHz, of which the latter tell the first spot so much farther away."""
    spots = capture.spots
    assert spots is not None
    assert capture.truth is not None
    phases = np.tile(np.arange(4) * np.pi / 2, 2)
    frequencies = np.repeat([10e6, 30e6], 4)
    ranges = capture.truth.spot_range_m[0]
    paths = ranges + np.linalg.norm(
        ranges[:, None] * spots.directions - spots.detector_positions_m, axis=1
    )
    paths = np.repeat(paths[:, None], 8, axis=1)
    paths[0, 4:] += 2 * off_m
    taps = 2e5 + 1e5 * np.cos(2 * np.pi * frequencies / c * paths - phases)
    changed = replace(
        spots,
        taps=taps[None],
        saturated=np.zeros((1, 4, 8), bool),
        tap_frequencies_hz=frequencies,
        tap_phases_rad=phases,
        phase_offsets_rad=np.zeros(8),
        noise_electrons=np.full(8, 10.0),
    )
    return replace(capture, spots=changed)


def test_ranges_of_frequencies_that_differ_are_told_as_perhaps_biased(capture: Capture) -> None:
    assert "ranging cw" not in reconstruct(two_frequencies(capture, 0.0)).notes
    result = reconstruct(two_frequencies(capture, 0.2))
    assert result.notes["ranging cw"].startswith("possibly biased by fog or further echoes")
    assert "at spot 0 (4.2" in result.notes["ranging cw"]
    assert any(warning.startswith("ranging 'cw' is possibly biased") for warning in result.warnings)


def test_a_range_that_a_better_method_does_not_tell_is_perhaps_biased(capture: Capture) -> None:
    assert capture.spots is not None
    plain = measure_ranges(capture.spots)
    fog = FogOptics(0.01, 0.0003, 0.1)
    same = replace(plain, fog=fog)
    other = replace(plain, fog=fog, range_m=plain.range_m + np.array([0, 0, 1, 0]))
    assert range_consistency({"cw": plain, "fog": same}, capture.spots) == {}
    warnings = range_consistency({"cw": plain, "fog": other}, capture.spots)
    assert list(warnings) == ["cw"]
    assert warnings["cw"].endswith("at spot 2 (5.30 m by fog)")


def test_an_image_that_is_hardly_above_noise_says_so_noise_told_or_not(capture: Capture) -> None:
    for unknown in (False, True):
        for snr, reported in ((10.0, False), (0.2, True)):
            noisy = noisy_capture(capture, snr)
            if unknown:
                buckets = replace(noisy.buckets, electrons_per_count=np.nan)
                noisy = replace(noisy, buckets=buckets)
            notes = reconstruct(noisy, image="least-squares").notes
            assert ("frame 0" in notes) == reported
            assert not reported or notes["frame 0"].startswith("hardly above its noise")


def test_a_constant_image_says_so(capture: Capture) -> None:
    noisy = noisy_capture(capture, 10.0)
    counts = np.full(noisy.buckets.counts.shape, 7.0)
    flat = replace(noisy, buckets=replace(noisy.buckets, counts=counts))
    result = reconstruct(flat, image="edge-preserving")
    assert np.ptp(result.image) == 0
    assert result.warnings == [
        "frame '0' is without an image: the readings of all its patterns are equal"
    ]

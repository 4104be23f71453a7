"""What detectors see of beams, and what light of one path leaves in their readings."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.constants import c

from fogs import seen
from instruments import changed
from reconstruction.capture.spots import SpotOptics
from reconstruction.ranging.fog.overlap import overlap
from spisim.instrument import Instrument, SpotLight, load_instrument

HALF_FIELD = 0.01


def beside(aside_m: float, radius_m: float, **changes) -> SpotOptics:
    """Beams ahead, and detectors beside them that look ahead too."""
    values = {
        "directions": np.tile([0.0, 0.0, 1.0], (4, 1)),
        "detector_positions_m": np.tile([aside_m, 0.0, 0.0], (4, 1)),
        "detector_axes": np.tile([0.0, 0.0, 1.0], (4, 1)),
        "half_fields_rad": np.full(4, HALF_FIELD),
        "falloffs": np.zeros(4),
        "aperture_radii_m": np.full(4, radius_m),
        "beam_divergence_rad": 0.0,
        "beam_waist_m": 0.0,
    }
    return SpotOptics(**values | changes)


def test_a_pencil_and_a_pinhole_meet_where_the_field_s_edge_crosses_the_beam() -> None:
    """A cos / d^2 from aside / tan(half field) on, nothing before."""
    radius_m = 1e-6
    onset_m = 0.02 / np.tan(HALF_FIELD)
    range_m = np.concatenate([onset_m * np.array([0.5, 0.999, 1.001]), [3.0, 8.0, 20.0]])
    weight, path_m = overlap(beside(0.02, radius_m), range_m)
    distance = np.hypot(range_m, 0.02)
    expected = np.pi * radius_m**2 * range_m / distance**3 * (range_m > onset_m)
    np.testing.assert_allclose(weight, np.tile(expected, (4, 1)), rtol=1e-3, atol=1e-20)
    np.testing.assert_allclose(path_m, np.tile(range_m + distance, (4, 1)))


def test_a_field_that_falls_off_dims_what_is_off_its_axis() -> None:
    wide = beside(0.5, 1e-6, half_fields_rad=np.full(4, 1.2), falloffs=np.array([0, 1, 3, 4.5]))
    weight, _ = overlap(wide, np.array([1.0]))
    cosine = 1 / np.hypot(1, 0.5)
    np.testing.assert_allclose(weight[:, 0] / weight[0, 0], cosine**wide.falloffs, rtol=1e-4)


def test_an_aperture_s_share_that_sees_the_beam_is_where_two_circles_overlap() -> None:
    """From 0.2 m to 3.6 m more and more of it, as the preset says."""
    fog = load_instrument("fog")
    range_m = np.linspace(0.1, 8, 80)
    weight, path_m = overlap(fog.spot_optics, range_m)
    expected, expected_path_m = seen(fog, range_m)
    np.testing.assert_allclose(path_m, expected_path_m, rtol=1e-12)
    whole = np.pi * fog.spot_optics.aperture_radii_m[:, None] ** 2 / range_m**2
    assert (weight[:, range_m < 0.2] == 0).all()
    assert np.abs((weight - expected) / whole).max() < 1e-4
    after = range_m > 3.7
    np.testing.assert_allclose(weight[:, after], expected[:, after], rtol=1e-5)


@pytest.mark.parametrize("range_m", [0.8, 1.5, 2.0, 2.5, 4.0])
def test_a_wide_beam_before_a_wide_aperture(range_m: float) -> None:
    """Against points drawn on beam and aperture."""
    optics = beside(0.02, 0.008, beam_divergence_rad=2e-3, beam_waist_m=3e-3)
    rng = np.random.default_rng(3)
    number = 20_000
    width = np.hypot(3e-3, 2e-3 * range_m)
    lit = np.column_stack([width * rng.normal(size=(number, 2)), np.full(number, range_m)])
    radius, angle = 0.008 * np.sqrt(rng.random(number)), 2 * np.pi * rng.random(number)
    on_aperture = np.column_stack(
        [0.02 + radius * np.cos(angle), radius * np.sin(angle), np.zeros(number)]
    )
    towards = lit - on_aperture
    distance = np.linalg.norm(towards, axis=1)
    cosine = towards[:, 2] / distance
    each = np.pi * 0.008**2 * np.where(cosine >= np.cos(HALF_FIELD), cosine, 0) / distance**2
    weight, _ = overlap(optics, np.array([range_m]))
    coarse = 0.02 * np.pi * 0.008**2 / range_m**2  # few pencils
    error = abs(weight[0, 0] - each.mean())
    assert error < coarse + 3.5 * each.std() / np.sqrt(number)


# What light of one path leaves in the readings


def one_path(instrument: Instrument, path_m: float) -> tuple[SpotLight, float]:
    """All light of a laser on its detector, over one path."""
    per_joule = instrument.electrons_per_joule(instrument.tof.detector, "laser")
    watts = instrument.lasers.power_w
    echo = np.zeros((1, 4, 2))
    echo[..., 0] = per_joule * watts
    paths_m = np.array([path_m, path_m + 0.01])
    return SpotLight(paths_m, echo, np.zeros((1, 4)), watts), per_joule


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"tof__periods": [100, 4000, 90_000]},
        {"tof__modulation__taps": {"shape": "rectangular", "width": 0.5, "arrangement": "in-turn"}},
        {"tof__detector__amplifier__bandwidth_hz": 200e6},
    ],
)
@pytest.mark.parametrize("path_m", [0.0, 3.1, 14.7])
def test_response_of_taps(changes: dict, path_m: float) -> None:
    fog = changed("fog", **changes)
    given, per_joule = one_path(fog, path_m)
    spots = fog.tof.record(given, fog.spot_optics, None)
    expected = np.concatenate(
        [fog.tof.tap_electrons(given, f)[0, 0] for f in fog.tof.modulation.frequencies_hz]
    )
    result = spots.electrons_per_joule * spots.response(np.array(path_m))
    assert spots.electrons_per_joule == per_joule
    np.testing.assert_allclose(result, expected, rtol=1e-9, atol=1e-9 * expected.max())


@pytest.mark.parametrize("path_m", [0.0, 1.0, 5.4, 9.0, 20.0])
def test_response_of_windows(path_m: float) -> None:
    gated = changed(
        "hybrid",
        tof__pulse_width_s=10e-9,
        tof__rise_time_s=0.0,
        tof__windows=4,
        tof__gate_delay_s=12e-9,
    )
    given, _ = one_path(gated, path_m)
    spots = gated.tof.record(given, gated.spot_optics, None)
    expected = gated.tof.window_electrons(given)[0, 0]
    result = spots.electrons_per_joule * spots.response(np.array(path_m))
    pulse = spots.electrons_per_joule * spots.laser_energy_j
    np.testing.assert_allclose(result, expected, atol=1e-3 * pulse)
    # Of each pulse what falls into the gates, which are open from 12 ns to 52 ns.
    arrival_s = path_m / c
    inside = np.clip(arrival_s + 10e-9, 12e-9, 52e-9) - np.clip(arrival_s, 12e-9, 52e-9)
    assert result.sum() == pytest.approx(pulse * inside / 10e-9, abs=1e-6 * pulse)


@pytest.mark.parametrize("path_m", [2.0, 11.0])
def test_delay_of_histograms(path_m: float) -> None:
    photons = changed("fog-spad", tof__detector__sensor__afterpulse_probability=0.0)
    given, _ = one_path(photons, path_m)
    faint = replace(given, echo_per_s=1e-14 * given.echo_per_s)
    spots = photons.tof.record(faint, photons.spot_optics, None)
    counts = spots.counts[0, 0]
    middle = (counts * (np.arange(counts.size) + 0.5)).sum() / counts.sum()
    assert middle == pytest.approx(spots.delay(np.array(path_m)), abs=0.02)


def test_steady_light_is_in_every_reading_of_a_frequency_alike() -> None:
    fog = load_instrument("fog")
    given, _ = one_path(fog, 3.0)
    steady = replace(given, echo_per_s=0 * given.echo_per_s, steady_per_s=np.full((1, 4), 1e9))
    spots = fog.tof.record(steady, fog.spot_optics, None)
    electrons = spots.electrons(spots.taps[0, 0])
    shape = spots.steady
    fitted = shape @ np.linalg.lstsq(shape, electrons, rcond=None)[0]
    np.testing.assert_allclose(fitted, electrons, rtol=1e-9)
    assert np.ptp(electrons) > 0 or np.ptp(spots.periods / spots.tap_frequencies_hz) < 1e-9

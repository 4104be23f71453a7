"""The paper's instrument has the paper's numbers, and others what follows from theirs."""

from pathlib import Path

import numpy as np
import pytest
from scipy.constants import c, elementary_charge

from instruments import PAPER, load_text
from reconstruction.base.errors import InputError
from spisim.instrument import (
    Instrument,
    Spectrum,
    list_presets,
    load_instrument,
    quantum_efficiency,
)
from spisim.instrument.model import MAX_WAVELENGTH_NM, MIN_WAVELENGTH_NM
from spisim.scene.sun import daylight_spectrum


def contrast(instrument: Instrument) -> float:
    modulation, amplifier = instrument.tof.modulation, instrument.tof.detector.amplifier
    return modulation.demodulation_contrast(modulation.frequencies_hz[0], amplifier.response)


# What the paper says


def test_table_1(paper: Instrument) -> None:
    detector = paper.detector
    assert "paper" in list_presets()
    assert detector.sensor.photoactive_area_mm2 == 0.0707
    assert detector.f_number == 0.95
    assert detector.sensor.fill_factor == 0.35
    assert paper.projector.power_w == 6.4
    assert paper.projector.fov_deg == 20
    assert paper.filter.band_nm == (1544, 1556)


def test_every_value_of_the_preset_says_where_it_is_from() -> None:
    lines = [line for line in PAPER.splitlines() if line.strip() and not line.startswith("#")]
    silent = [
        line
        for i, line in enumerate(lines)
        if ":" in line
        and not line.rstrip().endswith(":")
        and "#" not in line
        and not (lines[i - 1].lstrip().startswith("#"))
    ]
    assert silent == []


def test_one_frame_shows_127_patterns_and_one_dark(paper: Instrument) -> None:
    plan = paper.pattern_plan
    assert plan.shape == (64, 64)
    assert plan.exposures == 128
    assert np.unique(plan.index).size == 127
    assert plan.exposures * paper.exposure_time_s == pytest.approx(8.53e-3, rel=1e-3)
    assert paper.tof.frame_time_s == pytest.approx(128 / paper.projector.pattern_rate_hz, rel=2e-3)


def test_ambiguity_is_the_paper_s_10_m(paper: Instrument) -> None:
    assert c / (2 * paper.tof.modulation.frequencies_hz[0]) == pytest.approx(10)


# What follows from it


def test_quantum_efficiency(paper: Instrument) -> None:
    efficiency = quantum_efficiency(paper.detector.sensor, paper.wavelength_nm)
    assert efficiency == pytest.approx(0.760, abs=5e-4)


def test_apertures_keep_the_etendue_of_the_photodiode(paper: Instrument) -> None:
    for detector in (paper.detector, paper.tof.detector):
        half_angle = np.radians(detector.field_of_view_deg / 2)
        etendue = np.pi * detector.aperture_area_m2 * np.sin(half_angle) ** 2
        assert etendue == pytest.approx(np.pi * 0.0707e-6 * 0.35 / (4 * 0.95**2))
    assert paper.detector.aperture_area_m2 == pytest.approx(9.02e-8, rel=1e-3)
    diameter = 2 * np.sqrt(paper.tof.detector.aperture_area_m2 / np.pi)
    assert diameter == pytest.approx(8.92e-3, rel=2e-3)


def test_daylight_on_a_white_wall_gives_the_known_rate(paper: Instrument) -> None:
    """1.085e11 electrons/s at 100 klx: τ ρ E A / (4 f#²) in the paper's Eq. (1)."""
    detector = paper.detector
    radiance = paper.daylight_irradiance(100) / np.pi
    half_angle = np.radians(detector.field_of_view_deg / 2)
    power = radiance * detector.aperture_area_m2 * np.pi * np.sin(half_angle) ** 2
    rate = power * paper.electrons_per_joule(detector, "daylight")
    assert rate == pytest.approx(1.085e11, rel=2e-3)


def test_amplifier_noise(paper: Instrument) -> None:
    assert paper.tof.detector.amplifier_noise_electrons(33e-9) == pytest.approx(1.6e3, rel=0.01)
    noise = paper.detector.amplifier_noise_electrons(paper.exposure_time_s)
    assert noise == pytest.approx(7.2e3, rel=0.01)
    assert noise > paper.detector.adc.quantisation_noise_electrons


def test_dark_current(paper: Instrument) -> None:
    assert paper.detector.dark_electrons(1.0) == pytest.approx(0.5e-9 / elementary_charge)


def test_adc_steps(paper: Instrument) -> None:
    adc = paper.detector.adc
    assert adc.max_count == 65535
    assert adc.electrons_per_count == pytest.approx(2e8 / 65536)
    assert adc.quantisation_noise_electrons == pytest.approx(adc.electrons_per_count / 12**0.5)


def test_bright_spot_at_1_m_in_full_sun_fits_the_tap_s_range(paper: Instrument) -> None:
    tof, detector = paper.tof, paper.tof.detector
    tap_time_s = tof.tap_time_s(tof.modulation.frequencies_hz[0])
    efficiency = paper.electrons_per_joule(detector, "laser") * tap_time_s
    spot = paper.lasers.power_w * detector.aperture_area_m2 / np.pi * efficiency
    half_angle = np.radians(detector.field_of_view_deg / 2)
    sun = paper.daylight_irradiance(100) * detector.aperture_area_m2 * np.sin(half_angle) ** 2
    # The patterns, half on, light the field's share of the projector's square.
    lit = np.pi * np.tan(half_angle) ** 2 / (4 * paper.projector.tan_half_width**2)
    patterns = paper.projector.power_w / 2 * lit / paper.lasers.power_w * spot
    highest = spot * (1 + contrast(paper)) + patterns + sun * efficiency
    highest += detector.dark_electrons(tap_time_s)
    headroom = detector.adc.headroom_electrons
    assert 0.7 * headroom < highest < headroom
    assert detector.adc.quantisation_noise_electrons < detector.amplifier_noise_electrons(
        tap_time_s
    )


def test_demodulation_contrast_of_a_quarter_period_tap(paper: Instrument) -> None:
    assert contrast(paper) == pytest.approx(np.sin(np.pi / 4) / (np.pi / 4))
    np.testing.assert_allclose(np.degrees(paper.tof.modulation.taps.phases_rad), [0, 90, 180, 270])


def test_laser_directions_are_right_and_up(paper: Instrument) -> None:
    directions = paper.lasers.directions
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1)
    upper_left = directions[0]
    assert upper_left[0] < 0  # x is to the right
    assert upper_left[1] < 0  # y is down
    x, _, z = directions[1]
    assert np.degrees(np.arctan2(x, z)) == pytest.approx(5)
    assert np.degrees(np.arcsin(-directions[1][1])) == pytest.approx(5)


def test_each_photodiode_sits_on_its_laser_s_side(paper: Instrument) -> None:
    positions = np.asarray(paper.tof.detector.positions_m)
    np.testing.assert_allclose(np.linalg.norm(positions, axis=1), 0.01, rtol=1e-3)
    assert (np.sign(positions[:, :2]) == np.sign(paper.lasers.directions[:, :2])).all()


def test_bucket_sees_the_corners_of_the_field_from_1_m_on(paper: Instrument) -> None:
    rows, columns = paper.projector.shape
    w = paper.projector.tan_half_width * (1 - 1 / columns)  # centres of the outermost pixels
    h = paper.projector.tan_half_height * (1 - 1 / rows)
    corners = np.array([[x, y, 1.0] for x in (-w, w) for y in (-h, h)])
    rays = corners - np.asarray(paper.detector.positions_m)
    angles = np.degrees(np.arccos(rays[:, 2] / np.linalg.norm(rays, axis=1)))
    assert angles.max() < paper.detector.field_of_view_deg / 2


def test_field_of_a_wide_pattern_has_square_pixels(paper: Instrument) -> None:
    wide = paper.projector.model_copy(update={"shape": (16, 64)})
    assert wide.tan_half_width == pytest.approx(np.tan(np.radians(10)))
    assert wide.tan_half_height == pytest.approx(wide.tan_half_width / 4)


# Other instruments


@pytest.mark.parametrize("name", list_presets())
def test_every_preset_loads_and_survives_its_own_text(name: str, tmp_path: Path) -> None:
    instrument = load_instrument(name)
    assert load_text(tmp_path, instrument.text) == instrument


def test_apertures_of_presets_are_lenses_that_exist() -> None:
    fga015 = load_instrument("fga015")
    assert fga015.detector.aperture_area_m2 == pytest.approx(np.pi * 0.0985e-3**2, rel=0.01)
    assert fga015.tof.detector.aperture_area_m2 == pytest.approx(np.pi * 4e-3**2, rel=0.01)


def test_led_in_the_band_by_its_spectrum() -> None:
    assert load_instrument("fga015").in_band_fraction == pytest.approx(0.1022, abs=1e-4)
    at_1460 = Spectrum(peak_nm=1460, fwhm_nm=110)
    assert at_1460.fraction_within((1544, 1556)) == pytest.approx(0.0161, abs=1e-4)


def test_apd_noise_and_primary_dark_current() -> None:
    sensor = load_instrument("apd").detector.sensor
    assert sensor.excess_noise_factor == pytest.approx(5.545)
    assert sensor.dark_rate_hz == pytest.approx(2e-9 / elementary_charge)


def test_responsivity_may_be_a_table(paper: Instrument, tmp_path: Path) -> None:
    table = "responsivity_a_per_w: [[1500, 0.9], [1550, 0.95], [1600, 1.0]]"
    tabled = load_text(tmp_path, PAPER.replace("responsivity_a_per_w: 0.95", table, 1))
    flat = paper.electrons_per_joule(paper.detector, "daylight")
    assert tabled.electrons_per_joule(tabled.detector, "daylight") == pytest.approx(flat, rel=1e-4)


# Another wavelength


@pytest.mark.parametrize("name", list_presets())
@pytest.mark.parametrize("wavelength_nm", [850, 905, 940, 1460, 1550])
def test_moved_to_another_wavelength(name: str, wavelength_nm: float) -> None:
    """Widths, powers and quantum efficiencies stay."""
    before = load_instrument(name)
    after = before.at_wavelength(wavelength_nm)
    assert after.wavelength_nm == wavelength_nm
    assert np.diff(after.filter.band_nm) == pytest.approx(np.diff(before.filter.band_nm))
    assert np.mean(after.filter.band_nm) - wavelength_nm == pytest.approx(
        np.mean(before.filter.band_nm) - before.wavelength_nm
    )
    if before.images:
        assert after.in_band_fraction == pytest.approx(before.in_band_fraction, rel=1e-12)
        np.testing.assert_allclose(after.pixel_powers_w, before.pixel_powers_w, rtol=1e-12)
    for part, old in before.detectors.items():
        assert quantum_efficiency(after.detectors[part].sensor, wavelength_nm) == pytest.approx(
            quantum_efficiency(old.sensor, before.wavelength_nm)
        )
    assert (after.lasers, after.zones) == (before.lasers, before.zones)


@pytest.mark.parametrize("name", list_presets())
def test_moved_to_where_it_is(name: str) -> None:
    instrument = load_instrument(name)
    assert instrument.at_wavelength(instrument.wavelength_nm) == instrument


def test_a_table_that_covers_the_new_band_holds(tmp_path: Path) -> None:
    table = "responsivity_a_per_w: [[840, 0.2], [1000, 0.4], [1550, 0.95], [1600, 1.0]]"
    tabled = load_text(tmp_path, PAPER.replace("responsivity_a_per_w: 0.95", table, 1))
    sensor = tabled.at_wavelength(905).detector.sensor
    assert sensor.electrons_per_joule(905) * elementary_charge == pytest.approx(0.28125)
    # where it does not, its value at the old wavelength is the measure
    sensor = tabled.at_wavelength(842).detector.sensor
    assert sensor.electrons_per_joule(842) * elementary_charge == pytest.approx(0.95 * 842 / 1550)


def test_only_so_far_as_daylight_is_known(paper: Instrument) -> None:
    with pytest.raises(InputError, match=r"instrument at 803 nm: .*filter.band_nm.*800 to 1600"):
        paper.at_wavelength(803)
    with pytest.raises(InputError, match=r"at 532 nm: wavelength_nm.*800 to 1600; found 532"):
        paper.at_wavelength(532)


def test_another_laser_power(paper: Instrument) -> None:
    stronger = paper.with_laser_power(9e-3)
    assert stronger.lasers.power_w == 9e-3
    assert stronger.with_laser_power(paper.lasers.power_w) == paper
    with pytest.raises(InputError, match=r"lasers\.power_w.*greater than 0"):
        paper.with_laser_power(0)


def test_aperture_and_f_number_are_two_words_for_one_lens(tmp_path: Path) -> None:
    paper = load_instrument("paper")
    area = paper.detector.aperture_area_m2
    aperture = f"aperture_diameter_mm: {2e3 * np.sqrt(area / np.pi)}"
    instrument = load_text(tmp_path, PAPER.replace("f_number: 0.95", aperture, 1))
    assert instrument.detector.aperture_area_m2 == pytest.approx(area)


def test_lens_larger_than_the_etendue_allows(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"detector:.*aperture_diameter_mm 25.*0\.644 mm"):
        load_text(tmp_path, PAPER.replace("f_number: 0.95", "aperture_diameter_mm: 25", 1))


def test_shared_photodiode_stands_for_all_spots(tmp_path: Path) -> None:
    head, tail = PAPER.split("    positions_m:\n      - [-0.00707", 1)
    one = head + "    positions_m:\n      - [0.01, 0, 0]\n" + tail.split("\n", 4)[4]
    instrument = load_text(tmp_path, one)
    assert instrument.ranging.shared
    np.testing.assert_array_equal(instrument.ranging.detector_positions_m, [[0.01, 0, 0]] * 4)
    paper = load_instrument("paper")
    assert instrument.ranging.frame_time_s == pytest.approx(4 * paper.tof.frame_time_s)


def test_leds_differ_as_they_should(paper: Instrument) -> None:
    array = paper.projector.model_copy(update={"nonuniformity": 0.05})
    fractions = array.pixel_fractions * 4096
    assert fractions.sum() == pytest.approx(4096)
    assert fractions.std() == pytest.approx(0.05, rel=0.05)
    other = array.model_copy(update={"nonuniformity_seed": 1})
    assert (
        abs(np.corrcoef(array.pixel_fractions.ravel(), other.pixel_fractions.ravel())[0, 1]) < 0.1
    )


def test_wavelengths_are_those_of_the_daylight_table() -> None:
    wavelengths_nm = daylight_spectrum()[0]
    assert (wavelengths_nm[0], wavelengths_nm[-1]) == (MIN_WAVELENGTH_NM, MAX_WAVELENGTH_NM)

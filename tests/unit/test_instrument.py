"""The paper's instrument has the paper's numbers; impossible instruments are refused."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.constants import c, elementary_charge

from reconstruction.errors import InputError
from spisim.instrument import Instrument, list_presets, load_instrument
from spisim.instrument.load import PRESETS

PAPER = (PRESETS / "paper.yaml").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def paper() -> Instrument:
    return load_instrument("paper")


def load_text(folder: Path, text: str) -> Instrument:
    path = folder / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    return load_instrument(path)


# What the paper says


def test_table_1(paper: Instrument) -> None:
    detector = paper.detector
    assert "paper" in list_presets()
    assert detector.photoactive_area_mm2 == 0.0707
    assert detector.f_number == 0.95
    assert detector.fill_factor == 0.35
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
    frame = paper.tof.periods / paper.tof.modulation_frequency_hz
    assert frame == pytest.approx(128 / paper.projector.pattern_rate_hz, rel=2e-3)


def test_ambiguity_is_the_paper_s_10_m(paper: Instrument) -> None:
    assert c / (2 * paper.tof.modulation_frequency_hz) == pytest.approx(10)


# What follows from it


def test_quantum_efficiency(paper: Instrument) -> None:
    assert paper.quantum_efficiency == pytest.approx(0.760, abs=5e-4)


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
    rate = power * detector.lens_transmittance * detector.electrons_per_joule
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
    efficiency = detector.lens_transmittance * detector.electrons_per_joule * tof.tap_time_s
    spot = paper.lasers.power_w * detector.aperture_area_m2 / np.pi * efficiency
    half_angle = np.radians(detector.field_of_view_deg / 2)
    sun = paper.daylight_irradiance(100) * detector.aperture_area_m2 * np.sin(half_angle) ** 2
    # The patterns, half on, light the field's share of the projector's square.
    lit = np.pi * np.tan(half_angle) ** 2 / (4 * paper.projector.tan_half_width**2)
    patterns = paper.projector.power_w / 2 * lit / paper.lasers.power_w * spot
    highest = spot * (1 + tof.demodulation_contrast) + patterns + sun * efficiency
    highest += detector.dark_electrons(tof.tap_time_s)
    headroom = detector.adc.full_scale_electrons - (
        detector.adc.offset_counts * detector.adc.electrons_per_count
    )
    assert 0.7 * headroom < highest < headroom
    assert detector.adc.quantisation_noise_electrons < detector.amplifier_noise_electrons(
        tof.tap_time_s
    )


def test_demodulation_contrast_of_a_quarter_period_tap(paper: Instrument) -> None:
    assert paper.tof.demodulation_contrast == pytest.approx(np.sin(np.pi / 4) / (np.pi / 4))
    np.testing.assert_allclose(np.degrees(paper.tof.tap_phases_rad), [0, 90, 180, 270])


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
    rays = corners - paper.detector.position_m
    angles = np.degrees(np.arccos(rays[:, 2] / np.linalg.norm(rays, axis=1)))
    assert angles.max() < paper.detector.field_of_view_deg / 2


def test_field_of_a_wide_pattern_has_square_pixels(paper: Instrument) -> None:
    wide = paper.projector.model_copy(update={"shape": (16, 64)})
    assert wide.tan_half_width == pytest.approx(np.tan(np.radians(10)))
    assert wide.tan_half_height == pytest.approx(wide.tan_half_width / 4)


# Files


def test_text_loads_as_the_same_instrument(paper: Instrument, tmp_path: Path) -> None:
    assert load_text(tmp_path, paper.text) == paper


def test_text_tells_of_changes(paper: Instrument) -> None:
    changed = paper.model_copy(update={"exposure_time_s": 1e-6})
    assert yaml.safe_load(changed.text)["exposure_time_s"] == 1e-6


def test_exposure_defaults_to_the_pattern_period_and_may_be_shorter(tmp_path: Path) -> None:
    assert load_text(tmp_path, PAPER).exposure_time_s == pytest.approx(1 / 15e3)
    assert load_text(tmp_path, PAPER + "exposure_time_s: 50.0e-6\n").exposure_time_s == 50e-6


@pytest.mark.parametrize(
    ("wrong", "parts"),
    [
        (("power_w: 6.4", "power_w: -6.4"), ["projector.power_w", "greater than 0", "-6.4"]),
        (("power_w: 6.4", "power_w: .nan"), ["projector.power_w", "finite"]),
        (("power_w: 6.4", "power: 6.4"), ["projector", "did you mean 'power_w'"]),
        (("power_w: 6.4", "power_w: on"), ["projector.power_w", "number", "True"]),
        (("fov_deg: 20", "fov_deg: 180"), ["projector.fov_deg", "less than 180"]),
        (("shape: [64, 64]", "shape: [64, 60]"), ["plan", "60"]),
        (("shape: [64, 64]", "shape: [64]"), ["projector.shape[1]", "missing"]),
        (("patterns: 127", "patterns: 5000"), ["plan", "5000"]),
        (("patterns: 127", "patterns: 0"), ["plan.patterns", "greater than 0"]),
        (("order: sequency-2d", "order: sequency2d"), ["plan", "sequency-2d"]),
        (("polarity: single-ended", "polarity: single"), ["plan.polarity", "single-ended"]),
        (
            ("polarity: single-ended", "polarity: signed"),
            ["plan.polarity", "formed by a recorder; choose differential or single-ended"],
        ),
        (("[1544, 1556]", "[1556, 1544]"), ["filter.band_nm", "1500 to 1600"]),
        (("[1544, 1556]", "[1520, 1530]"), ["wavelength_nm", "band_nm"]),
        (("wavelength_nm: 1550", "wavelength_nm: 905"), ["wavelength_nm", "1500", "905"]),
        (("f_number: 0.95", "f_number: 0"), ["detector.f_number", "greater than 0"]),
        (("fill_factor: 0.35", "fill_factor: 35"), ["detector.fill_factor", "35"]),
        (("responsivity_a_per_w: 0.95", "responsivity_a_per_w: 1.3"), ["electron per photon"]),
        (("bits: 16", "bits: 16.5"), ["detector.adc.bits", "16.5"]),
        (("    - [5, -5]\n", ""), ["lasers.directions_deg", "4"]),
        (("[5, -5]", "[5, -95]"), ["lasers.directions_deg[3][1]", "-95"]),
        (("tap_width: 0.25", "tap_width: 1.25"), ["tof.tap_width", "1.25"]),
        (("periods: 128000", "periods: many"), ["tof.periods", "'many'"]),
        (("pattern_rate_hz: 15.0e+3", "pattern_rate_hz: 0"), ["projector.pattern_rate_hz"]),
    ],
)
def test_mistake_in_a_field(tmp_path: Path, wrong: tuple[str, str], parts: list[str]) -> None:
    text = PAPER.replace(*wrong, 1)
    assert text != PAPER
    with pytest.raises(InputError) as caught:
        load_text(tmp_path, text)
    message = str(caught.value)
    for part in ["mine.yaml", *parts]:
        assert part in message
    assert len(message.splitlines()) == 1


def test_exposure_longer_than_a_pattern(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"exposure_time_s 0\.001.*pattern_rate_hz"):
        load_text(tmp_path, PAPER + "exposure_time_s: 1.0e-3\n")


def test_missing_part(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"mine\.yaml: tof: is missing"):
        load_text(tmp_path, PAPER.split("\ntof:")[0])


def test_unknown_preset_names_the_nearest() -> None:
    with pytest.raises(InputError, match=r"no instrument 'papre'.*did you mean 'paper'"):
        load_instrument("papre")

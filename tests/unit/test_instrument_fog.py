"""Instruments for fog: periods of each frequency, gates, and what the presets promise."""

import re

import numpy as np
import pytest
from scipy.constants import c

from fogs import seen
from instruments import changed
from reconstruction.base.errors import InputError
from spisim.budget.eye_safety import class_1_power_w, laser_safety
from spisim.instrument import load_instrument
from spisim.instrument.model import PRESETS

# Periods of each frequency


def test_each_frequency_has_its_own_time() -> None:
    tof = changed("fog", tof__periods=[1000, 8000, 64_000]).tof
    times_s = [1000 / 20e6, 8000 / 95e6, 64_000 / 220e6]
    assert tof.frame_time_s == pytest.approx(sum(times_s))
    for frequency_hz, time_s in zip(tof.modulation.frequencies_hz, times_s, strict=True):
        assert tof.light_time_s(frequency_hz) == pytest.approx(time_s)
        assert tof.tap_time_s(frequency_hz) == pytest.approx(tof.modulation.taps.fraction * time_s)


def test_one_number_of_periods_is_that_of_every_frequency() -> None:
    one, each = (changed("fog", tof__periods=periods).tof for periods in (9000, [9000] * 3))
    assert one.frame_time_s == pytest.approx(each.frame_time_s)
    assert one.frame_time_s == pytest.approx(9000 * (1 / 20e6 + 1 / 95e6 + 1 / 220e6))


def test_taps_and_photodiodes_in_turn_multiply_the_time() -> None:
    taps = {"shape": "rectangular", "width": 0.5, "arrangement": "in-turn"}
    plain = load_instrument("fog").tof.frame_time_s
    in_turn = changed("fog", tof__modulation__taps=taps)
    assert in_turn.tof.frame_time_s == pytest.approx(4 * plain)
    shared = changed("fog", tof__detector__positions_m=[[0.01, 0, 0]])
    assert shared.ranging.frame_time_s == pytest.approx(4 * plain)


@pytest.mark.parametrize(
    ("periods", "message"),
    [
        ([1000, 2000], "periods has 2 numbers for 3 modulation.frequencies_hz"),
        ([1000] * 4, "periods has 4 numbers for 3"),
        ([], "tof.periods"),
        ([1000, 0, 1000], "tof.periods"),
        ([1000, 1.5, 1000], "tof.periods"),
    ],
)
def test_wrong_periods_are_named(tmp_path, periods, message) -> None:
    text = (PRESETS / "fog.yaml").read_text(encoding="utf-8")
    mine = tmp_path / "mine.yaml"
    mine.write_text(re.sub(r"periods: \[.*?\]", f"periods: {periods}", text), encoding="utf-8")
    with pytest.raises(InputError, match=re.escape(message)):
        load_instrument(mine)


# Gates


def gated(**changes):
    return changed(
        "hybrid",
        **{"tof__pulse_width_s": 20e-9, "tof__windows": 5, "tof__gate_delay_s": 15e-9} | changes,
    )


def test_windows_follow_each_other_from_the_gate_s_delay_on() -> None:
    tof = gated().tof
    np.testing.assert_allclose(
        tof.window_starts_s, [-40e-9, 15e-9, 35e-9, 55e-9, 75e-9, 95e-9], rtol=1e-12
    )
    assert tof.unambiguous_range_m == pytest.approx(c * 95e-9 / 2)
    assert load_instrument("hybrid").tof.window_starts_s == pytest.approx((-130e-9, 0, 65e-9))


def test_budget_of_a_range_before_and_after_the_gates_is_infinite() -> None:
    """Between their starts it is that of the two windows that the echo falls into."""
    tof = gated().tof
    light = np.full(6, 1e12), np.full(6, 1e9)
    path_m = c * np.array([14e-9, 16e-9, 36e-9, 56e-9, 94e-9, 96e-9])
    sigma_m = tof.path_sigma_m(path_m, *light)
    assert np.isfinite(sigma_m).tolist() == [False, True, True, True, True, False]
    np.testing.assert_allclose(sigma_m[1:4], sigma_m[1])  # 1 ns after a window has opened


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"tof__windows": 1}, "greater than or equal to 2"),
        ({"tof__windows": 65}, "less than or equal to 64"),
        ({"tof__gate_delay_s": -1e-9}, "gate_delay_s"),
        ({"tof__gate_delay_s": 800e-9}, "leaves no room for 6 windows of 2e-08 s and a gap"),
    ],
)
def test_gates_that_cannot_be(changes, message) -> None:
    with pytest.raises(ValueError, match=re.escape(message)):
        gated(**changes)


# Presets


def test_fog_has_equal_times_that_fill_the_patterns() -> None:
    fog = load_instrument("fog")
    times_s = [fog.tof.light_time_s(each) for each in fog.tof.modulation.frequencies_hz]
    np.testing.assert_allclose(times_s, times_s[0], rtol=1e-12)
    patterns_s = fog.pattern_plan.exposures / fog.projector.pattern_rate_hz
    assert fog.tof.frame_time_s <= patterns_s
    assert fog.tof.frame_time_s == pytest.approx(patterns_s, rel=2e-3)
    assert fog.lasers.power_w == 10e-3
    assert fog.tof.detector.field_of_view_deg == 0.6


def test_no_white_wall_beyond_1_m_in_full_sun_saturates_the_taps_for_fog() -> None:
    """Half the patterns' light, the laser's at its peak and 100 klx of daylight."""
    fog = load_instrument("fog")
    tof, detector = fog.tof, fog.tof.detector
    half_angle = np.radians(detector.field_of_view_deg / 2)
    brightest = seen(fog, np.linspace(1, 10, 500))[0].max()
    for frequency_hz in tof.modulation.frequencies_hz:
        time_s = tof.tap_time_s(frequency_hz)
        contrast = tof.modulation.demodulation_contrast(frequency_hz, detector.amplifier.response)
        efficiency = fog.electrons_per_joule(detector, "laser") * time_s
        spot = fog.lasers.power_w * brightest / np.pi * efficiency
        irradiance = fog.daylight_irradiance(100)
        sun = irradiance * detector.aperture_area_m2 * np.sin(half_angle) ** 2 * efficiency
        lit = np.pi * np.tan(half_angle) ** 2 / (4 * fog.projector.tan_half_width**2)
        patterns = fog.projector.power_w / 2 * lit * detector.aperture_area_m2 / np.pi * efficiency
        highest = spot * (1 + contrast) + patterns + sun + detector.dark_electrons(time_s)
        headroom = detector.adc.headroom_electrons
        assert 0.2 * headroom < highest < headroom
        assert detector.adc.quantisation_noise_electrons < detector.amplifier_noise_electrons(
            tof.reading_at(frequency_hz).amplifier_s
        )


def test_etendue_of_the_narrow_field_is_that_of_the_photodiode() -> None:
    fog, paper = load_instrument("fog").tof.detector, load_instrument("paper").tof.detector

    def etendue(detector):
        return detector.aperture_area_m2 * np.sin(np.radians(detector.field_of_view_deg / 2)) ** 2

    assert etendue(fog) == pytest.approx(etendue(paper))
    assert 2e3 * np.sqrt(fog.aperture_area_m2 / np.pi) == pytest.approx(17.8, abs=0.1)


@pytest.mark.parametrize("name", ["fog", "fog-spad"])
def test_lasers_for_fog_are_of_class_1(name: str) -> None:
    instrument = load_instrument(name)
    assert laser_safety(instrument).laser_class == "1"
    assert class_1_power_w(instrument) >= instrument.lasers.power_w


def test_fog_takes_all_that_class_1_allows() -> None:
    fog = load_instrument("fog")
    assert laser_safety(fog.with_laser_power(1.02 * fog.lasers.power_w)).laser_class == "3R"


def test_spot_optics_are_those_of_the_instrument() -> None:
    fog = load_instrument("fog")
    optics = fog.spot_optics
    np.testing.assert_array_equal(optics.detector_axes, fog.lasers.directions)
    np.testing.assert_allclose(optics.half_fields_rad, np.radians(0.3))
    area = fog.tof.detector.aperture_area_m2
    np.testing.assert_allclose(np.pi * optics.aperture_radii_m**2, area)
    shared = changed("fog", tof__detector__positions_m=[[0.01, 0, 0]])
    np.testing.assert_array_equal(shared.spot_optics.detector_axes, [[0, 0, 1]] * 4)
    spad = load_instrument("fog-spad")
    assert spad.spot_optics.beam_divergence_rad == pytest.approx(0.5e-3)
    assert spad.spot_optics.beam_waist_m == pytest.approx(0.5e-3)

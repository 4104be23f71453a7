"""What does not fit together in an instrument is told before anything is built."""

from typing import Any

import pytest

from instruments import changed
from spisim.budget import Target, background_warnings, bucket_link, bucket_noise, budget_warnings
from spisim.instrument import Instrument, load_instrument

MODULATED = {"projector__modulation": {"frequencies_hz": [15e6]}}


def unfit(instrument: Instrument, target: Target) -> list[str]:
    """What does not fit, however little image there is."""
    return [each for each in budget_warnings(instrument, target) if "hardly an image" not in each]


@pytest.mark.parametrize(
    ("changes", "target", "parts"),
    [
        ({}, Target(12.0, 0.5), ["ambiguous", "12 m", "up to 10 m"]),
        (
            {"detector__adc__full_scale_electrons": 1e10},
            Target(0.8, 0.5),
            ["spots 0, 1, 2, 3", "field_of_view_deg"],
        ),
        (
            {"detector__adc__full_scale_electrons": 3e6},
            Target(5.0, 0.5, 100.0),
            ["detector.adc", "background alone", "every reading saturates"],
        ),
        (
            {"tof__detector__adc__full_scale_electrons": 1e8},
            Target(5.0, 0.5, 100.0),
            ["tof.detector.adc", "every reading saturates"],
        ),
        (
            {"detector__adc__full_scale_electrons": 4e6},
            Target(5.0, 0.5, 100.0),
            ["detector.adc", "signal and background together"],
        ),
        ({"eye_safety": {"risk_group": "1"}}, Target(5.0), ["risk group 2", "risk_group 1"]),
        (
            {"tof__modulation__taps__arrangement": "in-turn"},
            Target(5.0),
            ["the spots take 34.2 ms", "8.53 ms of a frame's patterns"],
        ),
    ],
)
def test_what_does_not_fit(changes: dict[str, Any], target: Target, parts: list[str]) -> None:
    (warning,) = unfit(changed("paper", **changes), target)
    for part in parts:
        assert part in warning


def test_an_ac_coupled_amplifier_lets_no_daylight_into_its_converter() -> None:
    ac = {"noise_pa_per_sqrt_hz": 0.2, "coupling": "ac", "low_cut_hz": 100.0}
    changes = {"detector__adc__full_scale_electrons": 3e6, "detector__amplifier": ac}
    assert budget_warnings(changed("paper", **changes), Target(5.0, 0.5, 100.0)) == []


def test_sun_on_single_photon_diodes() -> None:
    (warning,) = unfit(load_instrument("spad"), Target(5.0, 0.5, 100.0))
    assert "per gate" in warning
    without_patterns = changed("spad", projector__power_w=1e-3)
    assert unfit(without_patterns, Target(5.0, 0.5, 0.1)) == []


def test_presets_fit_a_wall_at_5_m_in_full_sun() -> None:
    for name in ("paper", "fga015", "apd", "hybrid"):
        assert unfit(load_instrument(name), Target(5.0, 0.5, 100.0)) == []


def test_background_that_overwhelms_a_detector_is_told_whatever_the_target_is() -> None:
    paper = changed("paper", detector__adc__full_scale_electrons=3e6)
    assert background_warnings(paper, 2e6, 1e9) == []
    (warning,) = background_warnings(paper, 4e6, 1e9)
    assert "detector.adc holds 2.99e+06 electrons, and the background alone is 4e+06" in warning
    (warning,) = background_warnings(paper, 2e6, 1e13)
    assert "tof.detector.adc" in warning
    modulated = changed("paper", **MODULATED, detector__adc__full_scale_electrons=3e6)
    assert background_warnings(modulated, 4e6, 1e9) == []  # each tap takes a quarter
    (warning,) = background_warnings(load_instrument("spad"), 1e5, 1e6)
    assert "0.08 times per gate" in warning


def test_taps_of_the_patterns_share_an_exposure_and_are_converted_one_by_one() -> None:
    target = Target(5.0, 0.5, 100.0)
    plain, modulated = load_instrument("paper"), changed("paper", **MODULATED)
    whole, taps = (
        bucket_noise(one, bucket_link(one, target)).variances for one in (plain, modulated)
    )
    assert taps["ADC"] == pytest.approx(4 * whole["ADC"])
    for source in ("signal", "daylight", "dark current", "amplifier"):
        assert taps[source] == pytest.approx(whole[source])

"""Laser classes and risk groups by the numbers of the standards."""

from typing import Any

import numpy as np
import pytest
import yaml

from spisim.budget import Target, array_risk_group, budget_warnings, laser_safety
from spisim.budget.eye_safety import accessible_energy_j, risk_group
from spisim.instrument import Instrument, load_instrument


def changed(name: str, **sections: dict[str, Any]) -> Instrument:
    """A preset whose sections have other fields."""
    fields = yaml.safe_load(load_instrument(name).text)
    for section, values in sections.items():
        fields[section] = fields.get(section, {}) | values
    return Instrument.model_validate(fields)


def test_limits_follow_from_the_exposure_limits() -> None:
    """10⁴ J/m² through 1 mm; through 1.5 t^0.375 mm; 1000 W/m² through 3.5 mm (9.6 mW)."""
    assert accessible_energy_j(65e-9) == pytest.approx(1e4 * np.pi * 0.5e-3**2, rel=0.02)
    aperture = 1.5e-3 * 4**0.375
    assert accessible_energy_j(4.0) == pytest.approx(1e4 * np.pi * aperture**2 / 4, rel=0.02)
    assert accessible_energy_j(100.0) / 100 == pytest.approx(1000 * np.pi * 1.75e-3**2, rel=0.05)
    assert accessible_energy_j(0.35) == pytest.approx(accessible_energy_j(0.3501), rel=0.03)
    assert accessible_energy_j(9.999) == pytest.approx(accessible_energy_j(10.01), rel=0.03)
    assert accessible_energy_j(0.1e-9) == pytest.approx(8e6 * 0.1e-9)


def test_5_mw_is_half_of_class_1() -> None:
    safety = laser_safety(load_instrument("paper"))
    assert safety.laser_class == "1"
    assert safety.beams == 1  # 17 mm apart, 10 cm away
    assert safety.mean_margin == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("power_w", "expected"), [(9e-3, "1"), (11e-3, "3R"), (51e-3, "3B"), (0.51, "4")]
)
def test_class_of_continuous_lasers(power_w: float, expected: str) -> None:
    assert laser_safety(changed("paper", lasers={"power_w": power_w})).laser_class == expected


def test_a_pulse_of_65_ns() -> None:
    safety = laser_safety(load_instrument("hybrid"))
    assert safety.pulse_j == pytest.approx(0.325e-9)
    assert safety.mean_w == pytest.approx(0.325e-9 * 1.2e6)
    assert safety.laser_class == "1"


@pytest.mark.parametrize(
    ("energy_j", "expected"), [(7e-3, "1"), (9e-3, "3R"), (50e-3, "3B"), (0.2, "4")]
)
def test_class_of_rare_strong_pulses(energy_j: float, expected: str) -> None:
    instrument = load_instrument("hybrid")
    tof = yaml.safe_load(instrument.text)["tof"] | {"repetition_rate_hz": 0.1}
    strong = changed("hybrid", lasers={"power_w": energy_j / 65e-9}, tof=tof)
    assert laser_safety(strong).laser_class == expected


def test_beams_that_meet_in_one_aperture_count_together() -> None:
    close = [[-0.5, 0.5], [0.5, 0.5], [-0.5, -0.5], [0.5, -0.5]]  # 1.7 mm apart, 10 cm away
    safety = laser_safety(changed("paper", lasers={"directions_deg": close}))
    assert safety.beams == 4
    assert safety.mean_w == pytest.approx(20e-3)
    assert safety.laser_class == "3R"


@pytest.mark.parametrize(
    ("power_w", "half_angle_deg", "irradiance", "expected"),
    [
        (6.4, 10, 1638, "2"),
        (6.4, 20, 384, "1"),
        (25.6, 10, 6552, "3"),
        (25.6, 20, 1538, "2"),
    ],
)
def test_risk_group_of_the_paper_s_arrays(
    power_w: float, half_angle_deg: float, irradiance: float, expected: str
) -> None:
    disc = np.pi * (0.2 * np.tan(np.radians(half_angle_deg))) ** 2
    assert round(power_w / disc) == irradiance
    assert risk_group(power_w / disc).risk_group == expected


def test_limits_of_risk_groups() -> None:
    edges = {99.0: "exempt", 101.0: "1", 568.0: "1", 570.0: "2", 3200.0: "2", 3202.0: "3"}
    assert {e: risk_group(e).risk_group for e in edges} == edges


def test_array_of_a_preset() -> None:
    """6.4 W over a square of 20°, all its wavelengths; the brightest LED counts."""
    square = (0.4 * np.tan(np.radians(10))) ** 2
    group = array_risk_group(load_instrument("paper"))
    assert group.irradiance_w_per_m2 == pytest.approx(6.4 / square)
    assert group.risk_group == "2"
    real = array_risk_group(load_instrument("fga015"))  # its LEDs differ by 5 % rms
    assert 1.1 * 6.4 / square < real.irradiance_w_per_m2 < 1.3 * 6.4 / square


def test_warned_of_above_the_declared_classes_only() -> None:
    strong = {"power_w": 40e-3}
    above = changed("paper", lasers=strong, eye_safety={"laser_class": "1", "risk_group": "2"})
    target = Target(5.0, 0.5)
    (warning,) = (w for w in budget_warnings(above, target) if "class" in w)
    assert "class 3R" in warning
    assert "laser_class 1" in warning
    declared = changed("paper", eye_safety={"laser_class": "1", "risk_group": "2"})
    assert budget_warnings(declared, target) == []

"""Laser classes and risk groups by the numbers of the standards."""

import numpy as np
import pytest

from instruments import changed
from reconstruction.base.errors import InputError
from spisim.budget import (
    Target,
    array_risk_group,
    budget_warnings,
    class_1_power_w,
    laser_safety,
)
from spisim.budget.eye_safety import (
    accessible_energy_j,
    repeated_pulse_factor,
    retinal_weight,
    risk_group,
)
from spisim.instrument import load_instrument


def test_limits_follow_from_the_exposure_limits() -> None:
    """10⁴ J/m² through 1 mm; through 1.5 t^0.375 mm; 1000 W/m² through 3.5 mm (9.6 mW)."""
    assert accessible_energy_j(65e-9, 1550) == pytest.approx(1e4 * np.pi * 0.5e-3**2, rel=0.02)
    aperture = 1.5e-3 * 4**0.375
    assert accessible_energy_j(4.0, 1550) == pytest.approx(1e4 * np.pi * aperture**2 / 4, rel=0.02)
    assert accessible_energy_j(100.0, 1550) / 100 == pytest.approx(
        1000 * np.pi * 1.75e-3**2, rel=0.05
    )
    assert accessible_energy_j(0.35, 1550) == pytest.approx(
        accessible_energy_j(0.3501, 1550), rel=0.03
    )
    assert accessible_energy_j(9.999, 1550) == pytest.approx(
        accessible_energy_j(10.01, 1550), rel=0.03
    )
    assert accessible_energy_j(0.1e-9, 1550) == pytest.approx(8e6 * 0.1e-9)


@pytest.mark.parametrize(
    ("wavelength_nm", "time_s", "expected_j"),
    [
        # C4 = 10^(0.002 (λ - 700)), so 1.995 at 850, 2.570 at 905, 3.020 at 940 nm, 5 from 1050
        (850, 1e-8, 7.7e-8 * 1.9953),
        (905, 1e-8, 7.7e-8 * 2.5704),
        (940, 1e-3, 7e-4 * 3.0200 * 1e-3**0.75),
        (905, 100.0, 3.9e-4 * 2.5704 * 100),
        (1064, 1e-8, 7.7e-7),
        (1064, 100.0, 3.9e-4 * 5 * 100),
        (1180, 1e-3, 3.5e-3 * 10**0.54 * 1e-3**0.75),
        (1310, 1e-8, 7.7e-7 * (8 + 10**2.4)),
        (1390, 100.0, 50.0),  # C7 is past all bounds there; that of class 3B remains
        (1460, 1e-8, 8e-4),
        (1460, 1.2e-3, 4.4e-3 * 1.2e-3**0.25),
        (1460, 0.1, 4.4e-3 * 0.1**0.25),
        (1460, 100.0, 1.0),
    ],
)
def test_class_1_at_other_wavelengths(
    wavelength_nm: float, time_s: float, expected_j: float
) -> None:
    result = accessible_energy_j(time_s, wavelength_nm)
    assert result == pytest.approx(expected_j, rel=1e-4, abs=0)


@pytest.mark.parametrize("wavelength_nm", [850, 940, 1064, 1180, 1310, 1460, 1550])
def test_limits_have_no_steps_and_never_fall(wavelength_nm: float) -> None:
    """The standard's own numbers fit each other within 6 %."""
    times = np.geomspace(1e-10, 3e4, 20_001)
    limits = np.array([accessible_energy_j(t, wavelength_nm) for t in times])
    assert (np.diff(limits) > -0.06 * limits[:-1]).all()
    assert (np.diff(limits) < 0.06 * limits[:-1]).all()


@pytest.mark.parametrize("wavelength_nm", [500, 699, 1801, float("nan")])
def test_no_limits_for_other_wavelengths(wavelength_nm: float) -> None:
    with pytest.raises(InputError, match="between 700 and 1800"):
        accessible_energy_j(1.0, wavelength_nm)


def test_trains_of_pulses_count_for_the_retina() -> None:
    """N pulses in 100 s leave 5 N^-¼ of a single one's limit from 600 on, but at least 0.4."""
    assert repeated_pulse_factor(5.9, 905) == 1
    assert repeated_pulse_factor(10, 905) == pytest.approx(5 * 1000**-0.25)
    assert repeated_pulse_factor(1e6, 905) == 0.4
    assert repeated_pulse_factor(1e6, 1550) == 1
    rare = load_instrument("hybrid").at_wavelength(905)  # 0.325 nJ in 65 ns, 1.2 MHz
    safety = laser_safety(rare)
    merged_j = 0.325e-9 * 1.2e6 * 5e-6  # the six of 5 µs
    assert safety.pulse_margin == pytest.approx(merged_j / (0.4 * 7.7e-8 * 10**0.41))
    assert safety.mean_margin == pytest.approx(0.325e-9 * 1.2e6 / (3.9e-4 * 10**0.41))


def test_the_same_lasers_are_safe_at_1550_nm_only() -> None:
    """5 mW: half of class 1 beyond 1400 nm, five times it and more below."""
    paper = load_instrument("paper")
    classes = {nm: laser_safety(paper.at_wavelength(nm)) for nm in (850, 905, 940, 1460, 1550)}
    assert {nm: one.laser_class for nm, one in classes.items()} == {
        850: "3B",
        905: "3R",
        940: "3R",
        1460: "1",
        1550: "1",
    }
    assert classes[905].mean_margin == pytest.approx(5e-3 / (3.9e-4 * 10**0.41))


@pytest.mark.parametrize("name", ["paper", "hybrid", "spad"])
@pytest.mark.parametrize("wavelength_nm", [850, 905, 940, 1460, 1550])
def test_as_strong_as_class_1_allows(name: str, wavelength_nm: float) -> None:
    moved = load_instrument(name).at_wavelength(wavelength_nm)
    limit_w = class_1_power_w(moved)
    safety = laser_safety(moved.with_laser_power(limit_w))
    assert safety.laser_class == "1"
    assert max(safety.mean_margin, safety.pulse_margin) == pytest.approx(1)
    assert laser_safety(moved.with_laser_power(1.001 * limit_w)).laser_class == "3R"


def test_a_pupil_takes_in_more_beams_than_the_aperture_for_corneas() -> None:
    near = [[-1.5, 1.5], [1.5, 1.5], [-1.5, -1.5], [1.5, -1.5]]  # 5.2 mm apart, 10 cm away
    paper = changed("paper", lasers__directions_deg=near)
    assert laser_safety(paper).beams == 1
    assert laser_safety(paper.at_wavelength(905)).beams == 2  # the diagonal is 7.4 mm


def test_5_mw_is_half_of_class_1() -> None:
    safety = laser_safety(load_instrument("paper"))
    assert safety.laser_class == "1"
    assert safety.beams == 1  # 17 mm apart, 10 cm away
    assert safety.mean_margin == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("power_w", "expected"), [(9e-3, "1"), (11e-3, "3R"), (51e-3, "3B"), (0.51, "4")]
)
def test_class_of_continuous_lasers(power_w: float, expected: str) -> None:
    assert laser_safety(changed("paper", lasers__power_w=power_w)).laser_class == expected


def test_a_pulse_of_65_ns() -> None:
    safety = laser_safety(load_instrument("hybrid"))
    assert safety.pulse_j == pytest.approx(0.325e-9)
    assert safety.mean_w == pytest.approx(0.325e-9 * 1.2e6)
    assert safety.laser_class == "1"


@pytest.mark.parametrize(
    ("energy_j", "expected"), [(7e-3, "1"), (9e-3, "3R"), (50e-3, "3B"), (0.2, "4")]
)
def test_class_of_rare_strong_pulses(energy_j: float, expected: str) -> None:
    strong = changed("hybrid", lasers__power_w=energy_j / 65e-9, tof__repetition_rate_hz=0.1)
    assert laser_safety(strong).laser_class == expected


def test_beams_that_meet_in_one_aperture_count_together() -> None:
    close = [[-0.5, 0.5], [0.5, 0.5], [-0.5, -0.5], [0.5, -0.5]]  # 1.7 mm apart, 10 cm away
    safety = laser_safety(changed("paper", lasers__directions_deg=close))
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


def test_retina_decides_below_1400_nm() -> None:
    """As a point: L = E / (π α²/4) with α = 11 mrad, R = 10^((700 - λ)/500), at most 6000/α."""
    limit = 6000 * np.pi / 4 * 0.011 / 10**-0.41  # 133 W/m² at 905 nm
    assert risk_group(0.99 * limit, 905).risk_group == "1"
    assert risk_group(1.01 * limit, 905).risk_group == "3"
    assert risk_group(1.01 * limit, 905).retinal_margin == pytest.approx(1.01)
    # a lens of 10 mm, 50 mrad, spreads the light on the retina
    assert risk_group(limit, 905, 0.01).retinal_margin == pytest.approx(0.011 / 0.05)
    assert risk_group(limit, 905, 1.0).retinal_margin == pytest.approx(0.011 / 0.1)
    assert risk_group(limit, 1550).retinal_margin == 0
    weights = {1049.9: 0.2, 1050: 0.2, 1150: 0.2, 1199.9: 0.02, 1300: 0.02}
    for wavelength_nm, weight in weights.items():
        assert retinal_weight(wavelength_nm) == pytest.approx(weight, rel=5e-3)


def test_array_of_a_preset() -> None:
    """6.4 W over a square of 20°, all its wavelengths; the brightest LED counts."""
    square = (0.4 * np.tan(np.radians(10))) ** 2
    group = array_risk_group(load_instrument("paper"))
    assert group.irradiance_w_per_m2 == pytest.approx(6.4 / square)
    assert group.risk_group == "2"
    real = array_risk_group(load_instrument("fga015"))  # its LEDs differ by 5 % rms
    assert 1.1 * 6.4 / square < real.irradiance_w_per_m2 < 1.3 * 6.4 / square


def test_warned_of_above_the_declared_classes_only() -> None:
    classes = {"laser_class": "1", "risk_group": "2"}
    above = changed("paper", lasers__power_w=40e-3, eye_safety=classes)
    target = Target(5.0, 0.5)
    (warning,) = (w for w in budget_warnings(above, target) if "class" in w)
    assert "class 3R" in warning
    assert "laser_class 1" in warning
    declared = changed("paper", eye_safety=classes)
    assert budget_warnings(declared, target) == []

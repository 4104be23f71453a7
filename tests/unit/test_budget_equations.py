"""The equations of the paper as closed forms: its tables, limits and misprint."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.constants import elementary_charge

from instruments import flood
from reconstruction.base.errors import InputError
from spisim.budget.equations import (
    common_integration_time_s,
    eq1,
    eq1_as_printed,
    eq2,
    integration_time_s,
    max_range_m,
)

GOALS = {0.2: 2.8, 0.5: 5.0, 0.8: 8.0}


@pytest.mark.parametrize(
    ("power_w", "half_angle_deg", "signal", "ratio"),
    [
        (6.4, 10, 2.40e12, 22.1),
        (6.4, 20, 5.63e11, 5.18),
        (25.6, 10, 9.59e12, 88.3),
        (25.6, 20, 2.25e12, 20.7),
    ],
)
def test_rates_of_table_1(
    power_w: float, half_angle_deg: float, signal: float, ratio: float
) -> None:
    light = flood(power_w, half_angle_deg)
    assert light.signal_per_s == pytest.approx(signal, rel=3e-3)
    assert light.background_per_s == pytest.approx(1.085e11, rel=2e-3)
    assert light.signal_per_s / light.background_per_s == pytest.approx(ratio, rel=3e-3)


def test_equation_1_as_printed_has_the_time_twice() -> None:
    light = flood(6.4, 10)
    assert eq1(light, 2e-6, 5.0, 0.5) == pytest.approx(2 * eq1(light, 1e-6, 5.0, 0.5))
    printed = eq1_as_printed(light, 2e-6, 5.0, 0.5)
    assert printed == pytest.approx(4 * eq1_as_printed(light, 1e-6, 5.0, 0.5))
    assert printed == pytest.approx(2e-6 * eq1(light, 2e-6, 5.0, 0.5))


def test_floor_of_equation_2() -> None:
    light = flood(6.4, 10)
    read = 2e-12 / elementary_charge * np.sqrt(33e-9 / 2)
    assert light.read_noise_electrons(33e-9) == pytest.approx(1.6e3, rel=0.01)
    shot = (0.5 * 1.085e11 + 0.5e-9 / elementary_charge) * 33e-9
    assert eq2(light, 33e-9, 0.5) == pytest.approx(np.hypot(read, np.sqrt(shot)), rel=1e-4)


def test_search_for_the_integration_time_ends_at_its_goal() -> None:
    light = flood(6.4, 10)
    for criterion in ("signal", "total"):
        time_s = integration_time_s(light, 0.2, 2.8, criterion)
        assert max_range_m(light, time_s, 0.2, criterion) == pytest.approx(2.8, rel=1e-5)
    assert integration_time_s(light, 0.2, 5.6, "signal") > integration_time_s(
        light, 0.2, 2.8, "signal"
    )


def test_signal_alone_reaches_with_the_root_of_the_reflectance() -> None:
    light = flood(6.4, 10)
    reach = max_range_m(
        light, common_integration_time_s(light, GOALS, "signal"), list(GOALS), "signal"
    )
    assert reach == pytest.approx([3.28, 5.19, 6.57], rel=2e-3)


def test_with_daylight_s_shot_noise_alone_it_reaches_with_the_fourth_root() -> None:
    light = replace(flood(6.4, 10, noise=0.0), dark_per_s=0.0)
    reach = max_range_m(
        light, common_integration_time_s(light, GOALS, "signal"), list(GOALS), "signal"
    )
    assert reach == pytest.approx([3.98, 5.00, 5.63], rel=2e-3)


@pytest.mark.parametrize(
    ("power_w", "half_angle_deg", "expected"),
    [
        (6.4, 20, [1.26, 2.73, 9.25]),
        (25.6, 20, [2.26, 4.50, 8.84]),
        (6.4, 10, [2.31, 4.57, 8.78]),
        (25.6, 10, [3.03, 5.22, 7.31]),
    ],
)
def test_daylight_taken_as_signal(
    power_w: float, half_angle_deg: float, expected: list[float]
) -> None:
    light = flood(power_w, half_angle_deg)
    reach = max_range_m(
        light, common_integration_time_s(light, GOALS, "total"), list(GOALS), "total"
    )
    assert reach == pytest.approx(expected, rel=5e-3)


def test_amplifier_for_integration_as_long_as_the_laser_s_pulse() -> None:
    light = flood(6.4, 10, noise=2.6e-12)
    assert common_integration_time_s(light, GOALS, "signal") == pytest.approx(66e-9, rel=0.03)


def test_no_integration_time_is_long_enough() -> None:
    light = replace(flood(6.4, 10), power_w=1e-9)
    with pytest.raises(InputError, match="1e-09 W to 8 m"):
        integration_time_s(light, 0.8, 8.0, "signal")

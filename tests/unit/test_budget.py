"""The closed forms against known numbers, and what the command says."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest
import yaml
from scipy.constants import c, elementary_charge
from scipy.special import ndtr
from typer.testing import CliRunner

from reconstruction.errors import InputError
from spisim.budget import (
    Target,
    background_warnings,
    bucket_link,
    bucket_noise,
    budget_warnings,
    longest_range_m,
    range_sigma_m,
    spot_link,
    spot_noise,
)
from spisim.budget.equations import Flood, eq1, eq1_as_printed, eq2, eq3, tap_factor
from spisim.budget.integration import common_integration_time_s, integration_time_s, reach_m
from spisim.cli import app
from spisim.instrument import Instrument, list_presets, load_instrument

GOALS = {0.2: 2.8, 0.5: 5.0, 0.8: 8.0}
MODULATED = {"projector__modulation": {"frequencies_hz": [15e6]}}


def changed(name: str, **changes: Any) -> Instrument:
    """A preset with other fields, told by their path: `tof__pulses=1000`."""
    fields = yaml.safe_load(load_instrument(name).text)
    for path, value in changes.items():
        *parents, last = path.split("__")
        section = fields
        for parent in parents:
            section = section[parent]
        section[last] = value
    return Instrument.model_validate(fields)


def flood(power_w: float, half_angle_deg: float, noise: float = 2e-12) -> Flood:
    return Flood.of(
        load_instrument("paper"),
        power_w=power_w,
        half_angle_deg=half_angle_deg,
        illuminance_klx=100,
        noise_a_per_sqrt_hz=noise,
    )


# Light


def test_daylight_on_a_white_wall_gives_the_known_rate() -> None:
    """τ ρ E A / (4 N²), whatever field and aperture the étendue makes of it."""
    paper = load_instrument("paper")
    link = bucket_link(paper, Target(7.0, 1.0, 100.0))
    assert link.daylight_electrons / paper.exposure_time_s == pytest.approx(1.085e11, rel=2e-3)


def test_square_of_light_on_a_wall() -> None:
    """ρ P A / (π z²) times the mean of cos⁴θ over the square, a atan(a) / t², a = t / √(1+t²)."""
    paper = changed("paper", detector__positions_m=[[0.0, 0.0, 0.0]])
    link = bucket_link(paper, Target(3.0, 0.4))
    t = np.tan(np.radians(10))
    a = t / np.sqrt(1 + t**2)
    mean_cos4 = a * np.arctan(a) / t**2
    area = paper.detector.aperture_area_m2
    assert link.signal_w == pytest.approx(6.4 * 0.4 * area * mean_cos4 / (np.pi * 9), rel=1e-5)
    assert link.irradiance_w_per_m2 == pytest.approx(6.4 / (2 * 3 * t) ** 2)


def test_several_photodiodes_add_up() -> None:
    one, both = (
        changed("paper", detector__positions_m=positions)
        for positions in ([[0.05, 0, 0]], [[0.05, 0, 0], [-0.05, 0, 0]])
    )
    single, double = (bucket_link(i, Target(4.0, 0.5, 50.0)) for i in (one, both))
    for name in ("signal_w", "daylight_w", "dark_electrons"):
        assert getattr(double, name) == pytest.approx(2 * getattr(single, name))


def test_spot_is_a_pencil_on_a_wall() -> None:
    """P ρ A cosθ_s cosθ_d / (π r²), from a photodiode beside the laser."""
    paper = load_instrument("paper")
    link = spot_link(paper, Target(4.0, 0.3))
    for k in range(4):
        direction = paper.lasers.directions[k]
        offset = 4.0 * direction / direction[2] - paper.tof.detector.positions_m[k]
        r = np.linalg.norm(offset)
        cosines = offset[2] / r * (offset @ direction) / r
        area = paper.tof.detector.aperture_area_m2
        assert link.echo_w[k] == pytest.approx(5e-3 * 0.3 * area * cosines / (np.pi * r**2))
        assert link.path_m[k] == pytest.approx(4.0 / direction[2] + r)


def test_patterns_light_the_spots_fields() -> None:
    """Half of the pixels on average: ρ E A sin²θ with E that of half the power."""
    paper = load_instrument("paper")
    link = spot_link(paper, Target(5.0, 0.5))
    lit = bucket_link(paper, Target(5.0, 0.5)).irradiance_w_per_m2 / 2
    sine2 = np.sin(np.radians(0.6)) ** 2
    expected = 0.5 * lit * paper.tof.detector.aperture_area_m2 * sine2
    assert link.patterns_w == pytest.approx(np.full(4, expected), rel=0.1)


def test_fog_takes_from_both_ways() -> None:
    paper = load_instrument("paper")
    clear, foggy = (spot_link(paper, Target(6.0, 0.5, 0.0, sigma)) for sigma in (0.0, 0.1))
    assert foggy.echo_w / clear.echo_w == pytest.approx(np.exp(-0.1 * clear.path_m))


def test_targets_broadcast() -> None:
    paper = load_instrument("paper")
    grid = Target(np.array([2.0, 4.0])[:, None], np.array([0.2, 0.5, 0.8]), 30.0)
    many = spot_noise(paper, spot_link(paper, grid))
    one = spot_noise(paper, spot_link(paper, Target(4.0, 0.8, 30.0)))
    assert many.snr.shape == (2, 3, 4)
    np.testing.assert_allclose(many.snr[1, 2], one.snr)
    assert bucket_noise(paper, bucket_link(paper, grid)).snr.shape == (2, 3)


# Noise


def test_twice_the_sun_is_twice_the_background_s_variance() -> None:
    paper = load_instrument("paper")
    dim, bright = (
        bucket_noise(paper, bucket_link(paper, Target(5.0, 0.5, klx))) for klx in (40.0, 80.0)
    )
    assert bright.variances["daylight"] == pytest.approx(2 * dim.variances["daylight"])
    for source in ("signal", "dark current", "amplifier", "ADC"):
        assert bright.variances[source] == dim.variances[source]


def test_avalanche_multiplies_shot_noise() -> None:
    apd = load_instrument("apd")
    link = bucket_link(apd, Target(5.0, 0.5, 100.0))
    noise = bucket_noise(apd, link)
    factor = apd.detector.sensor.excess_noise_factor
    assert noise.variances["daylight"] == pytest.approx(factor * link.daylight_electrons)
    assert noise.dominating[0] == "daylight"


def test_noise_of_the_paper_s_image_is_its_amplifier() -> None:
    paper = load_instrument("paper")
    noise = bucket_noise(paper, bucket_link(paper, Target(5.0, 0.5, 100.0)))
    source, share = noise.dominating
    amplifier = 0.2e-12 / elementary_charge * np.sqrt(paper.exposure_time_s / 2)
    assert source == "amplifier"
    assert share == pytest.approx(amplifier**2 / noise.total_electrons**2)


# Ranging


def test_equation_3_is_the_four_phase_formula_in_other_variables() -> None:
    """A_R of a period at the light's peak, B of a period, N periods."""
    paper = changed("paper", tof__detector__adc__bits=31)
    target = Target(4.0, 0.5, 80.0)
    link, frequency = spot_link(paper, target), paper.tof.modulation.frequencies_hz[0]
    tap_noise = paper.tof.detector.amplifier_noise_electrons(0.25 / frequency)
    expected = eq3(
        c / (2 * frequency),
        2 * link.echo_per_s / frequency,
        link.steady_per_s / frequency,
        paper.tof.periods,
        0.25,
        tap_noise=tap_noise,
    )
    sigma = range_sigma_m(paper, target)
    assert sigma == pytest.approx(expected * 2 * link.range_per_path, rel=1e-4)


def test_constants_of_equation_3() -> None:
    assert tap_factor(0.25) == pytest.approx(0.4502, abs=5e-5)
    assert tap_factor(0.5) == pytest.approx(tap_factor(0.25))
    widths = np.linspace(0.05, 0.95, 901)
    factors = [tap_factor(x) for x in widths]
    assert max(factors) == pytest.approx(0.4803, abs=5e-5)
    assert widths[np.argmax(factors)] == pytest.approx(0.371, abs=1e-3)
    assert eq3(10.0, 12.5, 0.0, 1e4, 0.25) == pytest.approx(0.01, rel=2e-3)  # A_R N = 1.25e5


def test_pulses_by_hand() -> None:
    hybrid = load_instrument("hybrid")
    target = Target(4.0, 0.5, 50.0)
    link, tof = spot_link(hybrid, target), hybrid.tof
    time_s = tof.pulses * tof.pulse_width_s
    signal = link.echo_per_s * time_s
    window = link.steady_per_s * time_s + tof.detector.electronics_noise_electrons(time_s) ** 2
    r = link.path_m / (c * tof.pulse_width_s)
    weight = (1 - r) ** 2 + r**2 + (1 - 2 * r) ** 2
    path = c * tof.pulse_width_s * np.sqrt(r * (1 - r) / signal + window * weight / signal**2)
    assert range_sigma_m(hybrid, target) == pytest.approx(path * link.range_per_path)


@pytest.mark.parametrize("illuminance_klx", [0.0, 2.0, 40.0])
def test_first_photons_have_the_information_of_their_bins(illuminance_klx: float) -> None:
    """1/σ² = N Σ exp(-Σ_{j<i} λ_j) λ'_i² / (e^{λ_i} - 1)."""
    spad = changed("spad", tof__detector__sensor__afterpulse_probability=0.0)
    target = Target(3.0, 0.5, illuminance_klx)
    link, tof = spot_link(spad, target), spad.tof
    delay_s, step_s = link.path_m[0] / c, 1e-13
    per_pulse = link.echo_per_s[0] * tof.pulse_sigma_s * np.sqrt(2 * np.pi)

    def rates(delay_s: float) -> np.ndarray:
        edges = (np.arange(tof.bins + 1) * tof.bin_width_s - delay_s) / tof.response_sigma_s
        return per_pulse * np.diff(ndtr(edges)) + link.steady_per_s[0] * tof.bin_width_s

    mean = rates(delay_s)
    slope = (rates(delay_s + step_s) - rates(delay_s - step_s)) / (2 * step_s)
    watched = tof.pulses * np.exp(-np.concatenate([[0.0], np.cumsum(mean)[:-1]]))
    lit = mean > 0  # without background no bin but the echo's has any
    information = (watched * slope**2)[lit] / np.expm1(mean[lit])
    expected = c / np.sqrt(information.sum()) * link.range_per_path[0]
    assert range_sigma_m(spad, target)[0] == pytest.approx(expected, rel=0.01)


def test_more_precise_with_two_frequencies() -> None:
    """Each is a measurement of its own; the ambiguity is that of their common divisor."""
    one, other, both = (
        changed("paper", tof__modulation__frequencies_hz=frequencies)
        for frequencies in ([10e6], [15e6], [10e6, 15e6])
    )
    target = Target(3.0, 0.5)
    single = [range_sigma_m(instrument, target) for instrument in (one, other)]
    assert range_sigma_m(both, target) == pytest.approx(sum(s**-2 for s in single) ** -0.5)
    assert np.isinf(range_sigma_m(one, Target(20.0, 0.5))).all()
    assert np.isfinite(range_sigma_m(both, Target(20.0, 0.5))).all()


def test_no_range_beyond_the_ambiguity_nor_where_the_photodiode_does_not_look() -> None:
    paper = load_instrument("paper")
    sigma = range_sigma_m(paper, Target(np.array([0.3, 5.0, 12.0]), 0.5))
    assert np.isinf(sigma[[0, 2]]).all()
    assert np.isfinite(sigma[1]).all()


@pytest.mark.parametrize(
    ("name", "limit_m"),
    [("paper", 0.02), ("fga015", 0.02), ("apd", 0.005), ("spad", 0.02), ("hybrid", 0.02)],
)
def test_at_the_longest_range_the_scatter_is_the_limit(name: str, limit_m: float) -> None:
    instrument = load_instrument(name)
    longest = float(longest_range_m(instrument, limit_m, reflectance=0.8, illuminance_klx=10.0))
    assert longest > 1
    sigma = range_sigma_m(instrument, Target(longest, 0.8, 10.0)).max()
    assert sigma == pytest.approx(limit_m, rel=1e-3)


def test_no_longest_range_where_all_are_worse() -> None:
    assert longest_range_m(load_instrument("hybrid"), 1e-5) == 0


# The paper's equations


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
        assert reach_m(light, time_s, 0.2, criterion) == pytest.approx(2.8, rel=1e-5)
    assert integration_time_s(light, 0.2, 5.6, "signal") > integration_time_s(
        light, 0.2, 2.8, "signal"
    )


def test_signal_alone_reaches_with_the_root_of_the_reflectance() -> None:
    light = flood(6.4, 10)
    reach = reach_m(light, common_integration_time_s(light, GOALS, "signal"), list(GOALS), "signal")
    assert reach == pytest.approx([3.28, 5.19, 6.57], rel=2e-3)


def test_with_daylight_s_shot_noise_alone_it_reaches_with_the_fourth_root() -> None:
    light = replace(flood(6.4, 10, noise=0.0), dark_per_s=0.0)
    reach = reach_m(light, common_integration_time_s(light, GOALS, "signal"), list(GOALS), "signal")
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
    reach = reach_m(light, common_integration_time_s(light, GOALS, "total"), list(GOALS), "total")
    assert reach == pytest.approx(expected, rel=5e-3)


def test_amplifier_for_integration_as_long_as_the_laser_s_pulse() -> None:
    light = flood(6.4, 10, noise=2.6e-12)
    assert common_integration_time_s(light, GOALS, "signal") == pytest.approx(66e-9, rel=0.03)


def test_no_integration_time_is_long_enough() -> None:
    light = replace(flood(6.4, 10), power_w=1e-9)
    with pytest.raises(InputError, match="1e-09 W to 8 m"):
        integration_time_s(light, 0.8, 8.0, "signal")


# Warnings


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
    (warning,) = budget_warnings(changed("paper", **changes), target)
    for part in parts:
        assert part in warning


def test_an_ac_coupled_amplifier_lets_no_daylight_into_its_converter() -> None:
    ac = {"noise_pa_per_sqrt_hz": 0.2, "coupling": "ac", "low_cut_hz": 100.0}
    changes = {"detector__adc__full_scale_electrons": 3e6, "detector__amplifier": ac}
    assert budget_warnings(changed("paper", **changes), Target(5.0, 0.5, 100.0)) == []


def test_sun_on_single_photon_diodes() -> None:
    (warning,) = budget_warnings(load_instrument("spad"), Target(5.0, 0.5, 100.0))
    assert "per gate" in warning
    without_patterns = changed("spad", projector__power_w=1e-3)
    assert budget_warnings(without_patterns, Target(5.0, 0.5, 0.1)) == []


def test_presets_fit_a_wall_at_5_m_in_full_sun() -> None:
    for name in ("paper", "fga015", "apd", "hybrid"):
        assert budget_warnings(load_instrument(name), Target(5.0, 0.5, 100.0)) == []


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


# The command


def spisim(*arguments: str | Path) -> Any:
    return CliRunner().invoke(app, list(map(str, arguments)), env={"COLUMNS": "100"})


def test_budget_prints_what_dominates() -> None:
    run = spisim("budget", "apd")
    assert run.exit_code == 0, run.stderr
    assert "Image: the noise of the daylight dominates" in run.stdout
    assert "class 1" in run.stdout
    assert "no certification" in run.stdout


def test_budget_as_json() -> None:
    run = spisim("budget", "fga015", "--visibility", "50", "--range", 4, "--json")
    assert run.exit_code == 0, run.stderr
    report = json.loads(run.stdout)
    sigma = range_sigma_m(load_instrument("fga015"), Target(**report["target"])).max()
    assert report["target"]["extinction_per_m"] == pytest.approx(3.912 / 50 * 1.1416, rel=1e-3)
    assert report["range"]["sigma_m"] == pytest.approx(sigma)
    assert report["image"]["dominating"]["source"] == "amplifier"
    assert report["warnings"] == []


@pytest.mark.slow
@pytest.mark.parametrize("name", list_presets())
def test_budget_draws_a_picture(name: str, tmp_path: Path) -> None:
    picture = tmp_path / "budget.png"
    run = spisim("budget", name, "-o", picture)
    assert run.exit_code == 0, run.stderr
    assert matplotlib.image.imread(picture).shape[1] > 1000


def test_budget_warns() -> None:
    run = spisim("budget", "paper", "--range", "12")
    assert run.exit_code == 0
    assert "warning: ranges at 12 m are ambiguous" in run.stderr


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["papre"], ["no instrument 'papre'", "did you mean 'paper'"]),
        (["missing.yaml"], ["missing.yaml", "no such file"]),
        (["--range", "-1"], ["--range"]),
        (["--reflectance", "1.5"], ["--reflectance"]),
        (["--illuminance", "-5"], ["--illuminance"]),
        (["--range", "nan"], ["--range"]),
        (["--visibility", "0"], ["visibility_m", "greater than 0"]),
        (["-o", "."], ["folder"]),
    ],
)
def test_mistakes_of_the_command_line(arguments: list[str], parts: list[str]) -> None:
    run = spisim("budget", *arguments)
    assert run.exit_code == 2
    assert run.stdout == ""
    for part in parts:
        assert part in run.stderr

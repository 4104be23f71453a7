"""Light, noise and ranging in closed form, against known numbers."""

import numpy as np
import pytest
from scipy.constants import c, elementary_charge
from scipy.special import ndtr

from instruments import changed
from spisim.budget import (
    Target,
    bucket_link,
    bucket_noise,
    longest_range_m,
    range_sigma_m,
    spot_link,
    spot_noise,
)
from spisim.budget.equations import eq3, tap_factor
from spisim.instrument import load_instrument

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
    source, fraction = noise.dominating
    amplifier = 0.2e-12 / elementary_charge * np.sqrt(paper.exposure_time_s / 2)
    assert source == "amplifier"
    assert fraction == pytest.approx(amplifier**2 / noise.total_electrons**2)


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
        edges = (
            np.arange(tof.bins + 1) * tof.bin_width_s - delay_s
        ) / tof.stamping.response_sigma_s
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

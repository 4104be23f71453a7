"""Spectra of droplets and drops from files, and what their counts leave unsure."""

import math

import numpy as np
import pytest

from reconstruction.base.errors import InputError
from spisim.atmosphere import Particles, fog, rain
from spisim.atmosphere.lookup import look_up_classes
from spisim.atmosphere.rain import RAINS, MeasuredDrops
from spisim.atmosphere.rain_table import EDGES_MM
from spisim.atmosphere.sections.fog import Fog
from spisim.atmosphere.sections.rain import Rain
from spisim.atmosphere.spectrum import SpectrumSizes, read_droplets, read_drops

DIAMETERS_UM = (2.0, 4.0, 8.0, 16.0)
COUNTS = (100.0, 400.0, 200.0, 25.0)


@pytest.fixture
def save(tmp_path):
    def write(first, rows, name="own.csv"):
        lines = [first, *(",".join(f"{value:.9g}" for value in row) for row in rows)]
        path = tmp_path / name
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path

    return write


def own(save, column="counts", numbers=COUNTS, diameters=DIAMETERS_UM, unit="um"):
    return save(f"diameter_{unit},{column}", zip(diameters, numbers, strict=True))


# Sizes


def test_moments_are_those_of_the_density():
    sizes = SpectrumSizes((1.0, 3.0, 5.0, 12.0), (2.0, 5.0, 1.0))
    radius = np.linspace(0.4, 6.1, 200_001)
    density = sizes.density(radius)
    for power in (0, 2, 3, 5.5):
        integral = np.trapezoid(density * radius**power, radius)
        assert sizes.moment(power) == pytest.approx(integral, rel=1e-4)
    assert sizes.radius_range_um() == (0.5, 6.0)


def test_columns_of_every_unit_give_the_same_numbers(save):
    by_counts = read_droplets(own(save), sampled_cm3=10.0)
    numbers = np.array(COUNTS) / 10
    width_um = np.diff(by_counts.edges_um)
    for column, values in (
        ("number_per_cm3", numbers),
        ("number_per_m3", 1e6 * numbers),
        ("number_per_cm3_um", numbers / width_um),
        ("number_per_m3_mm", 1e9 * numbers / width_um),
    ):
        result = read_droplets(own(save, column, values), sampled_cm3=10.0)
        assert result.numbers == pytest.approx(by_counts.numbers, rel=1e-6)
        assert result.counts == pytest.approx(COUNTS, rel=1e-6)
        assert result.absolute
    in_mm = read_droplets(own(save, diameters=np.array(DIAMETERS_UM) / 1e3, unit="mm"), 10.0)
    assert in_mm.edges_um == pytest.approx(by_counts.edges_um)
    assert by_counts.edges_um == pytest.approx(2 * 2.0 ** np.arange(-0.5, 4))


def test_counts_alone_tell_no_number(save):
    sizes = read_droplets(own(save))
    assert sizes.number_per_cm3 is None
    assert sizes.sigma == pytest.approx(np.sqrt(COUNTS))
    assert read_droplets(own(save, "number_per_cm3")).sigma is None


# Media


def test_a_narrow_spectrum_is_its_droplets():
    narrow = Particles(SpectrumSizes((9.99, 10.01), (1.0,)))
    wide = Particles(SpectrumSizes((9.9, 10.0, 10.1), (1.0, 1.0)))
    first, second = (fog(50, each) for each in (narrow, wide))
    assert first.extinction_per_m == pytest.approx(second.extinction_per_m, rel=0.01)
    assert first.uncertainty is None


def test_a_spectrum_has_its_own_visibility(save):
    section = Fog(droplets={"spectrum": own(save).name, "sampled_cm3": 5.0})
    medium = section.made(own(save).parent, 1550.0)
    particles = Particles(read_droplets(own(save), 5.0))
    per_cm3 = np.array(COUNTS) / 5
    extinction = 1e6 * per_cm3 @ look_up_classes(particles, 1550.0)["extinction_m2"]
    assert medium.extinction_per_m == pytest.approx(extinction, rel=2e-3)
    assert medium.visibility_m is not None
    again = fog(medium.visibility_m, particles)
    assert again.extinction_per_m == pytest.approx(medium.extinction_per_m)


def test_poisson_counts_leave_as_much_unsure_as_repeated_draws(save):
    particles = Particles(read_droplets(own(save), 5.0))
    here, visual = (look_up_classes(particles, nm) for nm in (1550.0, 550.0))
    by_number, by_visibility = fog(None, particles), fog(50, particles)
    drawn = np.random.default_rng(1).poisson(COUNTS, (20_000, len(COUNTS)))
    extinction = drawn @ here["extinction_m2"]
    ratio = extinction / (drawn @ visual["extinction_m2"])
    scattering = drawn @ here["scattering_m2"]
    phase = drawn @ here["per_steradian_m2"] / scattering[:, None]
    for sigma, values in (
        (by_number.uncertainty.extinction, extinction / extinction.mean()),
        (by_visibility.uncertainty.extinction, ratio / ratio.mean()),
        (by_number.uncertainty.albedo, scattering / extinction),
        (by_number.uncertainty.g, drawn @ here["forward_m2"] / scattering),
        (by_number.uncertainty.backscatter, phase[:, -1] / phase[:, -1].mean()),
    ):
        assert sigma == pytest.approx(values.std(), rel=0.05)
    relative = phase.std(axis=0) / phase.mean(axis=0)
    assert by_number.uncertainty.phase == pytest.approx(relative, rel=0.08)
    assert by_visibility.uncertainty.extinction < by_number.uncertainty.extinction / 5
    assert by_number.summary()["extinction_relative_sigma"] == by_number.uncertainty.extinction
    assert "extinction_relative_sigma" not in fog(50, "haze-m").summary()


def test_four_times_the_counts_halve_the_sigma(save):
    once = fog(None, Particles(read_droplets(own(save), 5.0)))
    four = own(save, numbers=4 * np.array(COUNTS))
    often = fog(None, Particles(read_droplets(four, 20.0)))
    assert often.extinction_per_m == pytest.approx(once.extinction_per_m)
    assert often.uncertainty.extinction == pytest.approx(once.uncertainty.extinction / 2)


def test_an_exponential_spectrum_of_drops_is_the_rain_of_its_kind(save):
    diameter = np.sqrt(EDGES_MM[:-1] * EDGES_MM[1:])
    numbers = RAINS["marshall-palmer"].moments(10.0, 0)
    path = save("diameter_mm,number_per_m3", zip(diameter, numbers, strict=True))
    medium = Rain(rate_mm_per_h=10, spectrum=path.name).made(path.parent, 1550.0)
    usual = rain(10.0)
    assert medium.extinction_per_m == pytest.approx(usual.extinction_per_m, rel=0.15)
    assert medium.albedo == pytest.approx(usual.albedo, abs=0.01)
    assert medium.uncertainty is None


def test_single_drops_of_a_disdrometer_are_counted_in_the_air_that_they_fell_through(save):
    rng = np.random.default_rng(0)
    diameter = rng.uniform(1.0, 3.0, 2000)
    time_s = np.linspace(0, 100, 2000)
    rows = np.column_stack([time_s, diameter, np.full(2000, 5.0), np.full(2000, 1e4)])
    path = save("time_s,diameter_mm,fall_speed_m_s,measuring_area_mm2", rows)
    sizes = read_drops(path)
    assert 1e6 * sizes.number_per_cm3 == pytest.approx(2000 / (1e-2 * 5 * 100))
    assert math.fsum(sizes.counts) == pytest.approx(2000)
    medium = rain(5.0, MeasuredDrops(sizes))
    assert 0 < medium.uncertainty.extinction < 0.02
    falling = MeasuredDrops(sizes)
    assert falling.moments(5.0, 2) == pytest.approx(falling.moments(10.0, 2) / 2)


# Mistakes


@pytest.mark.parametrize(
    ("column", "numbers", "diameters", "parts"),
    [
        ("counts", (1, -2, 3), (2, 4, 8), ["counts of class 2 (diameter_um 4)", "found -2"]),
        ("counts", (1, 2, 3), (2, 8, 4), ["should rise", "class 3 has 4 after 8"]),
        ("counts", (1, 2, 3), (2, 2, 4), ["should rise", "class 2 has 2 after 2"]),
        ("counts", (1, 2, 3), (0, 2, 4), ["from above 0", "class 1 has 0"]),
        ("counts", (0, 0, 0), (2, 4, 8), ["counts is 0 in all classes"]),
        ("counts", (1, 2, 3), (0.002, 0.004, 0.008), ["0.008", "a thousandth", "10³"]),
        ("counts", (1, 2, 3), (2e3, 4e3, 8e3), ["8000", "a thousand times", "10³"]),
        ("number_per_cm3", (1e5, 2e5, 1e5), (20, 40, 80), ["g of liquid", "per litre", "10³"]),
        ("number", (1, 2, 3), (2, 4, 8), ["first line", "number_per_cm3"]),
        ("counts", (1,), (2,), ["two classes"]),
    ],
)
def test_mistakes_in_a_spectrum_are_named(save, column, numbers, diameters, parts):
    path = own(save, column, numbers, diameters)
    with pytest.raises(InputError) as caught:
        read_droplets(path)
    for part in ("own.csv", *parts):
        assert part in str(caught.value)


def test_mistakes_in_drops_are_named(save):
    first = "time_s,diameter_mm,fall_speed_m_s,measuring_area_mm2"
    for rows, part in (
        ([(0, 1, 4, 1e4), (1, 2, -6, 1e4)], "fall_speed_m_s of drop 2"),
        ([(0, 1, 4, 1e4), (0, 2, 6, 1e4)], "time_s"),
        ([(0, 1e3, 4, 1e4), (1, 2e3, 6, 1e4)], "a thousand times"),
    ):
        with pytest.raises(InputError, match=part):
            read_drops(save(first, rows))
    with pytest.raises(InputError, match="first line"):
        read_drops(save("2,3", [(4, 5)]))


def test_counts_without_the_air_that_they_are_from_need_a_visibility(save):
    path = own(save)
    section = Fog(droplets={"spectrum": path.name})
    with pytest.raises(InputError, match="sampled_cm3"):
        section.made(path.parent, 1550.0)
    assert Fog(visibility_m=50, droplets={"spectrum": path.name}).made(path.parent, 1550.0)


@pytest.mark.parametrize(
    ("section", "part"),
    [
        (lambda: Rain(rate_mm_per_h=5, spectrum="a.csv", kind="joss-drizzle"), "not both"),
        (lambda: Rain(rate_mm_per_h=5, spectrum="a.csv", model="drops"), "does not go with"),
        (lambda: Fog(droplets={"spectrum": "a.csv", "sigma_g": 1.4}), "needs alpha"),
        (lambda: Fog(visibility_m=9, droplets={"sampled_cm3": 2}), "needs alpha"),
        (lambda: Fog(droplets={"median_diameter_um": 2, "sigma_g": 1.4}), "visibility_m"),
    ],
)
def test_a_spectrum_goes_with_certain_fields(section, part):
    with pytest.raises(ValueError, match=part):
        section()

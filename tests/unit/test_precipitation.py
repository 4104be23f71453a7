"""Rain and snow as single drops: sizes, speeds, optics, and where the drops are."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import spisim
import worlds
from reconstruction.base.errors import InputError
from spisim.atmosphere import RAINS, refractive_index
from spisim.atmosphere import rain as rain_medium
from spisim.atmosphere import snow as snow_medium
from spisim.atmosphere.drop_optics import flakes, water_drops
from spisim.atmosphere.fall_speed import terminal_speed_m_s
from spisim.atmosphere.precipitation import rain, snow
from spisim.atmosphere.sections.rain import Rain
from spisim.atmosphere.snow import flake_albedo
from spisim.budget.wavelengths import WAVELENGTHS_NM
from spisim.simulation.drops import drop_field


@pytest.fixture(scope="module")
def paper():
    return spisim.load_instrument("paper")


@pytest.mark.parametrize(
    ("diameter_mm", "speed_m_s"), [(1.0, 4.03), (2.0, 6.49), (3.0, 8.06), (5.0, 9.09)]
)
def test_drops_fall_as_gunn_and_kinzer_measured(diameter_mm, speed_m_s):
    # Gunn & Kinzer, J. Meteorol. 6, 243 (1949), which the formula was fitted to within 2 %.
    assert terminal_speed_m_s(np.array(diameter_mm)) == pytest.approx(speed_m_s, rel=0.025)


def test_drops_fall_faster_in_thinner_air():
    thin = Rain(rate_mm_per_h=5, model="drops", air_density_kg_m3=1.1).made(Path(), 1550.0)
    diameter = np.array([0.7, 1.5, 4.0])
    ratio = thin.fall_speed_m_s(diameter) / rain(5.0).fall_speed_m_s(diameter)
    # Foote & du Toit 1969; 4 % at 1 km
    assert ratio == pytest.approx((1.204 / 1.1) ** 0.4)


def test_air_that_is_not_on_earth_is_refused():
    with pytest.raises(InputError, match=r"air_density_kg_m3 should lie between 0.5 and 1.6"):
        rain(5.0, air_density_kg_m3=1100.0)
    with pytest.raises(ValueError, match="does not go with model medium"):
        Rain(rate_mm_per_h=5, air_density_kg_m3=1.1)


@pytest.mark.parametrize(
    ("rate", "extinction_per_km", "albedo"),
    [(1, 0.365, 0.781), (5, 1.009, 0.734), (10, 1.563, 0.713), (50, 4.301, 0.666)],
)
def test_rain_of_all_sizes_is_the_medium_of_mie_theory(rate, extinction_per_km, albedo):
    """Mie theory's extinction is that of the discs and as much again, diffracted."""
    falling = rain(rate, smallest_mm=0.1)
    discs = falling.extinction_per_m / (1 - falling.left_out)
    assert 2e3 * discs == pytest.approx(extinction_per_km, rel=0.02)
    assert (1 + falling.albedo) / 2 == pytest.approx(albedo, rel=0.02)


@pytest.mark.parametrize("kind", RAINS)
def test_rain_of_any_kind_is_its_medium(kind):
    """Drops of 0.1 to 6 mm, as the medium has; a class of its table is 19 % wide."""
    drops, medium = rain(10.0, kind, smallest_mm=0.1, largest_mm=6.0), rain_medium(10.0, kind)
    assert drops.water_g_per_m3 == pytest.approx(medium.water_g_per_m3, rel=5e-3)
    assert drops.extinction_per_m == pytest.approx(medium.extinction_per_m, rel=0.05)


def test_what_small_drops_would_add_is_told():
    all_of_them = np.pi * 8000 / (2 * (4.1 * 10**-0.21) ** 3) * 1e-6
    retained = rain(10.0).extinction_per_m
    assert rain(10.0).left_out == pytest.approx(1 - retained / all_of_them, abs=1e-5)
    assert rain(10.0).left_out == pytest.approx(0.0148, abs=1e-4)


def test_the_water_of_all_drops_is_about_the_rain():
    """Marshall-Palmer drops at these speeds bring the rain that they were fitted to."""
    for rate in (2.0, 10.0, 50.0):
        falling = rain(rate)
        diameter = np.linspace(falling.smallest_mm, falling.largest_mm, 4000)
        number = 8000.0 * np.exp(-falling.slope_per_mm * diameter)
        volume_m3 = np.pi / 6 * (diameter * 1e-3) ** 3
        flux = np.trapezoid(number * volume_m3 * falling.fall_speed_m_s(diameter), diameter)
        assert flux * 3.6e6 == pytest.approx(rate, rel=0.2)


def test_diameters_follow_the_distribution():
    falling, count = rain(10.0), 200_000
    drawn = falling.diameters_mm(count, np.random.default_rng(0))
    assert drawn.min() >= falling.smallest_mm
    assert drawn.max() <= falling.largest_mm
    edges = np.array([0.2, 0.4, 0.8, 1.6, 8.0])
    ends = np.exp(-falling.slope_per_mm * edges)
    expected = count * (ends[:-1] - ends[1:]) / (ends[0] - ends[-1])
    result = np.histogram(drawn, edges)[0]
    assert (((result - expected) ** 2 / expected).sum()) < 16.3  # χ² of 3, 0.1 %


def test_the_number_of_drops_is_poisson(paper):
    falling = rain(10.0, far_m=1.0)
    scene = worlds.scene(worlds.plane(4.0))
    fields = [
        drop_field(falling, scene, paper, 1, np.random.default_rng(seed)) for seed in range(200)
    ]
    mean = falling.number_per_m3 * np.diff(fields[0].box, axis=0).prod()
    counts = np.array([len(field.starts_m) for field in fields])
    assert abs(counts.mean() - mean) / np.sqrt(mean / 200) < 4
    assert abs(counts.var(ddof=1) / mean - 1) / np.sqrt(2 / 199) < 4


def test_drops_fall_past_a_moving_drone(paper):
    """In its frame they go with gravity and wind, against its own motion, and turn with it."""
    turning = replace(
        worlds.scene(worlds.plane(4.0)),
        drone_pose=spisim.scene.pose.look_at((0, 0, 2), (1, 0, 2), (0, 0, 1)),
        drone_velocity_m_s=(5.0, 0.0, 0.0),
        drone_angular_velocity_rad_s=(0.0, 0.0, 0.4),
    )
    falling = rain(10.0, far_m=1.0, wind_m_s=(0.0, 3.0, 0.0))
    field = drop_field(falling, turning, paper, 1, np.random.default_rng(0))
    time_s = paper.frame_time_s
    position, diameter = field.starts_m[0], field.diameters_mm[0]
    # Optical axes of the start: x is the world's -y, y its -z, z its x.
    apart = position + np.array([-3.0, terminal_speed_m_s(diameter), -5.0]) * time_s
    turn = 0.4 * time_s  # to the left: the scene turns to the right
    x = np.cos(turn) * apart[0] + np.sin(turn) * apart[2]
    z = np.cos(turn) * apart[2] - np.sin(turn) * apart[0]
    np.testing.assert_allclose(field.positions_m(time_s)[0], [x, apart[1], z], atol=1e-12)


def test_the_box_is_full_at_any_time(paper):
    scene = replace(worlds.scene(worlds.plane(4.0)), drone_velocity_m_s=(2.0, 1.0, 8.0))
    field = drop_field(rain(10.0, far_m=1.0), scene, paper, 1, np.random.default_rng(0))
    full = field.full_at(7.0)
    positions = full.positions_m(7.0)
    assert (positions >= full.box[0]).all()
    assert (positions <= full.box[1]).all()
    size = np.diff(full.box, axis=0)
    shift = (full.starts_m - field.starts_m) / size
    np.testing.assert_allclose(shift, np.rint(shift), atol=1e-9)


def test_equal_seeds_give_equal_drops(paper):
    scene = worlds.scene(worlds.plane(4.0))
    fields = [
        drop_field(rain(10.0, far_m=1.0), scene, paper, 1, np.random.default_rng(seed))
        for seed in (3, 3, 4)
    ]
    np.testing.assert_array_equal(fields[0].starts_m, fields[1].starts_m)
    assert not np.array_equal(fields[0].starts_m[:9], fields[2].starts_m[:9])


def test_what_is_scattered_is_the_albedo():
    angle = np.linspace(0, np.pi, 20_001)
    for optics in (*(water_drops(nm) for nm in WAVELENGTHS_NM), flakes(0.5, 0.6)):
        for diameter in (0.2, 0.77, 3.0):
            ring = optics.scattered_per_sr(np.cos(angle), diameter) * np.sin(angle)
            whole = 2 * np.pi * np.trapezoid(ring, angle)
            assert whole == pytest.approx(float(optics.albedo(diameter)), rel=2e-3)


def test_large_drops_send_back_what_their_surface_reflects():
    """Water takes all that enters: a sphere's reflection is R/4π at 180°, isotropic."""
    for wavelength_nm in (1460, 1550):
        water = refractive_index("water", wavelength_nm)
        reflectance = abs((water - 1) / (water + 1)) ** 2
        back = water_drops(wavelength_nm).scattered_per_sr(-1.0, 8.0)
        assert back == pytest.approx(reflectance / (4 * np.pi), rel=0.02)


def test_the_albedo_is_what_water_does_not_absorb():
    """Mie theory's 1 - Q_abs of single spheres (miepython 3.3)."""
    sizes = np.array([0.2, 0.5, 1.0, 2.0, 4.0])
    mie = [0.83076, 0.64130, 0.42528, 0.20755, 0.08657]
    np.testing.assert_allclose(water_drops().albedo(sizes), mie, rtol=0.01)


@pytest.mark.parametrize("wavelength_nm", [850, 905, 940])
def test_drops_are_clear_in_the_near_infrared(wavelength_nm):
    """A ray crosses 2/3 n D (1 - (1 - 1/n²)^1.5) of water on average: so much is absorbed."""
    water = refractive_index("water", wavelength_nm)
    absorption_per_mm = -4e6 * np.pi * water.imag / wavelength_nm
    n = water.real
    crossed = 2 / 3 * n**2 * (1 - (1 - 1 / n**2) ** 1.5) * 2.0  # mm, of a drop of 2 mm
    lost = 1 - water_drops(wavelength_nm).albedo(2.0)
    assert lost == pytest.approx(absorption_per_mm * crossed, rel=0.05)
    # the rear surface glints: drops are brighter straight back than at 1550 nm
    back = [water_drops(nm).scattered_per_sr(-1.0, 1.0) for nm in (wavelength_nm, 1550)]
    assert back[0] > 3 * back[1]


@pytest.mark.parametrize("wavelength_nm", WAVELENGTHS_NM)
@pytest.mark.parametrize("rate", [2.0, 20.0])
def test_drops_tell_of_themselves_what_the_medium_does(wavelength_nm, rate):
    """The same table: what is apart is what small drops diffract by more than 1.5°."""
    drops = rain(rate, wavelength_nm=wavelength_nm, smallest_mm=0.1, largest_mm=6.0).summary()
    medium = rain_medium(rate, wavelength_nm=wavelength_nm).summary()
    assert drops.keys() == medium.keys()
    assert drops["kind"] == f"rain, {rate:g} mm/h, single drops"
    absorbed = [one["extinction_per_m"] * (1 - one["albedo"]) for one in (drops, medium)]
    assert absorbed[0] == pytest.approx(absorbed[1], rel=0.005)
    echoes = [
        one["extinction_per_m"] * one["albedo"] * one["backscatter_per_sr"]
        for one in (drops, medium)
    ]
    assert echoes[0] == pytest.approx(echoes[1], rel=0.005)
    assert drops["water_g_per_m3"] == pytest.approx(medium["water_g_per_m3"], rel=1e-4)
    assert drops["visibility_m"] == pytest.approx(medium["visibility_m"], rel=0.01)
    assert drops["extinction_per_m"] == pytest.approx(medium["extinction_per_m"], rel=0.04)


def test_ice_is_clear_in_the_near_infrared():
    """Half of the light is taken at 1550 nm by 0.2 mm of ice; by the same, 0.1 % at 905 nm."""
    assert flake_albedo(1550) == 0.5
    assert flake_albedo(905) == pytest.approx(np.exp(-4 * np.pi * 4.32e-7 / 905e-6 * 0.2016), 1e-4)
    for wavelength_nm in WAVELENGTHS_NM:
        drops = snow(1.0, wavelength_nm=wavelength_nm).albedo
        assert drops == pytest.approx(flake_albedo(wavelength_nm))
        assert snow_medium(1, wavelength_nm=wavelength_nm).albedo == pytest.approx((1 + drops) / 2)
    assert snow(1.0, wavelength_nm=905, albedo=0.3).albedo == pytest.approx(0.3)


def test_flakes_tell_of_themselves():
    reported = snow(2.0, flake_density_kg_m3=50.0).summary()
    assert (reported["albedo"], reported["kind"]) == (0.5, "snow, 2 mm/h, single drops")
    assert reported["g"] == pytest.approx(0.6, abs=1e-3)
    # π ρ N0 / Λ⁴ of the drops that they melt into, less those out of bounds
    melted = np.pi * 3800 * 2.0**-0.87 / (2.55 * 2.0**-0.48) ** 4
    assert reported["water_g_per_m3"] == pytest.approx(1e-3 * melted, rel=0.05)
    # which all flakes make, be they heavy or light
    assert snow_medium(2.0).water_g_per_m3 == pytest.approx(1e-3 * melted, rel=1e-9)


def test_snow_is_within_what_is_measured():
    """ITU-R P.1817: 3.9 S^0.72 (wet) and 5.6 S^1.38 dB/km (dry); measurements scatter 3 to 10 ×."""
    loss_db_per_km = 2 * snow(1.0).extinction_per_m * 4343
    assert 3.94 / 5 < loss_db_per_km < 5.58 * 5


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: rain(0.0), "rate_mm_per_h of rain should be greater than 0 and at most 300"),
        (lambda: rain(301.0), "at most 300; found 301"),
        (lambda: rain(float("nan")), "found nan"),
        (lambda: rain(1.0, wavelength_nm=1310), "each within 50 nm; found"),
        (
            lambda: snow(30.0),
            "rate_mm_per_h of snow should be greater than 0 and at most 20; found 30",
        ),
        (lambda: rain(1.0, "joss"), "kind 'joss' of rain: allowed: marshall-palmer, joss-drizzle"),
        (lambda: rain(1.0, smallest_mm=9.0), "smallest_mm 9.0 and largest_mm 8.0"),
        (lambda: rain(1.0, near_m=0.0), "near_m 0.0 and far_m 10.0"),
        (lambda: snow(1.0, flake_density_kg_m3=2000), "at most that of ice, 917; found 2000"),
        (lambda: snow(1.0, fall_speed_m_s=-1), "fall_speed_m_s should be greater than 0"),
        (lambda: snow(1.0, albedo=1.5), "albedo should lie between 0 and 1; found 1.5"),
        (lambda: snow(1.0, g=1.0), "g should lie between -1 and 1"),
    ],
)
def test_what_cannot_be_is_refused(make, message):
    with pytest.raises(InputError) as refusal:
        make()
    assert message in str(refusal.value)

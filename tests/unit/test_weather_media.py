"""Fog, smoke, rain and snow as media: numbers, mixtures, phase functions, and what is refused."""

import math

import numpy as np
import pytest

from reconstruction.base.errors import InputError
from spisim.atmosphere import (
    CLEAR,
    FOGS,
    PHASES,
    RAINS,
    Atmosphere,
    Blend,
    HenyeyGreenstein,
    Isotropic,
    Tabulated,
    agreed_visibility,
    combine,
    empirical_extinction,
    explicit,
    extinction_at_550nm,
    fog,
    rain,
    snow,
    visibility_of_water,
)
from spisim.atmosphere.lookup import look_up
from spisim.atmosphere.mie import Optics
from spisim.atmosphere.mie_phase import phase_function

NATURAL = ["heavy-advection", "moderate-advection", "heavy-radiation", "moderate-radiation"]


# Fog


@pytest.mark.parametrize("kind", FOGS)
def test_table_for_the_transport_keeps_asymmetry_and_echo(kind: str) -> None:
    optics, air = look_up(FOGS[kind], 1550), fog(100, kind)
    assert isinstance(air.phase, Tabulated)
    assert air.g == pytest.approx(optics.g, abs=0.002)
    assert air.backscatter_per_sr == pytest.approx(optics.backscatter_per_sr, rel=0.03)


@pytest.mark.parametrize("kind", NATURAL)
def test_mitsuba_keeps_asymmetry_and_echo(kind: str) -> None:
    """Of its own interpolation: the mean cosine of its samples, by z-score, and its value back."""
    from spisim.transport.backend import activate
    from spisim.transport.media import phase_plugin

    activate()
    import drjit as dr
    import mitsuba as mi

    optics = look_up(FOGS[kind], 1550)
    plugin = phase_plugin(fog(100, kind).phase)
    interaction = dr.zeros(mi.MediumInteraction3f)
    interaction.wi = mi.Vector3f(0, 0, -1)
    interaction.sh_frame = mi.Frame3f(interaction.wi)
    back, _ = plugin.eval_pdf(mi.PhaseFunctionContext(), interaction, mi.Vector3f(0, 0, -1))
    assert back.x.numpy().item() == pytest.approx(optics.backscatter_per_sr, rel=0.03)
    count = 2**18
    square = mi.Point2f(np.random.default_rng(1).random((2, count), dtype=np.float32))
    wo, _, _ = plugin.sample(mi.PhaseFunctionContext(), interaction, mi.Float(0.5), square)
    cos = wo.z.numpy().astype(float)
    error = cos.std(ddof=1) / math.sqrt(count)
    assert abs(cos.mean() - fog(100, kind).g) < 4 * error
    assert error < 0.002 / 2  # or the comparison would say nothing


@pytest.mark.parametrize(
    ("kind", "factor"),
    [
        ("heavy-advection", 16),
        ("moderate-advection", 15),
        ("heavy-radiation", 13),
        ("moderate-radiation", 6),
    ],
)
def test_henyey_greenstein_has_too_little_echo(kind: str, factor: float) -> None:
    mie, plain = fog(50, kind), fog(50, kind, phase="hg")
    assert isinstance(plain.phase, HenyeyGreenstein)
    assert plain.g == pytest.approx(mie.g, abs=0.001)
    result = mie.backscatter_per_sr / plain.backscatter_per_sr
    assert result == pytest.approx(factor, rel=0.05)


@pytest.mark.parametrize("kind", NATURAL)
def test_double_henyey_greenstein_keeps_asymmetry_and_light_back(kind: str) -> None:
    optics, air = look_up(FOGS[kind], 1550), fog(50, kind, phase="double-hg")
    assert isinstance(air.phase, Blend)
    assert len(air.phase.parts) == 2
    assert air.g == pytest.approx(optics.g, abs=1e-6)
    cos = np.linspace(-1, np.cos(np.radians(175)), 2001)
    mie = np.interp(np.degrees(np.arccos(cos)), optics.angles_deg, optics.phase)
    assert air.phase.density(cos).mean() == pytest.approx(mie.mean(), rel=0.01)


def test_phases_that_are_refused() -> None:
    with pytest.raises(InputError, match=r"did you mean 'mie'\? allowed: mie, double-hg, hg"):
        fog(50, "heavy-advection", phase="mi")
    with pytest.raises(InputError, match=r"double-hg.*does not fit haze-l"):
        fog(5000, "haze-l", phase="double-hg")
    needle = Optics(1e-12, 1.0, 0.3, np.array([1e9, 1e-9, 1e-9]), np.array([0.0, 0.001, 180.0]))
    with pytest.raises(InputError, match="too coarse"):
        phase_function(needle, "mie", "needle")


def test_water_content_is_the_inverse_of_visibility() -> None:
    for kind, grams in (("heavy-advection", 5.1), ("moderate-radiation", 0.71)):
        air = fog(10, kind)
        assert air.water_g_per_m3 == pytest.approx(grams, rel=0.01)
        assert visibility_of_water(air.water_g_per_m3, kind) == pytest.approx(10)
        by_mor = fog(10, kind, "mor").water_g_per_m3
        assert visibility_of_water(by_mor, kind, "mor") == pytest.approx(10)


def test_visibility_and_water_may_agree_but_not_contradict() -> None:
    assert agreed_visibility(10, 0.71, "moderate-radiation") == 10
    assert agreed_visibility(None, 0.71, "moderate-radiation") == pytest.approx(10, rel=0.01)
    assert agreed_visibility(10, None, "moderate-radiation") == 10
    with pytest.raises(InputError, match=r"visibility_m 10 .*5 contradict.*1\.4\d m"):
        agreed_visibility(10, 5, "moderate-radiation")
    with pytest.raises(InputError, match="needs visibility_m or"):
        agreed_visibility(None, None, "moderate-radiation")
    for wrong in (0.0, -1.0, math.inf, math.nan):
        with pytest.raises(InputError, match="liquid_water_g_per_m3"):
            visibility_of_water(wrong, "heavy-advection")
    with pytest.raises(InputError, match="not water"):
        visibility_of_water(0.1, "soot")


def test_what_nature_does_not_have_is_doubted() -> None:
    (warning,) = fog(10, "heavy-advection").warnings
    assert "5.05 g/m³" in warning
    assert "10 m" in warning
    assert warning.endswith("at the same visibility moderate-radiation holds 0.71")
    (warning,) = fog(30, "heavy-advection", "mor").warnings  # as 39.2 m by Koschmieder
    assert "heavy-radiation holds 0.37 and moderate-radiation holds 0.18" in warning
    (warning,) = fog(5, "moderate-radiation").warnings
    assert warning.endswith("natural fog holds up to 1")
    assert fog(100, "heavy-advection").warnings == ()
    assert fog(10, "moderate-radiation").warnings == ()
    (warning,) = fog(2, "haze-h").warnings
    assert "particles per cm³" in warning
    assert combine([fog(10, "heavy-advection"), rain(10)]).warnings[0].startswith("heavy-advection")


# The empirical models


@pytest.mark.parametrize(
    ("model", "by_visibility"),
    [  # 1/m at 1550 nm
        ("kim", {10: 0.3912, 20: 0.1956, 50: 0.0782, 100: 0.0391, 200: 0.0196}),
        ("al-naboulsi-advection", {50: 0.0803, 100: 0.0401, 200: 0.0201}),
        ("al-naboulsi-radiation", {50: 0.0880, 100: 0.0440, 200: 0.0220}),
        ("ijaz-fog", {20: 0.1715, 50: 0.0686, 100: 0.0343, 200: 0.0172}),
        ("ijaz-smoke", {20: 0.0862, 50: 0.0345, 100: 0.0172, 200: 0.0086}),
        # (1.55/0.55)^-1.3 and ^-0.585·2^⅓ times 3.912/V
        ("kruse", {2000: 0.001956 * (1.55 / 0.55) ** (-0.585 * 2 ** (1 / 3)), 1e4: 1.0168e-4}),
    ],
)
def test_empirical_models(model: str, by_visibility: dict[float, float]) -> None:
    for visibility_m, extinction in by_visibility.items():
        # Half a unit of the last digit of what is printed above
        assert empirical_extinction(model, visibility_m) == pytest.approx(
            extinction, abs=6e-5, rel=2e-3
        )


def test_exponents_of_haze_do_not_depend_on_visibility_beyond_6_km() -> None:
    """Kim et al. 2001: q = 1.3 from 6 to 50 km, 0.16 V + 0.34 from 1 to 6 km."""
    for visibility_m, q in ((6500, 1.3), (5500, 0.16 * 5.5 + 0.34)):
        expected = extinction_at_550nm(visibility_m) * (1.55 / 0.55) ** -q
        assert empirical_extinction("kim", visibility_m) == pytest.approx(expected, rel=1e-9)


def test_mie_theory_agrees_with_al_naboulsi() -> None:
    """Independent fits of FASCODE: 0.3 % for advection fog, 1.5 % for radiation fog."""
    for mie, fitted in (("heavy-advection", "advection"), ("moderate-radiation", "radiation")):
        ratio = fog(100, mie).extinction_per_m / empirical_extinction(f"al-naboulsi-{fitted}", 100)
        assert ratio == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (("kruse", 50), ["kruse", "visibility_m from 1000"]),
        (("al-naboulsi-advection", 20), ["visibility_m from 50 to 1000", "20"]),
        (("ijaz-fog", 100, 400), ["wavelength_nm from 600 to 1550", "400"]),
        (("kimm", 100), ["did you mean 'kim'"]),
    ],
)
def test_empirical_models_outside_their_range(arguments: tuple, parts: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        empirical_extinction(*arguments)
    for part in parts:
        assert part in str(caught.value)


@pytest.mark.parametrize(
    ("name", "minimum", "maximum"),
    [  # Kruse et al. 1962; Kim et al. 2001; Al Naboulsi et al. 2004; Ijaz et al. 2013
        ("kruse", 1000, 100_000),
        ("kim", 10, 100_000),
        ("al-naboulsi-advection", 50, 1000),
        ("al-naboulsi-radiation", 50, 1000),
        ("ijaz-fog", 15, 1000),
    ],
)
def test_empirical_models_are_for_the_visibilities_they_were_fitted_in(
    name: str, minimum: float, maximum: float
) -> None:
    assert empirical_extinction(name, minimum) > empirical_extinction(name, maximum)
    for outside in (0.99 * minimum, 1.01 * maximum):
        with pytest.raises(InputError, match="visibility_m from"):
            empirical_extinction(name, outside)


# Rain and snow


@pytest.mark.parametrize(
    ("rate", "per_km", "albedo", "g"),
    [  # from miepython, drops of 0.1 to 6 mm of Marshall & Palmer at 1550 nm
        (1, 0.365, 0.781, 0.924),
        (5, 1.009, 0.734, 0.932),
        (10, 1.563, 0.713, 0.936),
        (25, 2.783, 0.685, 0.941),
        (50, 4.301, 0.666, 0.944),
        (100, 6.634, 0.647, 0.948),
    ],
)
def test_rain(rate: float, per_km: float, albedo: float, g: float) -> None:
    drops = rain(rate, diffraction="include")
    assert 1e3 * drops.extinction_per_m == pytest.approx(per_km, rel=0.02)
    assert drops.albedo == pytest.approx(albedo, rel=0.02)
    assert drops.g == pytest.approx(g, abs=0.002)


@pytest.mark.parametrize("kind", RAINS)
def test_rain_without_its_diffraction_absorbs_the_same_and_takes_half(kind: str) -> None:
    whole, geometric = (rain(20, kind, diffraction=d) for d in ("include", "remove"))
    assert geometric.absorption_per_m == pytest.approx(whole.absorption_per_m, rel=1e-9)
    # A third of what drops of 0.1 mm diffract goes beyond the cone; drizzle is full of them.
    assert geometric.extinction_per_m / whole.extinction_per_m == pytest.approx(0.5, abs=0.03)
    # What is scattered further than the peak is the same, wherever it goes.
    angles = np.cos(np.radians([10, 40, 90, 138, 175, 180]))
    np.testing.assert_allclose(
        geometric.scattering_per_m * geometric.phase.density(angles),
        whole.scattering_per_m * whole.phase.density(angles),
        rtol=1e-6,
    )


def test_rain_has_a_rainbow_and_takes_q_of_2() -> None:
    phase = rain(10, wavelength_nm=550).phase
    bow, dark = phase.density(np.cos(np.radians([138.5, 130])))  # Alexander's dark band
    assert bow > 3 * dark
    whole = rain(10, diffraction="include", wavelength_nm=550)
    decay = 4.1 * 10**-0.21
    assert whole.extinction_per_m == pytest.approx(np.pi * 8000 / decay**3 * 1e-6, rel=0.02)
    assert whole.albedo == pytest.approx(1, abs=1e-3)
    assert whole.visibility_m == pytest.approx(3.912 / whole.extinction_per_m, rel=1e-4)
    water = 0.997e-3 * np.pi * 8000 / decay**4  # ∫ N π/6 D³ = π N0 / Λ⁴, mm³/m³
    assert whole.water_g_per_m3 == pytest.approx(water, rel=0.02)


@pytest.mark.parametrize(
    ("kind", "by_rate"),
    [
        ("wet", {0.5: 2.39, 1: 3.944, 2.5: 7.63, 5: 12.6}),
        ("dry", {0.5: 2.14, 1: 5.580, 2.5: 19.8, 5: 51.4}),
    ],
)
def test_snow(kind: str, by_rate: dict[float, float]) -> None:
    for rate, decibels_per_km in by_rate.items():
        flakes = snow(rate, kind)
        assert flakes.summary()["extinction_db_per_km"] == pytest.approx(decibels_per_km, rel=0.01)
    chosen = snow(1, kind, albedo=0.66, g=0.9)
    assert (chosen.albedo, chosen.g) == (0.66, 0.9)


@pytest.mark.parametrize(
    ("make", "parts"),
    [
        (lambda: rain(0), ["rate_mm_per_h of rain", "300", "0"]),
        (lambda: rain(301), ["rate_mm_per_h", "at most 300", "301"]),
        (lambda: rain(math.nan), ["rate_mm_per_h", "nan"]),
        (lambda: rain(5, "marshal"), ["did you mean 'marshall-palmer'"]),
        (lambda: rain(5, diffraction="no"), ["diffraction 'no'", "remove, include"]),
        (lambda: rain(5, wavelength_nm=1310), ["rain is tabulated at 550", "1310"]),
        (lambda: snow(0), ["rate_mm_per_h of snow", "20"]),
        (lambda: snow(21), ["rate_mm_per_h", "at most 20", "21"]),
        (lambda: snow(1, "wett"), ["did you mean 'wet'"]),
        (lambda: snow(1, albedo=1.2), ["albedo", "1.2"]),
        (lambda: snow(1, wavelength_nm=2000), ["wavelength_nm", "2000"]),
        (lambda: snow(1, g=1.0), ["g should lie between -1 and 1"]),
        (lambda: fog(0, "soot"), ["visibility_m", "0"]),
        (lambda: fog(math.inf, "hazer"), ["visibility_m", "inf"]),
        (lambda: fog(50, "hazerr"), ["kind 'hazerr' of fog or smoke", "did you mean 'hazer'"]),
        (
            lambda: fog(50, "glycol"),
            ["'glycol'", "'fog-machine' or 'hazer'", "median_diameter_um: 1,"],
        ),
        (lambda: fog(9, "glycol-fine"), ["'glycol-fine'", "median_diameter_um: 0.6,"]),
        (lambda: fog(50, "soot", wavelength_nm=300), ["wavelength_nm", "400 and 1700", "300"]),
    ],
)
def test_impossible_weather(make, parts: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        make()
    for part in parts:
        assert part in str(caught.value)


# Mixtures


def test_mixture_adds_and_blends() -> None:
    parts = [fog(100, "heavy-radiation", phase="hg"), rain(25), snow(2)]
    air = combine(parts)
    assert air.extinction_per_m == pytest.approx(sum(part.extinction_per_m for part in parts))
    assert air.scattering_per_m == pytest.approx(sum(part.scattering_per_m for part in parts))
    cos = np.linspace(-1, 1, 7)
    scattered = sum(part.scattering_per_m * part.phase.density(cos) for part in parts)
    np.testing.assert_allclose(air.scattering_per_m * air.phase.density(cos), scattered)
    visual = sum(extinction_at_550nm(part.visibility_m) for part in parts)
    assert air.visibility_m == pytest.approx(3.912 / visual, rel=1e-4)
    assert air.parts == tuple(parts)
    assert air.kind == "heavy-radiation + rain, 25 mm/h + wet snow, 2 mm/h"
    assert air.water_g_per_m3 == pytest.approx(sum(part.water_g_per_m3 for part in parts))
    assert combine([*parts, explicit(0.1, 1.0, Isotropic())]).water_g_per_m3 is None


def test_mixture_of_definitions_counts_extinction() -> None:
    air = combine([fog(100, "soot", "mor"), fog(100, "haze-m")])
    visual = -math.log(0.05) / 100 - math.log(0.02) / 100
    assert air.visibility_m == pytest.approx(-math.log(0.02) / visual)
    assert air.definition == "koschmieder"


def test_mixtures_of_nothing_and_of_one() -> None:
    only = rain(3)
    assert combine([]) is CLEAR
    assert combine([CLEAR]) is CLEAR
    assert combine([only, CLEAR]) is only
    black = explicit(0.1, 0.0, Isotropic())
    assert combine([black, black]).albedo == 0
    assert combine([black, only]).g == pytest.approx(only.g)
    assert combine([black, only]).visibility_m is None


@pytest.mark.parametrize("phase", PHASES)
def test_summary_has_everything_that_is_reported(phase: str) -> None:
    air: Atmosphere = fog(50, "moderate-radiation", phase=phase)
    summary = air.summary()
    assert set(summary) == {
        "kind",
        "extinction_per_m",
        "extinction_db_per_km",
        "albedo",
        "g",
        "backscatter_per_sr",
        "visibility_m",
        "visibility_definition",
        "water_g_per_m3",
    }
    assert summary["extinction_db_per_km"] == pytest.approx(4342.9 * air.extinction_per_m, rel=1e-4)
    assert summary["backscatter_per_sr"] == pytest.approx(air.phase.density(-1))

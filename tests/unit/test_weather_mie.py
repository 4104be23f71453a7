"""Mie theory of one sphere and of the named kinds, against published and independent numbers."""

from pathlib import Path

import numpy as np
import pytest

from reconstruction.base.errors import InputError
from scattering_tables import RADII
from spisim.atmosphere import FOGS, KINDS, GammaSizes, LogNormalSizes, Particles, refractive_index
from spisim.atmosphere import lookup as lookup_module
from spisim.atmosphere.fog import fog
from spisim.atmosphere.lookup import WAVELENGTHS_NM, look_up, shipped
from spisim.atmosphere.mie import ANGLES_DEG, particle_optics, scatter
from spisim.atmosphere.rain_table import compute, rain_table, solid_angle_weights

NUMBER_PER_CM3 = {
    "heavy-advection": 20,
    "moderate-advection": 20,
    "heavy-radiation": 100,
    "moderate-radiation": 200,
    "chu-hogg": 20,
    "haze-l": 100,
    "haze-m": 100,
    "haze-h": 100,
}


def sphere(x: float, index: complex):
    """Efficiencies (extinction, scattering, backscatter), asymmetry and phase function."""
    wavelength_nm = 1000.0
    radius = x / (2 * np.pi)
    sums = scatter(np.array([radius]), np.ones(1), index, wavelength_nm, ANGLES_DEG)
    area = np.pi * radius**2 * 1e-12
    back = 4 * np.pi * sums.per_steradian_m2[-1]
    return (
        sums.extinction_m2 / area,
        sums.scattering_m2 / area,
        back / area,
        sums.forward_m2 / sums.scattering_m2,
        sums.per_steradian_m2 / sums.scattering_m2,
    )


def test_sphere_of_bohren_and_huffman() -> None:
    """Appendix A of their book: x = 5.213, m = 1.55; 525 nm of radius at 632.8 nm."""
    extinction, scattering, back, *_ = sphere(2 * np.pi * 525 / 632.8, 1.55)
    assert scattering == pytest.approx(3.1054, abs=1e-4)
    assert extinction == pytest.approx(scattering, rel=1e-12)
    assert back == pytest.approx(2.9253, abs=1e-4)


def test_small_sphere_is_rayleigh_s() -> None:
    x, m = 1e-3, 1.5
    _, scattering, _, g, phase = sphere(x, m)
    polarisability = (m**2 - 1) / (m**2 + 2)
    assert scattering == pytest.approx(8 / 3 * x**4 * polarisability**2, rel=1e-5)
    assert g == pytest.approx(0, abs=1e-5)
    cos = np.cos(np.radians(ANGLES_DEG))
    np.testing.assert_allclose(phase, 3 / (16 * np.pi) * (1 + cos**2), rtol=1e-5)


@pytest.mark.parametrize(
    ("x", "index"), [(0.5, 1.31 - 1e-4j), (30, 1.75 - 0.44j), (400, 1.33 + 0j)]
)
def test_sums_over_orders_agree_with_miepython(x: float, index: complex) -> None:
    import miepython

    extinction, scattering, back, g = miepython.efficiencies_mx(index, x)
    ours = sphere(x, index)
    np.testing.assert_allclose(ours[:4], (extinction, scattering, back, g), rtol=1e-9)
    cos = np.cos(np.radians(ANGLES_DEG))
    phase = miepython.i_unpolarized(index, x, cos, norm="one")
    np.testing.assert_allclose(ours[4], phase, rtol=1e-6)


@pytest.mark.parametrize(
    ("kind", "extinctions_per_km", "ratio", "albedo", "g", "back", "g_550"),
    [  # at 550 and 1550 nm; from miepython with the water of Segelstein 1981
        ("heavy-advection", (28.743, 29.586), 1.0293, 0.98104, 0.8678, 0.0488, 0.8713),
        ("moderate-advection", (18.479, 19.115), 1.0344, 0.98450, 0.8616, 0.0479, 0.8689),
        ("heavy-radiation", (16.639, 17.732), 1.0657, 0.99374, 0.8214, 0.0541, 0.8525),
        ("moderate-radiation", (8.633, 9.856), 1.1416, 0.99716, 0.7825, 0.0327, 0.8304),
        ("chu-hogg", (1.589, 1.722), 1.084, 0.99329, 0.8218, 0.046, 0.8485),
        ("haze-l", (0.0453, 0.0138), 0.305, 0.99875, 0.742, 0.0111, 0.802),
        ("haze-m", (0.1068, 0.0707), 0.662, 0.99885, 0.808, 0.0090, 0.793),
        ("haze-h", (0.0153, 0.00131), 0.086, 0.997, 0.450, 0.0315, 0.780),
    ],
)
def test_named_fogs(
    kind: str,
    extinctions_per_km: tuple[float, float],
    ratio: float,
    albedo: float,
    g: float,
    back: float,
    g_550: float,
) -> None:
    visual, here = (look_up(FOGS[kind], nm) for nm in (550, 1550))
    number = 1e6 * NUMBER_PER_CM3[kind]
    for optics, extinction in zip((visual, here), extinctions_per_km, strict=True):
        assert 1e3 * number * optics.extinction_m2 == pytest.approx(extinction, rel=0.01)
    assert here.extinction_m2 / visual.extinction_m2 == pytest.approx(ratio, rel=0.01)
    assert here.albedo == pytest.approx(albedo, rel=0.01)
    assert 1 - here.albedo == pytest.approx(1 - albedo, rel=0.03)
    assert here.g == pytest.approx(g, rel=0.01)
    assert visual.g == pytest.approx(g_550, rel=0.01)
    assert here.backscatter_per_sr == pytest.approx(back, rel=0.03)


@pytest.mark.parametrize(
    ("kind", "by_angle"),
    [  # 1/sr at 1550 nm
        ("heavy-advection", {0: 324, 90: 0.00230, 140: 0.0203}),
        ("moderate-radiation", {0: 7.8, 90: 0.00862, 120: 0.00785, 140: 0.0147, 175: 0.0183}),
    ],
)
def test_phase_functions_at_angles(kind: str, by_angle: dict[float, float]) -> None:
    optics = look_up(FOGS[kind], 1550)
    for angle, value in by_angle.items():
        result = np.interp(angle, optics.angles_deg, optics.phase)
        assert result == pytest.approx(value, rel=0.03)


@pytest.mark.parametrize(
    ("kind", "ratio", "albedo", "g"),
    [
        ("biomass", 0.077, 0.71, 0.27),
        ("soot", 0.29, 0.20, 0.29),
        ("fog-machine", 0.206, 0.999, 0.60),
        ("hazer", 0.365, 0.999, 0.70),
    ],
)
def test_named_smokes(kind: str, ratio: float, albedo: float, g: float) -> None:
    visual, here = (look_up(KINDS[kind], nm) for nm in (550, 1550))
    assert here.extinction_m2 / visual.extinction_m2 == pytest.approx(ratio, rel=0.02)
    assert here.albedo == pytest.approx(albedo, rel=0.02)
    assert here.g == pytest.approx(g, abs=0.006)


@pytest.mark.parametrize("wavelength_nm", WAVELENGTHS_NM)
@pytest.mark.parametrize("kind", KINDS)
def test_shipped_phase_functions_are_normalised_with_their_asymmetry(
    kind: str, wavelength_nm: int
) -> None:
    optics = shipped()[kind, wavelength_nm]
    weights = solid_angle_weights(optics.angles_deg) * optics.phase
    assert weights.sum() == pytest.approx(1, abs=1e-3)
    mean = weights @ np.cos(np.radians(optics.angles_deg)) / weights.sum()
    assert mean == pytest.approx(optics.g, abs=1e-3)


def test_a_shipped_kind_can_be_made_again() -> None:
    made, retained = particle_optics(KINDS["haze-h"], 1550, RADII), shipped()["haze-h", 1550]
    assert made.extinction_m2 == pytest.approx(retained.extinction_m2, rel=1e-9)
    assert (made.albedo, made.g) == pytest.approx((retained.albedo, retained.g), rel=1e-9)
    np.testing.assert_allclose(made.phase, retained.phase, rtol=1e-6)


@pytest.mark.slow
def test_a_shipped_fog_and_rain_can_be_made_again() -> None:
    made = particle_optics(KINDS["heavy-radiation"], 1550, RADII)
    retained = shipped()["heavy-radiation", 1550]
    assert made.extinction_m2 == pytest.approx(retained.extinction_m2, rel=1e-9)
    np.testing.assert_allclose(made.phase, retained.phase, rtol=1e-5)
    drops, shipped_drops = compute(1550, 12, 13), rain_table(1550)
    assert drops.extinction[0] == pytest.approx(shipped_drops.extinction[12], rel=1e-6)
    np.testing.assert_allclose(drops.phase[0], shipped_drops.phase[12], rtol=1e-5)


def test_the_smallest_drops_of_rain_can_be_made_again() -> None:
    made, retained = compute(1550, 0, 1), rain_table(1550)
    assert made.diffracted[0] == pytest.approx(retained.diffracted[0], rel=1e-5)
    assert made.extinction[0] == pytest.approx(retained.extinction[0], rel=1e-5)


def test_rain_is_tabulated_where_water_absorbs_nearly_alike() -> None:
    assert rain_table(1550 + 49) is rain_table(1550)
    with pytest.raises(InputError, match="each within 50 nm; found wavelength_nm 1601"):
        rain_table(1601)


# Sizes


@pytest.mark.parametrize(
    "sizes", [*(kind.sizes for kind in KINDS.values())], ids=lambda sizes: repr(sizes)
)
def test_densities_are_normalised_and_have_their_moments(
    sizes: GammaSizes | LogNormalSizes,
) -> None:
    radii = np.geomspace(1e-5, 300, 40_001)
    density = sizes.density(radii)
    assert np.trapezoid(density, radii) == pytest.approx(1, rel=1e-4)
    assert np.trapezoid(density * radii**3, radii) == pytest.approx(sizes.moment(3), rel=1e-4)
    low, high = sizes.radius_range_um()
    inside = (radii > low) & (radii < high)
    area = np.trapezoid((density * radii**2)[inside], radii[inside])
    assert area == pytest.approx(sizes.moment(2), rel=1e-4)


def test_gamma_sizes_are_those_of_the_literature() -> None:
    """b, effective radius and water of Shettle & Fenn's and Deirmendjian's models."""
    heavy, thin = GammaSizes(3, 1, 10), GammaSizes(6, 1, 2)
    assert (heavy.b, thin.b) == pytest.approx((0.3, 3.0))
    assert heavy.moment(3) / heavy.moment(2) == pytest.approx(20)
    assert 20e6 * 1e6 * Particles(heavy).volume_m3 == pytest.approx(0.372, rel=5e-3)  # g/m³
    assert GammaSizes(2, 0.5, 0.07).b == pytest.approx(15.1186, rel=1e-5)
    radii = np.linspace(0.01, 100, 100_000)
    assert radii[np.argmax(heavy.density(radii))] == pytest.approx(10, abs=1e-3)


# Refractive indices


def test_refractive_indices() -> None:
    for material, nm, n, k in (
        ("water", 550, 1.33594, 2.46e-9),
        ("water", 1460, 1.31287, 3.58e-4),
        ("water", 1550, 1.31089, 1.336e-4),
        ("ice", 1550, 1.29061, 4.241e-4),
    ):
        index = refractive_index(material, nm)
        assert index.real == pytest.approx(n, abs=1e-5)
        assert -index.imag == pytest.approx(k, rel=2e-3)
    between = refractive_index("water", 1545)
    assert (
        refractive_index("water", 1550).real < between.real < refractive_index("water", 1540).real
    )


# The user's own


def test_own_sizes_are_kept_on_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SPISIM_CACHE", str(tmp_path / "cache"))
    calls = []

    def counted(*args: object) -> object:
        calls.append(args)
        return particle_optics(*args, 60)

    monkeypatch.setattr(lookup_module, "particle_optics", counted)
    own = Particles(LogNormalSizes(0.31, 1.4), 1.5 - 0.01j)
    fresh = look_up.__wrapped__
    first = fresh(own, 1550)
    again = fresh(own, 1550)
    assert len(calls) == 1
    assert (first.albedo, first.g) == (again.albedo, again.g)
    np.testing.assert_array_equal(first.phase, again.phase)
    fresh(own, 1551)
    assert len(calls) == 2
    for file in (tmp_path / "cache").iterdir():  # a damaged cache is made again
        file.write_bytes(file.read_bytes()[:100])
    assert fresh(own, 1550).albedo == first.albedo
    assert len(calls) == 3


def test_cache_that_cannot_be_written_is_no_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("SPISIM_CACHE", str(tmp_path / "file" / "cache"))
    monkeypatch.setattr(lookup_module, "particle_optics", lambda *args: particle_optics(*args, 20))
    assert 0 < look_up.__wrapped__(Particles(LogNormalSizes(0.3, 1.5)), 1550).albedo < 1


def test_own_sizes_equal_to_a_named_kind_need_no_computation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SPISIM_CACHE", str(tmp_path))
    assert look_up(Particles(GammaSizes(6, 1, 4)), 1550) is shipped()["heavy-radiation", 1550]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("make", "parts"),
    [
        (lambda: GammaSizes(0, 1, 5), ["alpha", "0.1", "50"]),
        (lambda: GammaSizes(3, -1, 5), ["gamma", "0.2", "-1"]),
        (lambda: GammaSizes(3, 1, 0), ["mode_radius_um", "0.001"]),
        (lambda: GammaSizes(3, float("nan"), 5), ["gamma", "nan"]),
        (lambda: GammaSizes(0.5, 0.2, 50), ["converges", "up to 300"]),
        (lambda: LogNormalSizes(0, 1.5), ["median_diameter_um"]),
        (lambda: LogNormalSizes(1, 1.0), ["sigma_g", "1.05", "2.5"]),
        (lambda: LogNormalSizes(30, 2.4), ["converges", "up to 300"]),
        (lambda: Particles(LogNormalSizes(1, 1.5), 0.5 - 0j), ["n should", "1.0001", "0.5"]),
        (lambda: Particles(LogNormalSizes(1, 1.5), 1.5 + 0.1j), ["k should", "-0.1"]),
        (lambda: refractive_index("watter", 1550), ["did you mean 'water'"]),
        (lambda: refractive_index("water", 1800), ["wavelength_nm", "400 and 1700", "1800"]),
        (lambda: look_up(KINDS["haze-h"], 200), ["wavelength_nm", "400 and 1700", "200"]),
    ],
)
def test_unphysical_particles(make, parts: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        make()
    for part in parts:
        assert part in str(caught.value)


def test_smoke_of_a_fog_machine_is_as_dense_and_as_steep_as_in_a_tunnel() -> None:
    """IRNAS 2016: 51 and 79 dB/km at 50 m of visibility, 25 and 36 at 100 m, by 5 % of contrast."""
    for visibility_m, long_db, short_db in ((50.0, 51.0, 79.0), (100.0, 25.0, 36.0)):
        long, short = (
            fog(visibility_m, "fog-machine", "mor", wavelength_nm=nm).summary()
            for nm in (1550.0, 1270.0)
        )
        assert long["extinction_db_per_km"] == pytest.approx(long_db, rel=0.1)
        assert short["extinction_db_per_km"] == pytest.approx(short_db, rel=0.2)
        ratio = long["extinction_per_m"] / short["extinction_per_m"]
        assert 0.62 < ratio < 0.71


def test_sizes_by_volume_have_that_median_of_volume() -> None:
    sizes = LogNormalSizes.of_volume(0.85, 1.6)
    assert sizes.median_diameter_um < 0.85
    radius = np.geomspace(0.01, 0.425, 4001)
    below = np.trapezoid(sizes.density(radius) * radius**3, radius)
    assert below / sizes.moment(3) == pytest.approx(0.5, abs=1e-4)


def test_the_fluid_of_fog_machines_is_between_glycol_and_water() -> None:
    for nm in (550.0, 1550.0):
        water, glycol, fluid = (refractive_index(m, nm) for m in ("water", "glycol", "fog-fluid"))
        assert fluid == pytest.approx(0.8 * glycol + 0.2 * water)
    # Sani & Dell'Oro 2014, as refractiveindex.info has it
    assert refractive_index("glycol", 1550.0) == pytest.approx(1.4199 - 1.373e-4j, rel=1e-4)
    with pytest.raises(InputError, match="did you mean 'glycol'"):
        refractive_index("glycoll", 550.0)

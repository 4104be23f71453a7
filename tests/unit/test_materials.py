"""Materials have a possible reflectance and a source, and are found by name."""

from collections.abc import Mapping
from functools import cache

import numpy as np
import pytest

import reference_pages
from reconstruction.base.errors import InputError
from spisim.atmosphere import refractive_index
from spisim.scene import Material, find_material, material_table
from spisim.scene.bsdf import Diffuse, Plastic, fresnel_reflectance, make_bsdf
from spisim.scene.materials import mean_fresnel_transmittance, shipped_materials, wet_reflectance

WAVELENGTHS_NM = (850, 905, 940, 1460, 1550)
SHIPPED = shipped_materials()
SPECTRAL = ("reflectance", "ior", "eta", "k")


def spectrum(name: str) -> list[float]:
    return [find_material(name, None, nm).reflectance for nm in WAVELENGTHS_NM]


@pytest.mark.parametrize("name", SHIPPED.names)
def test_every_material_is_possible_and_sourced_at_every_wavelength(name: str) -> None:
    for wavelength_nm in WAVELENGTHS_NM:
        material = material_table(wavelength_nm)[name]
        assert material.name == name
        assert 0 < material.reflectance < 1
        assert len(material.source) > 10


@pytest.mark.parametrize("name", SHIPPED.dry)
def test_every_row_has_all_five_wavelengths(name: str) -> None:
    row = SHIPPED.dry[name]
    given = {field: getattr(row, field) for field in SPECTRAL}
    tables = [values for values in given.values() if isinstance(values, Mapping)]
    assert tables
    for values in tables:
        assert tuple(values) == WAVELENGTHS_NM
    own = given["reflectance"]
    assert isinstance(own, Mapping) or fresnel_reflectance(make_bsdf(row.bsdf, MODELLED[row.bsdf]))


#: Parameters of the models whose reflectance follows from refraction, only to make one.
MODELLED = {
    "conductor": {"eta": 1.0, "k": 1.0},
    "rough-conductor": {"eta": 1.0, "k": 1.0, "roughness": 0.1},
    "thin-pane": {},
}


def test_typical_ranges_hold_their_values() -> None:
    rows = {name: row for name, row in SHIPPED.dry.items() if row.typical is not None}
    assert len(rows) > 55
    for name, row in rows.items():
        low, high = row.typical or (1, 0)
        assert low <= find_material(name).reflectance <= high, name
    without = [row.source for row in SHIPPED.dry.values() if row.typical is None]
    assert not [source for source in without if "median" in source and "coat" not in source]


def test_few_rows_are_estimates() -> None:
    estimates = [name for name, row in SHIPPED.dry.items() if row.source.startswith("estimate")]
    assert len(estimates) <= 15
    assert len(SHIPPED.dry) >= 75


def test_the_reference_lists_every_row() -> None:
    table = reference_pages.pages()["materials.md"]
    assert all(f"\n| `{name}` | " in table for name in SHIPPED.names)


def test_names_that_scenes_may_use_stay() -> None:
    old = """asphalt concrete concrete-weathered brick gravel sand-dry soil-dry soil-field wood-dry
        wood-weathered bark leaves-green leaves-dry charcoal roof-shingle cardboard paper-white
        cotton-white polyester-fabric leather skin water snow ice aluminium-anodised aluminium-rough
        steel-galvanised steel-rusty steel-painted metal-roof paint-white paint-black
        paint-road-marking plasterboard pvc polyethylene-film polypropylene rubber-black
        glass-painted-back"""
    for name in old.split():
        assert find_material(name).bsdf == Diffuse()


# What the wavelength changes


def test_water_darkens_at_1550_nm() -> None:
    table = material_table()
    wet = ("skin", "snow", "water", "ice")
    assert max(table[name].reflectance for name in wet) < 0.15
    assert table["snow"].reflectance < table["soil-field"].reflectance < table["brick"].reflectance


def test_snow_leaves_and_skin_are_bright_at_850_nm_and_dark_in_bands_of_water() -> None:
    for name, bright, dark in (("snow", 0.9, 0.15), ("leaves-green", 0.4, 0.2), ("skin", 0.5, 0.1)):
        at_850, *_, at_1460, at_1550 = spectrum(name)
        assert at_850 > bright
        assert at_1460 < dark < at_850 / 2
        assert at_1550 < at_850 / 1.7
    # Liquid water absorbs more at 1460 nm, ice at 1550 nm.
    assert spectrum("leaves-green")[3] < spectrum("leaves-green")[4]
    assert spectrum("snow")[4] < spectrum("snow")[3]


def test_coarse_snow_is_darker_than_fine_snow() -> None:
    fine, medium, coarse = (spectrum(name) for name in ("snow", "snow-old", "snow-coarse"))
    assert all(a > b > c for a, b, c in zip(fine, medium, coarse, strict=True))


def test_between_its_wavelengths_the_table_is_linear() -> None:
    brick = dict(zip(WAVELENGTHS_NM, spectrum("brick"), strict=True))
    assert find_material("brick", None, 1505).reflectance == pytest.approx(
        (brick[1460] + brick[1550]) / 2
    )
    assert find_material("brick", None, 922.5).reflectance == pytest.approx(
        (brick[905] + brick[940]) / 2
    )
    assert find_material("brick", None, 1600).reflectance == brick[1550]
    assert find_material("brick", None, 800).reflectance == brick[850]


@pytest.mark.parametrize("wavelength_nm", [532, 799, 991, 1064, 1320, 1409, 1601])
def test_far_from_its_wavelengths_the_table_says_nothing(wavelength_nm: float) -> None:
    message = (
        r"material 'brick': reflectance is tabulated at 850, 905, 940, 1460, 1550 nm, "
        rf"each within 50 nm; found {wavelength_nm} nm"
    )
    with pytest.raises(InputError, match=message):
        find_material("brick", None, wavelength_nm)
    own = Material("brick", 0.25, "measured")
    assert find_material("brick", {"brick": own}, wavelength_nm) is own


# Closed forms


def test_metals_follow_from_their_indices() -> None:
    for name, nm, n, k in (
        ("aluminium-polished", 850, 2.588, 8.169),
        ("aluminium-brushed", 1550, 1.579, 15.658),
        ("copper", 905, 0.303, 5.86),
        ("steel", 1460, 3.096, 5.003),
    ):
        fresnel = ((n - 1) ** 2 + k**2) / ((n + 1) ** 2 + k**2)
        assert find_material(name, None, nm).reflectance == pytest.approx(fresnel)


def test_water_and_ice_follow_from_the_indices_of_the_weather() -> None:
    for nm, ice in zip(WAVELENGTHS_NM, spectrum("ice"), strict=True):
        n = refractive_index("ice", nm).real
        assert ice == pytest.approx(((n - 1) / (n + 1)) ** 2, abs=5e-4)
        coat = find_material("water-smooth", None, nm).bsdf
        assert isinstance(coat, Plastic)
        assert coat.ior == pytest.approx(refractive_index("water", nm).real, abs=1e-4)


# Wetness


@cache
def _legendre() -> tuple[np.ndarray, np.ndarray]:
    return np.polynomial.legendre.leggauss(400)


@cache
def _mean_reflectance(ior: float) -> float:
    """Of a smooth surface for diffuse light from outside, by quadrature."""
    nodes, weights = _legendre()
    cos = (nodes + 1) / 2
    inside = np.sqrt(1 - (1 - cos**2) / ior**2)
    s = (cos - ior * inside) / (cos + ior * inside)
    p = (ior * cos - inside) / (ior * cos + inside)
    return float(weights @ (cos * (s**2 + p**2) / 2))


@pytest.mark.parametrize("ior", [1.02, 1.143, 1.31, 1.5, 2.5])
def test_mean_transmittance_of_a_surface(ior: float) -> None:
    expected = 1 - _mean_reflectance(ior)
    assert mean_fresnel_transmittance(ior) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("wavelength_nm", WAVELENGTHS_NM)
def test_wet_surface_against_a_sum_over_reflections(wavelength_nm: float) -> None:
    index = refractive_index("water", wavelength_nm)
    n, passes = index.real, np.exp(-4 * np.pi * -index.imag / (wavelength_nm * 1e-9) * 1e-4)
    up = 1 - (1 - _mean_reflectance(n)) / n**2  # back down from the water's surface
    for dry in (0.1, 0.4, 0.9):
        more = (1 - _mean_reflectance(1.5 / n)) / (1 - _mean_reflectance(1.5))
        absorbed = (1 - dry) * (dry * more + 1 - dry)  # in water instead of air
        light, left = 1 - ((n - 1) / (n + 1)) ** 2, ((n - 1) / (n + 1)) ** 2
        for _ in range(200):
            light *= passes * (1 - absorbed) * passes
            left += light * (1 - up)
            light *= up
        assert wet_reflectance(dry, wavelength_nm) == pytest.approx(left, rel=1e-6)


def test_wet_surface_in_its_limits() -> None:
    n = refractive_index("water", 850).real
    assert wet_reflectance(0, 850) == pytest.approx(((n - 1) / (n + 1)) ** 2)
    assert wet_reflectance(1, 850) == pytest.approx(1, abs=0.005)  # nothing but the water absorbs
    assert wet_reflectance(1, 1460) < 0.5


def test_wet_soil_as_measured() -> None:
    """Medians of 100 soils, dry and wet: Minasny et al. (2011), spectra in R's soilspec."""
    dry = np.array([0.385, 0.404, 0.422, 0.518, 0.552])
    wet_over_dry = np.array([0.569, 0.576, 0.582, 0.440, 0.529])
    model = [wet_reflectance(r, nm) / r for r, nm in zip(dry, WAVELENGTHS_NM, strict=True)]
    # As the documentation says: too bright below 1 µm, too dark at 1460 nm, where soil soaks light.
    off = [0.15, 0.15, 0.14, -0.20, 0.05]
    np.testing.assert_allclose(model / wet_over_dry - 1, off, atol=0.01)


@pytest.mark.parametrize(("name", "dry"), SHIPPED.wet.items())
def test_wet_is_darker_than_dry_most_of_all_where_water_absorbs(name: str, dry: str) -> None:
    assert find_material(dry).bsdf == find_material(name).bsdf == Diffuse()
    ratio = np.array(spectrum(name)) / spectrum(dry)
    assert np.all(ratio < 0.85)
    assert ratio[3] < ratio[4]
    assert ratio[3] < 0.8 * ratio[0]
    assert find_material(name).source.startswith(f"{dry}, soaked")


# Look-up


def test_a_scene_s_own_materials_come_first() -> None:
    own = Material("concrete", 0.25, "measured")
    assert find_material("concrete", {"concrete": own}) is own
    assert find_material("brick", {"concrete": own}) is material_table()["brick"]


def test_a_wavelength_is_the_same_as_integer_and_by_default() -> None:
    assert find_material("asphalt-wet") is find_material("asphalt-wet", None, 1550)
    assert material_table()["asphalt-wet"] is find_material("asphalt-wet")


def test_unknown_material_names_the_nearest() -> None:
    with pytest.raises(InputError, match=r"'conrete'.*did you mean 'concrete'"):
        find_material("conrete")
    with pytest.raises(InputError, match=r"allowed: concrete, .*concrete-wet.* and \d+ others$"):
        find_material("conrete")
    with pytest.raises(InputError, match="did you mean 'my-paint'"):
        find_material("my-paimt", {"my-paint": Material("my-paint", 0.5, "measured")})

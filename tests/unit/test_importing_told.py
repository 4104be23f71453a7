"""Surfaces as a file of Mitsuba has them, and where its heterogeneous media end."""

from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest
import trimesh
from PIL import Image

from foreign import TRIANGLE, glb, taken, triangle_header
from reconstruction.base.errors import InputError
from spisim.base.config import load_yaml
from spisim.scene import find_material
from spisim.scene.bsdf import (
    Conductor,
    Dielectric,
    Diffuse,
    Mirror,
    Plastic,
    Principled,
    RoughConductor,
    RoughDielectric,
    RoughPlastic,
    ThinPane,
)
from spisim.transport.backend import activate
from spisim_formats.library.metals import METALS, WAVELENGTHS_NM


@pytest.fixture(autouse=True)
def scalar():
    """Mitsuba without a compiler, for once."""
    before = activate()
    mi.set_variant("scalar_rgb")
    yield
    mi.set_variant(before)


def scene(path: Path, body: str) -> Path:
    path.write_text(f'<scene version="3.0.0">{body}</scene>')
    return path


RGB = '<rgb name="{}" value="0.3 0.8 0.9"/>'
GGX = '<string name="distribution" value="ggx"/><float name="alpha" value="0.2"/>'
WATER = '<string name="int_ior" value="water"/>'


@pytest.mark.parametrize(
    ("kind", "inside", "bsdf", "reflectance"),
    [
        ("diffuse", RGB.format("reflectance"), Diffuse(), 0.3),
        ("twosided", '<bsdf type="diffuse"/>', Diffuse(), 0.5),
        ("plastic", RGB.format("diffuse_reflectance"), Plastic(1.49 / 1.000277), 0.3),
        ("roughplastic", GGX, RoughPlastic(0.2, 1.49 / 1.000277), 0.5),
        ("dielectric", WATER, Dielectric(1.333 / 1.000277), None),
        ("thindielectric", WATER, ThinPane(1.333 / 1.000277), None),
        ("roughdielectric", WATER + GGX, RoughDielectric(0.2, 1.333 / 1.000277), None),
        ("roughdielectric", WATER, RoughDielectric(0.1, 1.333 / 1.000277, "beckmann"), None),
        ("conductor", '<string name="material" value="none"/>', Mirror(), 1.0),
        ("conductor", "", Mirror(), 1.0),
        ("roughconductor", "", RoughConductor(0.1, 1e-6, 1.0, "beckmann"), 1.0),
        ("conductor", '<string name="material" value="Au"/>', Conductor(0.5241, 10.74), 0.982),
        ("roughconductor", '<string name="material" value="Ni_palik"/>' + GGX,
         RoughConductor(0.2, 3.09, 7.717), 0.838),
        ("conductor", '<float name="eta" value="0.8"/><float name="k" value="6"/>',
         Conductor(0.8, 6.0), None),
        ("principled", RGB.format("base_color") + '<float name="roughness" value="0.5"/>',
         Principled(0.25, 0.0, 0.5), 0.3),
    ],
)  # fmt: skip
def test_surfaces(tmp_path: Path, kind: str, inside: str, bsdf, reflectance: float | None) -> None:
    file = scene(
        tmp_path / "a.xml", f'<shape type="cube"><bsdf type="{kind}" id="x">{inside}</bsdf></shape>'
    )
    report = taken(file, surfaces="file")
    (thing,) = report.written.scene.objects
    assert type(thing.material.bsdf) is type(bsdf)
    for name, value in vars(bsdf).items():
        result = getattr(thing.material.bsdf, name)
        assert result == (value if isinstance(value, str) else pytest.approx(value, rel=1e-5))
    if reflectance is not None:
        assert thing.material.reflectance == pytest.approx(reflectance, rel=1e-3)
    assert [match.how for match, _ in report.materials] == ["file"]


@pytest.mark.parametrize(
    "inside",
    [
        '<bsdf type="conductor"><string name="material" value="CuO"/></bsdf>',
        '<bsdf type="dielectric"><string name="int_ior" value="honey"/></bsdf>',
        '<bsdf type="roughdielectric"><float name="alpha_u" value="0.1"/></bsdf>',
        '<bsdf type="hair"/>',
    ],
)
def test_what_nothing_here_is_like_is_guessed(tmp_path: Path, inside: str) -> None:
    body = f'<shape type="cube"><bsdf type="diffuse"/></shape><shape type="sphere">{inside}</shape>'
    report = taken(scene(tmp_path / "a.xml", body), surfaces="file")
    how = {match.how for match, _ in report.materials}
    assert "file" in how
    assert how & {"guess", "default"}


def test_a_metal_by_its_name_has_its_index_at_this_wavelength(tmp_path: Path) -> None:
    """As published, which the scene file says and the report tells; no other wavelength's."""
    metal = '<string name="material" value="Au"/><float name="specular_reflectance" value="0.5"/>'
    body = f'<shape type="cube"><bsdf type="conductor" id="x">{metal}</bsdf></shape>'
    report = taken(scene(tmp_path / "a.xml", body), surfaces="file")
    (thing,) = report.written.scene.objects
    assert "Johnson & Christy (1972)" in thing.material.source
    notes = " ".join(report.notes)
    assert "Au by its name, at 1550 nm 0.524 + 10.7i, not as in visible light" in notes
    assert "its specular_reflectance 0.5 is left out" in notes
    described = load_yaml((tmp_path / "taken" / "scene.yaml").read_text(), tmp_path)
    (row,) = described["materials"].values()
    assert row["eta"][850] == 0.1641


def test_metals_have_the_indices_of_shipped_materials() -> None:
    """Both are from the same tables."""
    for name, shipped in (("Al", "aluminium-polished"), ("Cu", "copper")):
        for number, nm in enumerate(WAVELENGTHS_NM):
            bsdf = find_material(shipped, wavelength_nm=nm).bsdf
            assert METALS[name].eta[number] == pytest.approx(bsdf.eta, rel=2e-3)
            assert METALS[name].k[number] == pytest.approx(bsdf.k, rel=2e-3)


def test_other_formats_tell_no_surfaces(tmp_path: Path) -> None:
    (tmp_path / "a.glb").write_bytes(glb(triangle_header(), TRIANGLE))
    with pytest.raises(InputError, match="--surfaces file: nothing in it tells surfaces"):
        taken(tmp_path / "a.glb", surfaces="file")


@pytest.mark.parametrize("kind", ["obj", "ply"])
def test_pictures_lie_as_in_mitsuba(tmp_path: Path, kind: str) -> None:
    """A checkerboard, and the opacity in a picture, at places all over a square."""
    square = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    square.visual = trimesh.visual.TextureVisuals(uv=[[0, 0], [1, 0], [1, 1], [0, 1]])
    square.export(tmp_path / f"s.{kind}")
    grey = np.random.default_rng(4).integers(0, 255, (8, 16)).astype(np.uint8)
    Image.fromarray(grey).save(tmp_path / "o.png")
    checks = (
        '<texture type="checkerboard" name="reflectance"><rgb name="color0" value="0.7"/>'
        '<rgb name="color1" value="0.2"/><transform name="to_uv"><scale x="3" y="2"/></transform>'
        "</texture>"
    )
    opacity = (
        '<texture type="bitmap" name="opacity"><string name="filename" value="o.png"/>'
        '<boolean name="raw" value="true"/><string name="filter_type" value="nearest"/></texture>'
    )
    body = (
        f'<shape type="{kind}"><string name="filename" value="s.{kind}"/><bsdf type="mask">'
        f'{opacity}<bsdf type="diffuse">{checks}</bsdf></bsdf></shape>'
    )
    file = scene(tmp_path / "a.xml", body)
    (thing,) = taken(file, surfaces="file", up="z").written.scene.objects
    material = thing.material
    theirs = mi.load_file(str(file))
    for x, y in np.random.default_rng(5).random((40, 2)):
        ray = mi.Ray3f(mi.Point3f(x, y, 1), mi.Vector3f(0, 0, -1))
        seen = theirs.ray_intersect(ray)
        bsdf = seen.bsdf()
        clear = bsdf.eval_null_transmission(seen)[0]
        opacity_there = 1 - clear
        assert at(material.opacity, x, y) == pytest.approx(opacity_there, abs=1e-3)
        if opacity_there > 0.01:
            albedo = bsdf.eval(mi.BSDFContext(), seen, mi.Vector3f(0, 0, 1))[0] * np.pi
            ours = material.reflectance * at(material.texture, x, y)
            assert ours == pytest.approx(albedo / opacity_there, abs=1e-3)


def at(picture: np.ndarray, u: float, v: float) -> float:
    """Of the pixel there, the first row at v = 1."""
    rows, columns = picture.shape
    return float(picture[int((1 - v) * rows), int(u * columns)])


SMOKE = (
    '<shape type="{}"><medium type="heterogeneous" name="interior">'
    '<volume type="constvolume" name="sigma_t"><float name="value" value="0.5"/>'
    '<transform name="to_world"><translate x="{}"/></transform></volume></medium>'
    '<bsdf type="null"/></shape><shape type="rectangle"/>'
)


def test_media_end_where_their_grid_does(tmp_path: Path) -> None:
    """At a unit cube about (1, 0.5, 0.5), in a cube from -1 to 1."""
    report = taken(scene(tmp_path / "a.xml", SMOKE.format("cube", 0.5)))
    (volume,) = report.written.scene.volumes
    np.testing.assert_allclose(volume.to_world[:3, 3], [0.5, 0, 0], atol=1e-9)
    np.testing.assert_allclose(np.diag(volume.to_world), [0.5, 1, 1, 1], atol=1e-9)
    assert any("ends where its grid does" in note for note in report.notes)


def test_media_in_other_shapes_end_in_cells(tmp_path: Path) -> None:
    report = taken(scene(tmp_path / "a.xml", SMOKE.format("sphere", 0.5)))
    (volume,) = report.written.scene.volumes
    assert volume.density is not None
    fraction = float(volume.density.mean())  # of the box about the ball, 2 wide
    assert fraction == pytest.approx(0.5 / 8, rel=0.05)
    assert not taken(
        scene(tmp_path / "b.xml", SMOKE.format("sphere", 7)), overwrite=True
    ).written.scene.volumes


def test_milk_in_a_glass_is_in_the_object(tmp_path: Path) -> None:
    body = (
        '<shape type="cube" id="glass"><bsdf type="thindielectric"/><medium type="homogeneous" '
        'name="interior"/></shape>'
    )
    (volume,) = taken(scene(tmp_path / "a.xml", body)).written.scene.volumes
    assert volume.carrier is not None
    assert volume.carrier.name == "glass"

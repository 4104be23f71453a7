"""Materials in scene files: every BSDF by its name, and every mistake told."""

from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from reconstruction.base.errors import InputError
from spisim.scene import Material, load_scene
from spisim.scene.bsdf import (
    BSDFS,
    Bsdf,
    Conductor,
    Dielectric,
    Diffuse,
    Mirror,
    Plastic,
    Principled,
    Retroreflector,
    RoughConductor,
    RoughDielectric,
    RoughPlastic,
    ThinPane,
)
from spisim.scene.description import MaterialDescription
from spisim.scene.materials import make_material

SCENE = """
name: test
drone: {position_m: [0, 0, 1], look_at_m: [5, 0, 1]}
objects:
  - {name: wall, shape: rectangle, size_m: [4, 4], translate_m: [5, 0, 1], material: mine}
materials: {mine: {source: measured, FIELDS}}
"""
GREY = np.linspace(0, 1, 6).reshape(2, 3)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with good and bad pictures, and meshes with and without texture coordinates."""
    matplotlib.image.imsave(tmp_path / "colour.png", np.dstack([GREY, GREY, 1 - GREY]))
    _save_grey(tmp_path / "grey.png", np.uint8(np.round(255 * GREY)))
    _save_grey(tmp_path / "deep.png", np.uint16(np.round(65535 * GREY)))
    np.save(tmp_path / "grey.npy", GREY)
    np.save(tmp_path / "above.npy", GREY * 1.1)
    np.save(tmp_path / "nan.npy", GREY * np.nan)
    np.save(tmp_path / "flat.npy", GREY[0])
    (tmp_path / "broken.png").write_bytes((tmp_path / "grey.png").read_bytes()[:40])
    (tmp_path / "grey.jpg").write_bytes(b"")
    (tmp_path / "bare.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (tmp_path / "laid.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n"
    )
    return tmp_path


def _save_grey(path: Path, levels: np.ndarray) -> None:
    from PIL import Image

    Image.fromarray(levels).save(path)


def material_of(folder: Path, fields: str, item: str = "") -> Material:
    path = folder / "scene.yaml"
    text = SCENE.replace("FIELDS", fields)
    path.write_text(text.replace("shape: rectangle, size_m: [4, 4]", item) if item else text)
    return load_scene(path).objects[0].material


@pytest.mark.parametrize(
    ("fields", "bsdf"),
    [
        ("reflectance: 0.5", Diffuse()),
        ("reflectance: 0.5, bsdf: diffuse", Diffuse()),
        ("reflectance: 0.5, bsdf: plastic", Plastic(1.5)),
        ("reflectance: 0.5, bsdf: rough-plastic, roughness: 0.2, ior: 1.4", RoughPlastic(0.2, 1.4)),
        ("reflectance: 0.5, bsdf: mirror", Mirror()),
        ("bsdf: conductor, eta: 1.44, k: 16", Conductor(1.44, 16)),
        ("bsdf: rough-conductor, eta: 1.44, k: 16, roughness: 1", RoughConductor(1, 1.44, 16)),
        ("bsdf: dielectric, ior: 3.48", Dielectric(3.48)),
        ("bsdf: rough-dielectric, roughness: 0.1", RoughDielectric(0.1)),
        (
            "bsdf: rough-dielectric, roughness: 0.1, distribution: beckmann",
            RoughDielectric(0.1, distribution="beckmann"),
        ),
        ("bsdf: thin-pane", ThinPane(1.5)),
        ("reflectance: 0.5, bsdf: principled, metallic: 0.3", Principled(metallic=0.3)),
        ("reflectance: 0.5, bsdf: retroreflector, returned: 0.2", Retroreflector(0.2)),
        (
            "reflectance: 0.5, bsdf: retroreflector, returned: {850: 0.3, 1550: 0.1}",
            Retroreflector(0.1),
        ),
    ],
)
def test_every_bsdf_by_its_name(folder: Path, fields: str, bsdf: Bsdf) -> None:
    material = material_of(folder, fields)
    assert material.bsdf == bsdf
    assert material.texture is material.opacity is None
    if "reflectance" in fields:
        assert material.reflectance == 0.5


def test_every_bsdf_has_a_name() -> None:
    assert set(BSDFS.values()) == set(Bsdf.__args__)


def test_reflectance_that_follows_from_refraction(folder: Path) -> None:
    glass = material_of(folder, "bsdf: dielectric, ior: 1.5").reflectance
    assert glass == pytest.approx(0.04)
    # Two faces in a row: R + T²R + T²R³ + … = 2R / (1 + R)
    assert material_of(folder, "bsdf: thin-pane").reflectance == pytest.approx(0.08 / 1.04)
    aluminium = material_of(folder, "bsdf: conductor, eta: 1.44, k: 16").reflectance
    assert aluminium == pytest.approx((0.44**2 + 256) / (2.44**2 + 256))


def test_values_by_wavelength(folder: Path) -> None:
    assert material_of(folder, "reflectance: {850: 0.4, 1550: 0.3}").reflectance == 0.3
    assert material_of(folder, "reflectance: {1540: 0.4, 1560: 0.3}").reflectance == 0.35
    metal = material_of(folder, "bsdf: conductor, eta: {850: 2.6, 1550: 1.5}, k: 16").bsdf
    assert metal == Conductor(1.5, 16)
    glass = material_of(folder, "bsdf: dielectric, ior: {905: 1.51, 1500: 1.5}")
    assert glass.reflectance == pytest.approx(0.04)


def test_own_values_at_another_wavelength(folder: Path) -> None:
    described = MaterialDescription.model_validate(
        {"source": "measured", "reflectance": {850: 0.4, 905: 0.5, 1550: 0.3}}
    )
    for nm, expected in ((850, 0.4), (877.5, 0.45), (955, 0.5 - 0.2 * 50 / 645)):
        assert make_material("m", described, folder, nm).reflectance == pytest.approx(expected)
    with pytest.raises(InputError, match=r"is tabulated at 850, 905, 1550 nm.* 1460 nm"):
        make_material("m", described, folder, 1460)
    plain = MaterialDescription.model_validate({"source": "measured", "reflectance": 0.4})
    assert make_material("m", plain, folder, 532).reflectance == 0.4


def test_pictures_are_read_as_they_stand(folder: Path) -> None:
    for name, tolerance in (("grey.png", 2e-3), ("deep.png", 1e-5), ("grey.npy", 1e-7)):
        texture = material_of(folder, f"reflectance: 0.5, texture: {name}").texture
        assert texture is not None
        assert texture.dtype == np.float32
        np.testing.assert_allclose(texture, GREY, atol=tolerance)
    assert material_of(folder, "reflectance: 0.5, opacity: 0.25").opacity == 0.25
    mask = material_of(folder, "reflectance: 0.5, opacity: grey.npy").opacity
    np.testing.assert_allclose(np.asarray(mask), GREY, rtol=1e-6)


@pytest.mark.parametrize(
    ("fields", "parts"),
    [
        ("bsdf: diffuse", ["reflectance is missing"]),
        ("reflectance: 0.5, bsdf: rough-plastik", ["'rough-plastik'", "'rough-plastic'"]),
        ("reflectance: 0.5, bsdf: rough-plastic", ["rough-plastic needs roughness"]),
        ("reflectance: 0.5, bsdf: mirror, ior: 1.5", ["ior does not go with bsdf mirror"]),
        ("reflectance: 0.5, roughness: 0.3", ["roughness does not go with bsdf diffuse"]),
        ("reflectance: 0.5, bsdf: plastic, rougness: 1", ["did you mean 'roughness'"]),
        ("reflectance: 0.5, bsdf: rough-plastic, roughness: 0", ["between 0.01 and 1", "found 0"]),
        ("reflectance: 0.5, bsdf: rough-plastic, roughness: 2", ["between 0.01 and 1", "found 2"]),
        (
            "bsdf: rough-dielectric, roughness: 0.1, distribution: bekmann",
            ["mine.distribution", "'ggx' or 'beckmann'", "found 'bekmann'"],
        ),
        (
            "reflectance: 0.5, bsdf: principled, distribution: ggx",
            ["distribution does not go with bsdf principled"],
        ),
        ("reflectance: 0.5, bsdf: plastic, ior: 1", ["ior should be greater than 1"]),
        ("reflectance: 0.5, bsdf: plastic, ior: 4", ["not above 3", "found 4"]),
        ("reflectance: 0.5, bsdf: plastic, ior: yes", ["ior", "number", "True"]),
        ("reflectance: 0.5, bsdf: principled, metallic: 1.1", ["metallic", "found 1.1"]),
        ("reflectance: 0.5, bsdf: principled, specular: 0", ["specular", "found 0"]),
        ("reflectance: 0.04, bsdf: dielectric", ["reflectance does not go", "0.04 at normal"]),
        ("bsdf: dielectric, ior: 0.9", ["ior should be greater than 1"]),
        ("bsdf: conductor, eta: 1.44", ["conductor needs k"]),
        ("bsdf: conductor, eta: -1, k: 5", ["eta and k", "found -1"]),
        ("bsdf: conductor, eta: 0.0, k: 5", ["eta and k", "found 0"]),
        ("bsdf: thin-pane, texture: grey.png", ["texture does not go with a clear surface"]),
        ("reflectance: {850: 0.4}", ["reflectance is tabulated at 850 nm", "found 1550 nm"]),
        ("reflectance: {0.85: 0.4, 1.55: 0.3}", ["tabulated at 0.85, 1.55 nm"]),
        ("reflectance: {850: 0.4, 1550: 1.3}", ["mine.reflectance.1550", "equal to 1", "1.3"]),
        ("reflectance: {1550: yes}", ["mine.reflectance.1550", "number", "True"]),
        ("reflectance: {-1550: 0.5}", ["mine.reflectance.-1550", "greater than 0"]),
        ("reflectance: {red: 0.5}", ["mine.reflectance.red", "number"]),
        ("reflectance: {}", ["mine.reflectance", "at least 1"]),
        ("reflectance: [0.4]", ["mine.reflectance", "number"]),
        ("bsdf: conductor, eta: {850: 2}, k: 16", ["eta is tabulated at 850 nm"]),
        ("bsdf: conductor, eta: {1550: -2}, k: 16", ["eta and k", "found -2"]),
        ("reflectance: 0.5, bsdf: mirror, ior: {1550: 1.5}", ["ior does not go with bsdf mirror"]),
        ("reflectance: 0.4, bsdf: retroreflector", ["retroreflector needs returned"]),
        ("reflectance: 0.9, bsdf: retroreflector, returned: 0.2", ["add up to 1", "0.2 and 0.9"]),
        ("reflectance: 0.4, bsdf: retroreflector, returned: -1", ["returned", "0 and 1", "-1"]),
        (
            "reflectance: 0.4, bsdf: retroreflector, returned: 0.2, roughness: 0.0001",
            ["roughness", "0.001 and 1", "0.0001"],
        ),
        ("reflectance: 0.5, opacity: 1.5", ["opacity", "less than or equal to 1", "1.5"]),
        ("reflectance: 0.5, opacity: yes", ["opacity", "number", "True"]),
        ("reflectance: 0.5, texture: gray.png", ["no picture 'gray.png'", "'grey.png'"]),
        ("reflectance: 0.5, opacity: gray.npy", ["no picture 'gray.npy'", "'grey.npy'"]),
        ("reflectance: 0.5, texture: colour.png", ["should be grey", "(2, 3, 4)"]),
        ("reflectance: 0.5, texture: flat.npy", ["should be grey", "(3,)"]),
        ("reflectance: 0.5, texture: above.npy", ["'above.npy'", "from 0 to 1"]),
        ("reflectance: 0.5, texture: nan.npy", ["'nan.npy'", "from 0 to 1"]),
        ("reflectance: 0.5, texture: broken.png", ["'broken.png' cannot be read"]),
        ("reflectance: 0.5, texture: grey.jpg", ["'grey.jpg'", "PNG or NPY"]),
    ],
)
def test_mistake_in_a_material(folder: Path, fields: str, parts: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        material_of(folder, fields)
    message = str(caught.value)
    for part in ("scene.yaml: materials.mine", *parts):
        assert part in message
    assert len(message.splitlines()) == 1


@pytest.mark.parametrize("fields", ["texture: grey.png", "opacity: grey.png"])
def test_pictures_need_texture_coordinates(folder: Path, fields: str) -> None:
    fields = f"reflectance: 0.5, {fields}"
    assert material_of(folder, fields, "mesh: laid.obj").needs_texture_coordinates
    with pytest.raises(InputError, match=r"objects\[0\] \(wall\): mesh 'bare\.obj' has no texture"):
        material_of(folder, fields, "mesh: bare.obj")
    with pytest.raises(InputError, match=r"objects\[0\] \(wall\): this shape has no texture"):
        material_of(folder, fields, "shape: sphere, radius_m: 1")
    material_of(folder, "reflectance: 0.5, opacity: 0.5", "mesh: bare.obj")

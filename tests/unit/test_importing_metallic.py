"""Surfaces by metalness and roughness, as other programs' files have them."""

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from foreign import glb, taken, triangle_header
from reconstruction.base.errors import InputError
from spisim.scene import Material
from spisim.scene.bsdf import Principled

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")
UV = np.array([[0, 0], [1, 0], [0, 1]], "<f4")
#: Dark, rough and no metal on the left, bright, smooth and half a metal on the right; sRGB.
COLOURS = np.zeros((2, 4, 4), np.uint8)
COLOURS[:, :2] = 0, 200, 0, 255
COLOURS[:, 2:] = 188, 100, 128, 51


def gltf(folder: Path, pbr: dict[str, Any] | None, **material: Any) -> Path:
    """A triangle with coordinates, and a picture that `pbr` may refer to."""
    stored = io.BytesIO()
    Image.fromarray(COLOURS).save(stored, "png")
    blocks = [CORNERS.tobytes(), UV.tobytes(), stored.getvalue()]
    starts = np.cumsum([0, *map(len, blocks)]).tolist()
    views = [{"buffer": 0, "byteOffset": start, "byteLength": len(block)}
             for start, block in zip(starts, blocks, strict=False)]  # fmt: skip
    header = triangle_header(
        bufferViews=views,
        buffers=[{"byteLength": starts[-1]}],
        images=[{"bufferView": 2}],
        textures=[{"source": 0}],
        materials=[{"name": "Gold plate", **material}],
    )
    if pbr is not None:
        header["materials"][0]["pbrMetallicRoughness"] = pbr
    header["accessors"] += [{"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"}]
    primitive = {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}
    header["meshes"][0]["primitives"] = [primitive]
    (folder / "a.glb").write_bytes(glb(header, b"".join(blocks)))
    return folder / "a.glb"


def material(file: Path) -> tuple[Material, str]:
    """What the surface became, and the notes."""
    report = taken(file, surfaces="file")
    (thing,) = report.written.scene.objects
    assert [match.how for match, _ in report.materials] == ["file"]
    return thing.material, " ".join(report.notes)


def test_numbers(tmp_path: Path) -> None:
    """GGX's width is the square of the roughness; all that is left out is told."""
    pbr = {"baseColorFactor": [0.3, 0.9, 0.9, 0.5], "metallicFactor": 0.25, "roughnessFactor": 0.6}
    extensions = {
        "KHR_materials_ior": {"ior": 1.33},
        "KHR_materials_clearcoat": {"clearcoatFactor": 1},
    }
    result, notes = material(
        gltf(tmp_path, pbr, emissiveFactor=[1, 0, 0], normalTexture={"index": 0},
             extensions=extensions)
    )  # fmt: skip
    assert isinstance(result.bsdf, Principled)
    assert result.bsdf.roughness == pytest.approx(0.36)
    assert result.bsdf.metallic == 0.25
    assert result.bsdf.specular == pytest.approx((0.33 / 2.33) ** 2 / 0.08, rel=1e-4)
    assert result.reflectance == pytest.approx(0.3)
    assert result.opacity is None  # opaque, unless alphaMode says otherwise
    for reported in (
        "its bumps are left out",
        "its own light is left out",
        "clearcoat is left out",
    ):
        assert reported in notes


def test_what_a_file_does_not_say(tmp_path: Path) -> None:
    """glTF's defaults: a white, rough metal."""
    result, _ = material(gltf(tmp_path, {}))
    assert (result.reflectance, result.bsdf) == (1.0, Principled(1.0, 1.0, 0.5))


def test_pictures(tmp_path: Path) -> None:
    """Red with sRGB's curve, roughness in green and metal in blue without, as means."""
    pbr = {
        "baseColorTexture": {"index": 0},
        "baseColorFactor": [0.5, 1, 1, 0.5],
        "metallicRoughnessTexture": {"index": 0},
        "roughnessFactor": 0.5,
    }
    result, notes = material(gltf(tmp_path, pbr, alphaMode="BLEND"))
    assert isinstance(result.bsdf, Principled)
    linear = ((188 / 255 + 0.055) / 1.055) ** 2.4
    assert result.texture is not None
    np.testing.assert_allclose(
        result.reflectance * result.texture[0], [0, 0, linear / 2, linear / 2], atol=1e-4
    )
    np.testing.assert_allclose(np.asarray(result.opacity)[1], [0.5, 0.5, 0.1, 0.1], atol=1e-4)
    assert result.bsdf.metallic == pytest.approx(128 / 255 / 2, rel=1e-4)
    assert result.bsdf.roughness == pytest.approx((0.5 * 150 / 255) ** 2, rel=1e-4)
    assert "its picture of metal is a mean" in notes
    assert "its picture of roughness is a mean" in notes


def test_opacity_with_a_cut_and_pictures_that_lie_otherwise(tmp_path: Path) -> None:
    moved = {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [2, 2]}}}
    result, notes = material(
        gltf(tmp_path, {"baseColorTexture": moved, "metallicFactor": 0}, alphaMode="MASK")
    )
    assert result.opacity == pytest.approx(0.5)
    assert result.texture is None
    assert "its picture of reflectance is laid on otherwise: a mean" in notes


@pytest.mark.parametrize(
    ("pbr", "more"),
    [
        (None, {}),
        ({"baseColorTexture": {"index": 7}}, {}),
        ({"metallicFactor": -1}, {}),
        ({}, {"extensions": {"KHR_materials_unlit": {}}}),
        ({}, {"extensions": {"KHR_materials_transmission": {"transmissionFactor": 1}}}),
    ],
)
def test_what_is_no_such_surface_is_guessed(tmp_path: Path, pbr: Any, more: dict) -> None:
    with pytest.raises(InputError, match="nothing in it tells surfaces"):
        taken(gltf(tmp_path, pbr, **more), surfaces="file")
    assert len(taken(gltf(tmp_path, pbr, **more)).materials) == 1


STAGE = """#usda 1.0
(
  metersPerUnit = 1
  upAxis = "Z"
)
def Mesh "sheet" (
  prepend apiSchemas = ["MaterialBindingAPI"]
)
{{
  point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
  int[] faceVertexCounts = [3]
  int[] faceVertexIndices = [0, 1, 2]
  texCoord2f[] primvars:st = [(0, 0), (1, 0), (0, 1)] (
    interpolation = "vertex"
  )
  rel material:binding = </plate>
}}
def Material "plate"
{{
  float inputs:smooth = 0.5
  token outputs:surface.connect = </plate/surface.outputs:surface>
  def Shader "surface"
  {{
    uniform token info:id = "UsdPreviewSurface"
    {inputs}
    token outputs:surface
  }}
  def Shader "picture"
  {{
    uniform token info:id = "UsdUVTexture"
    asset inputs:file = @{file}@
    float4 inputs:scale = (0.5, 1, 1, 1)
    token inputs:sourceColorSpace = "{space}"
    float2 inputs:st.connect = </plate/place.outputs:result>
    float3 outputs:rgb
    float outputs:g
    float outputs:b
    float outputs:a
  }}
  def Shader "place"
  {{
    uniform token info:id = "UsdPrimvarReader_float2"
    string inputs:varname = "{varname}"
    float2 outputs:result
  }}
}}
"""


def stage(folder: Path, *inputs: str, **changes: str) -> Path:
    """A triangle of a preview surface with these inputs."""
    Image.fromarray(COLOURS).save(folder / "c.png")
    lines = "\n    ".join(line.replace("<", "</plate/picture.outputs:") for line in inputs)
    fields = {"inputs": lines, "file": "c.png", "space": "sRGB", "varname": "st"} | changes
    (folder / "a.usda").write_text(STAGE.format(**fields))
    return folder / "a.usda"


COLOURED = "color3f inputs:diffuseColor.connect = <rgb>"


def test_a_preview_surface(tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    file = stage(
        tmp_path,
        "color3f inputs:diffuseColor = (0.3, 0.9, 0.9)",
        "float inputs:roughness.connect = </plate.inputs:smooth>".replace("</plate", "PLATE"),
        "float inputs:metallic = 0.25",
        "float inputs:opacity = 0.75",
        "float inputs:clearcoat = 1",
        "normal3f inputs:normal = (0, 0, 1)",
    )
    file.write_text(file.read_text().replace("PLATE", "</plate"))
    result, notes = material(file)
    assert result.bsdf == Principled(0.25, 0.25, 0.5)
    assert result.reflectance == pytest.approx(0.3)
    assert result.opacity == pytest.approx(0.75)
    assert "its clear coat is left out" in notes
    assert "bumps" not in notes


def test_pictures_of_a_preview_surface(tmp_path: Path) -> None:
    pytest.importorskip("pxr")
    file = stage(
        tmp_path,
        COLOURED,
        "float inputs:roughness.connect = <g>",
        "float inputs:metallic.connect = <b>",
        "float inputs:opacity.connect = <a>",
        "float inputs:opacityThreshold = 0.5",
        "color3f inputs:emissiveColor = (1, 0, 0)",
    )
    result, notes = material(file)
    linear = ((188 / 255 + 0.055) / 1.055) ** 2.4
    assert result.texture is not None
    np.testing.assert_allclose(
        result.reflectance * result.texture[0], [0, 0, linear / 2, linear / 2], atol=1e-4
    )
    np.testing.assert_allclose(np.asarray(result.opacity)[1], [1, 1, 0, 0])
    assert isinstance(result.bsdf, Principled)
    assert result.bsdf.roughness == pytest.approx((150 / 255) ** 2, rel=1e-4)
    assert result.bsdf.metallic == pytest.approx(64 / 255, rel=1e-4)
    assert "its own light is left out" in notes


def test_a_mean_of_a_preview_surface_that_is_guessed(tmp_path: Path) -> None:
    """As of other formats' pictures: the rule of thumb."""
    pytest.importorskip("pxr")
    (thing,) = taken(stage(tmp_path, COLOURED)).written.scene.objects
    red = 188 * 51 / (255 + 51) / 255 * 0.5 ** (1 / 2.2)  # where it is not transparent
    assert thing.material.reflectance == pytest.approx(0.7 * red, abs=2e-3)


@pytest.mark.parametrize(
    ("inputs", "changes", "reported"),
    [
        ([COLOURED], {"file": "gone.png"}, "gone.png"),
        ([COLOURED], {"file": "/etc/gone.png"}, "outside the folders"),
        (["int inputs:useSpecularWorkflow = 1"], {}, ""),
    ],
)
def test_preview_surfaces_that_are_not_read(
    tmp_path: Path, inputs: list[str], changes: dict[str, str], reported: str
) -> None:
    pytest.importorskip("pxr")
    with pytest.raises(InputError, match="nothing in it tells surfaces"):
        taken(stage(tmp_path, *inputs, **changes), surfaces="file")
    assert reported in " ".join(taken(tmp_path / "a.usda").notes)


def world(folder: Path, metal: str, more: str = "") -> Path:
    """A box of SDFormat."""
    Image.fromarray(COLOURS).save(folder / "c.png")
    (folder / "a.sdf").write_text(
        "<sdf version='1.9'><model name='m'><link name='l'><visual name='v'><geometry><box/>"
        f"</geometry><transparency>0.25</transparency><material>{more}<pbr>{metal}</pbr>"
        "</material></visual></link></model></sdf>"
    )
    return folder / "a.sdf"


@pytest.mark.parametrize(
    ("metal", "expected"),
    [
        ("<metal/>", Principled(0.25, 0.5, 0.5)),
        ("<metal><metalness>0.9</metalness><roughness>0.2</roughness></metal>",
         Principled(0.04, 0.9, 0.5)),
        ("<metal><roughness_map>c.png</roughness_map><metalness>0</metalness>"
         "<normal_map>c.png</normal_map></metal>",
         Principled(round((94 / 255) ** 2, 6), 0.0, 0.5)),
    ],
)  # fmt: skip
def test_surfaces_of_gazebo(tmp_path: Path, metal: str, expected: Principled) -> None:
    result, notes = material(world(tmp_path, metal, "<diffuse>0.3 0.8 0.8 1</diffuse>"))
    assert result.bsdf == expected
    assert result.reflectance == pytest.approx(0.3)
    assert result.opacity == pytest.approx(0.75)
    assert ("its bumps are left out" in notes) == ("normal_map" in metal)


@pytest.mark.parametrize(
    "metal", ["", "<specular/>", "<metal><albedo_map>x.png</albedo_map></metal>"]
)
def test_surfaces_of_gazebo_that_are_guessed(tmp_path: Path, metal: str) -> None:
    with pytest.raises(InputError, match="nothing in it tells surfaces"):
        taken(world(tmp_path, metal), surfaces="file")

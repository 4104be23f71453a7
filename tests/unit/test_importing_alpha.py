"""Alpha of pictures: cut-outs stay where the format takes them so, else a note names them."""

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from foreign import taken
from spisim.scene.materials import find_material
from spisim_formats import Import

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n"
SDF = (
    '<sdf version="1.9"><world name="w"><model name="m"><link name="l"><visual name="v">'
    "<geometry>{}</geometry>{}</visual></link></model></world></sdf>"
)
MESH = "<mesh><uri>{}.obj</uri></mesh>"
ALBEDO = "<material><pbr><metal><albedo_map>half.png</albedo_map></metal></pbr></material>"
HALF_CLEAR = "<transparency>0.5</transparency>"
MITSUBA = (
    '<scene version="3.0.0"><shape type="{}"><bsdf type="{}"><texture type="bitmap" name="{}">'
    '<string name="filename" value="{}.png"/><boolean name="raw" value="true"/></texture>{}</bsdf>'
    "</shape></scene>"
)
USD = """#usda 1.0
(metersPerUnit = 1
upAxis = "Z")
def Mesh "q" (prepend apiSchemas = ["MaterialBindingAPI"])
{{
    point3f[] points = [(0,0,0), (1,0,0), (1,0,1), (0,0,1)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token orientation = "{hand}"
    texCoord2f[] primvars:st = [(0,0), (1,0), (1,1), (0,1)] (interpolation = "{kind}")
    rel material:binding = </mat>
}}
def Material "mat"
{{
    token outputs:surface.connect = </mat/s.outputs:surface>
    def Shader "s"
    {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </mat/t.outputs:rgb>
        {opacity}
        token outputs:surface
    }}
    def Shader "t"
    {{
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @{file}@
        float2 inputs:st.connect = </mat/r.outputs:result>
        float3 outputs:rgb
        float outputs:a
    }}
    def Shader "r"
    {{
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result
    }}
}}
"""
CONNECTED = "float inputs:opacity.connect = </mat/t.outputs:a>"


def usd(kind: str, opacity: str = CONNECTED, hand: str = "rightHanded") -> str:
    return USD.format(kind=kind, opacity=opacity, hand=hand, file="half.png")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """White pictures, the left halves opaque, of alpha 0.2 or grey to the right, and squares."""
    pixels = np.full((4, 8, 4), 255, np.uint8)
    pixels[:, 4:, 3] = 51
    Image.fromarray(pixels).save(tmp_path / "half.png")
    Image.fromarray(pixels[..., 3]).save(tmp_path / "grey.png")
    (tmp_path / "plain.obj").write_text(SQUARE)
    for name, mask in (("pictured", ""), ("cut", "map_d half.png\n")):
        (tmp_path / f"{name}.mtl").write_text(f"newmtl brick\nmap_Kd half.png\n{mask}")
        text = f"mtllib {name}.mtl\nusemtl brick\n{SQUARE}"
        (tmp_path / f"{name}.obj").write_text(text)
    return tmp_path


def read(folder: Path, name: str, text: str = "") -> Import:
    if name.endswith("usda"):
        pytest.importorskip("pxr")
    if text:
        (folder / name).write_text(text)
    return taken(folder / name)


@pytest.mark.parametrize(
    ("name", "text", "right"),
    [
        ("mesh.sdf", SDF.format(MESH.format("plain"), ALBEDO), 0.0),
        ("plane.sdf", SDF.format("<plane><size>1 1</size></plane>", ALBEDO), 0.0),
        ("thin.sdf", SDF.format(MESH.format("plain"), ALBEDO + HALF_CLEAR), 0.0),
        ("own.sdf", SDF.format(MESH.format("cut"), HALF_CLEAR), 0.1),
        ("card.xml", MITSUBA.format("rectangle", "mask", "opacity", "grey",
                                    '<bsdf type="diffuse"/>'), 0.2),
        ("a.usda", usd("vertex"), 0.2),
        ("a.usda", usd("faceVarying"), 0.2),
        ("a.usda", usd("faceVarying", hand="leftHanded"), 0.2),
    ],
)  # fmt: skip
def test_cut_outs_lie_as_in_the_picture(folder: Path, name: str, text: str, right: float) -> None:
    """Gazebo cuts the alpha of an albedo map at 0.5; its transparency multiplies that."""
    report = read(folder, name, text)
    (thing,) = report.written.scene.objects
    left = 0.5 if HALF_CLEAR in text else 1.0
    np.testing.assert_allclose(thing.material.opacity[0, [0, 7]], [left, right], atol=2e-3)
    across = thing.mesh.vertices[:, 0]
    np.testing.assert_allclose(
        thing.mesh.visual.uv[:, 0], (across - across.min()) / np.ptp(across), atol=1e-6
    )
    assert "alpha" not in " ".join(report.notes)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("pictured.obj", ""),
        ("a.xml", MITSUBA.format("rectangle", "diffuse", "reflectance", "half", "")),
        ("a.xml", MITSUBA.format("rectangle", "mask", "opacity", "half", '<bsdf type="diffuse"/>')),
        ("a.usda", usd("vertex", "")),
    ],
)
def test_alpha_that_the_format_ignores_is_named(folder: Path, name: str, text: str) -> None:
    """As Blender and three.js take MTL, and Mitsuba its bitmaps."""
    report = read(folder, name, text)
    (thing,) = report.written.scene.objects
    assert thing.material.opacity is None
    assert sum("alpha" in note for note in report.notes) == 1


def test_opacity_stays_where_the_picture_of_colours_is_missing(folder: Path) -> None:
    text = usd("vertex", "float inputs:opacity = 0.3").replace("half.png", "gone.png")
    (thing,) = read(folder, "a.usda", text).written.scene.objects
    assert thing.material.opacity == pytest.approx(0.3)
    assert thing.material.reflectance == find_material("concrete").reflectance


def test_opacity_that_cannot_be_read_is_warned_of(folder: Path) -> None:
    report = read(folder, "a.usda", usd("vertex").replace("half.png", "gone.png"))
    assert any(re.match("material 'mat': its opacity", each) for each in report.warnings)


def test_mirrored_rectangles_mirror_their_pictures(folder: Path) -> None:
    """x and y of the picture go where the file's pose puts them."""
    card = MITSUBA.format("rectangle", "mask", "opacity", "grey", '<bsdf type="diffuse"/>')
    flip = '<transform name="to_world"><scale x="-1"/></transform></shape>'
    (thing,) = read(folder, "a.xml", card.replace("</shape>", flip)).written.scene.objects
    across = thing.mesh.vertices[:, 0]
    np.testing.assert_allclose(thing.mesh.visual.uv[:, 0], (1 - across) / 2, atol=1e-6)

"""Whatever of a file is left out, the report names; fog and transparency are kept, or warned of."""

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from foreign import TRIANGLE, collada, glb, taken, triangle_header
from reconstruction.base.errors import InputError
from spisim.scene.bsdf import ThinPane
from spisim.scene.materials import find_material
from spisim.scene.model import Material

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
FACE = "f 1/1 2/2 3/3 4/4\n"
PLY = """ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
{properties}element face 1
property list uchar int vertex_indices
{elements}end_header
{rows}3 0 1 2
"""
USD = """#usda 1.0
(metersPerUnit = 1
upAxis = "Z")
def Cube "a"
{{
    double size = 1
    {body}
}}
{more}
"""

SHADER = """def Shader "s"
{{
    uniform token info:id = "UsdPreviewSurface"
    color3f inputs:diffuseColor = (1, 1, 1)
    {}
}}"""


def mitsuba(body: str, more: str = "") -> str:
    return f'<scene version="3.0.0"><shape type="cube" id="wall">{body}</shape>{more}</scene>'


def sdf(body: str = "", more: str = "", scene: str = "") -> str:
    return (
        f'<sdf version="1.9"><world name="w">{scene}<model name="m"><link name="l">'
        f'<visual name="v"><geometry><box><size>1 1 1</size></box></geometry>{body}</visual>{more}'
        "</link></model></world></sdf>"
    )


def urdf(body: str = "", box: str = "") -> str:
    return (
        f'<robot name="r"><link name="l"><visual><geometry><box size="1 1 1" {box}/></geometry>'
        f"{body}</visual></link></robot>"
    )


def gltf(**changes: Any) -> bytes:
    return glb(triangle_header(**changes), TRIANGLE)


def primitive(**changes: Any) -> list[dict[str, Any]]:
    return [{"primitives": [{"attributes": {"POSITION": 0}, **changes}]}]


def stl(attribute: int) -> bytes:
    return bytes(80) + struct.pack("<I12fH", 1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, attribute)


def ply(properties: str = "", elements: str = "", numbers: str = "") -> str:
    rows = "".join(f"{row} {numbers}\n" for row in ("0 0 0", "1 0 0", "0 1 0"))
    return PLY.format(properties=properties, elements=elements, rows=rows)


def file(path: Path, content: str | bytes) -> Path:
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


@pytest.mark.parametrize(
    ("name", "plain", "more", "note"),
    [
        ("a.xml", mitsuba(""), mitsuba('<float name="fuzz" value="1"/>'), "cube shape: fuzz"),
        ("a.xml", mitsuba(""), mitsuba('<bsdf type="diffuse" name="moss"/><texture type="hills" '
         'name="bump"/>'), "cube shape: hills texture 'bump'"),
        ("a.sdf", sdf(), sdf("<plush/>"), "<visual>: <plush>"),
        ("a.sdf", sdf(), sdf("<material wet='1'/>"), "<material>: wet"),
        ("a.sdf", sdf(), sdf("", "<hologram/>"), "<link>: <hologram>"),
        ("a.urdf", urdf(), urdf("<plush/>"), "<visual>: <plush>"),
        ("a.urdf", urdf(), urdf("", "rounded='1'"), "<box>: <rounded>"),
        ("a.dae", collada(), collada().replace("<scene>", "<library_clouds/><scene>"),
         "<COLLADA>: <library_clouds>"),
        ("a.dae", collada(), collada().replace('<node id="a"', '<node id="a" wet="1"'),
         "<node>: wet"),
        ("a.dae", collada(), collada().replace("<phong>", "<phong><fur><float>1</float></fur>"),
         "<phong>: <fur>"),
        ("a.glb", gltf(), gltf(nodes=[{"mesh": 0, "plush": 1}]), "nodes: plush"),
        ("a.glb", gltf(), gltf(nodes=[{"mesh": 0, "extensions": {"X_fur": {}}}]), "X_fur"),
        ("a.glb", gltf(), gltf(scenes=[{"nodes": [0], "extensions": {"X_fur": {}}}]),
         "a.glb: not read of extensions: X_fur"),
        ("a.glb", gltf(), gltf(nodes=[{"mesh": 0, "extras": {"of": "moss"}}]), "nodes: extras"),
        ("a.glb", gltf(), gltf(clouds=[]), "a.glb: not read: clouds"),
        ("a.obj", SQUARE + FACE, SQUARE + FACE + "curv 0 1 1 2\n", "a.obj: not read: curv"),
        ("a.obj", SQUARE + FACE, SQUARE + FACE + "_fur 1\n", "a.obj: not read: _fur"),
        ("a.ply", ply(), ply("property float heat\n", "", "3"), "vertex: heat"),
        ("a.ply", ply(), ply("", "element camera 0\nproperty float f\n"), "not read: camera"),
        ("a.stl", stl(0), stl(0x8FFF), "triangles: attribute"),
        ("a.stl", stl(0), b"COLOR=".ljust(80) + stl(0)[80:], "header: COLOR"),
        ("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
         "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 255 0 0\n", "faces: further numbers"),
        ("a.usda", USD.format(body="", more=""), USD.format(body="float fuzz = 1", more=""),
         "Cube: fuzz"),
        ("a.usda", USD.format(body="", more=""), USD.format(body="", more='def Fur "f" {}'),
         "not read: Fur"),
        ("a.usda", USD.format(body="", more=""), USD.format(body="rel fur = </a>", more=""),
         "Cube: fur"),
        ("a.usda", USD.format(body="", more=""),
         USD.format(body='string userProperties:fur = "long"', more=""), "userProperties:fur"),
        ("a.usda", USD.format(body="", more=SHADER.format("")),
         USD.format(body="", more=SHADER.format("float inputs:fur = 1")), "inputs:fur"),
        ("a.usda", USD.format(body="", more=SHADER.format("")),
         USD.format(body="", more=SHADER.format("").replace("UsdPreviewSurface", "Fur")),
         "Shader Fur"),
    ],
)  # fmt: skip
def test_what_no_reader_asks_for_is_named(
    tmp_path: Path, name: str, plain: str, more: str, note: str
) -> None:
    """Once, and nothing of what is read or harmless is."""
    if name.endswith("usda"):
        pytest.importorskip("pxr")
    clean = taken(file(tmp_path / name, plain))
    assert "not read" not in " ".join(clean.notes + clean.warnings)
    report = taken(file(tmp_path / name, more), overwrite=True)
    assert sum(note in each for each in report.notes) == 1, report.notes


def test_spectra_of_files_are_named(tmp_path: Path) -> None:
    """Mitsuba would open them."""
    body = '<bsdf type="conductor"><spectrum name="eta" filename="gold.spd"/></bsdf>'
    notes = taken(file(tmp_path / "a.xml", mitsuba(body))).notes
    assert "a.xml: not read of conductor: 'eta' of 'gold.spd'" in notes


def test_keywords_of_material_libraries_are_named(tmp_path: Path) -> None:
    file(tmp_path / "a.mtl", "newmtl brick\nKd 1 1 1\nKd 1 1 1\nPr 0.5\nd half\n")
    report = taken(file(tmp_path / "a.obj", f"mtllib a.mtl\n{SQUARE}usemtl brick\n{FACE}"))
    assert "a.mtl: not read of materials: Pr" in report.notes
    assert "a.mtl: not read: 'd half'" in report.notes


def test_a_part_that_fails_is_named_once(tmp_path: Path) -> None:
    """What is in it is not listed besides."""
    bad = "<visual name='b'><plush/><geometry><box><size>x</size></box></geometry></visual>"
    report = taken(file(tmp_path / "a.sdf", sdf("", bad)))
    assert len(report.notes) == 1
    assert "visual 'b'" in report.notes[0]


def test_guessed_surfaces_name_what_only_the_file_s_own_have(tmp_path: Path) -> None:
    body = '<bsdf type="dielectric"><string name="int_ior" value="water"/></bsdf>'
    path = file(tmp_path / "a.xml", mitsuba(body))
    assert "a.xml: not read of dielectric bsdf: int_ior" in taken(path).notes
    assert "not read" not in " ".join(taken(path, surfaces="file", overwrite=True).notes)


def test_the_second_surface_of_a_mixture_is_named(tmp_path: Path) -> None:
    body = (
        '<bsdf type="blendbsdf"><float name="weight" value="0.5"/><bsdf type="diffuse"/>'
        '<bsdf type="plastic"/></bsdf>'
    )
    notes = taken(file(tmp_path / "a.xml", mitsuba(body))).notes
    assert "a.xml: not read of blendbsdf: weight, plastic bsdf" in notes


FOG = (
    '<medium type="homogeneous" id="fog"><float name="sigma_t" value="0.1"/>'
    '<float name="albedo" value="0.9"/><phase type="hg"><float name="g" value="0.7"/></phase>'
    "</medium>"
)
IN_FOG = '<sensor type="perspective"><ref id="fog" name="medium"/><ref id="no-film"/></sensor>'


def test_the_medium_of_a_sensor_is_fog(tmp_path: Path) -> None:
    """Per unit of the file; shapes and lamps in the same medium add nothing."""
    body = mitsuba('<ref name="exterior" id="fog"/>', FOG + IN_FOG)
    report = taken(file(tmp_path / "a.xml", body), units="cm", scale=50)
    media = report.written.scene.atmosphere
    assert media.extinction_per_m == pytest.approx(0.2)
    assert media.albedo == pytest.approx(0.9)
    assert not report.warnings


@pytest.mark.parametrize(
    ("body", "more"),
    [
        ('<ref name="exterior" id="fog"/>', FOG),
        ("", FOG.replace("homogeneous", "heterogeneous") + IN_FOG),
        ("", FOG + '<emitter type="point"><ref id="fog" name="medium"/></emitter>'),
    ],
)
def test_fog_that_cannot_be_placed_is_warned_of(tmp_path: Path, body: str, more: str) -> None:
    report = taken(file(tmp_path / "a.xml", mitsuba(body, more)))
    assert any("fills space outside of shapes and is left out" in w for w in report.warnings)


def test_a_sensor_in_a_box_of_fog_makes_no_more_of_it(tmp_path: Path) -> None:
    box = '<ref name="interior" id="fog"/><bsdf type="null"/>'
    more = FOG + IN_FOG + '<shape type="rectangle"/>'
    scene = taken(file(tmp_path / "a.xml", mitsuba(box, more))).written.scene
    assert scene.atmosphere is None or scene.atmosphere.extinction_per_m == 0
    assert len(scene.volumes) == 1


@pytest.mark.parametrize(
    ("fog", "visibility_m"),
    [
        ("<type>linear</type><start>1</start><end>21</end>", 20.0),
        ("<type>exp</type><density>0.1</density>", -np.log(0.05) / 0.1),
        ("<type>exp2</type><density>0.1</density>", np.sqrt(-np.log(0.05)) / 0.1),
    ],
)
def test_gazebo_s_fog_has_its_visibility(tmp_path: Path, fog: str, visibility_m: float) -> None:
    """Of the light that Gazebo draws, 5 % is left at that distance."""
    body = sdf(scene=f"<scene><fog>{fog}<color>1 1 1</color></fog></scene>")
    taken(file(tmp_path / "a.sdf", body))
    text = (tmp_path / "taken" / "scene.yaml").read_text()
    assert f"visibility_m: {visibility_m:.4g}" in text
    assert "definition: mor" in text


@pytest.mark.parametrize(
    "body",
    [
        sdf(scene="<scene><fog><type>quadratic</type></fog></scene>"),
        sdf("", '<particle_emitter name="smoke"/>'),
    ],
)
def test_fog_and_smoke_that_are_left_out_are_warned_of(tmp_path: Path, body: str) -> None:
    report = taken(file(tmp_path / "a.sdf", body))
    assert any(("fog" in each or "particle_emitter" in each) for each in report.warnings)


def half_picture(path: Path) -> None:
    """White, the left half opaque."""
    pixels = np.full((4, 8, 4), 255, np.uint8)
    pixels[:, 4:, 3] = 51  # 0.2
    Image.fromarray(pixels).save(path)


def sheet(folder: Path, **material: Any) -> Path:
    """A glTF sheet with the picture of `half_picture`."""
    half_picture(folder / "half.png")
    numbers = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")
    uv = np.array([[0, 0], [1, 0], [0, 1]], "<f4")
    data = numbers[:3].tobytes() + uv.tobytes()
    header = triangle_header(
        meshes=primitive(attributes={"POSITION": 0, "TEXCOORD_0": 1}, material=0),
        accessors=[
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"},
        ],
        bufferViews=[
            {"buffer": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 24},
        ],
        buffers=[{"byteLength": 60}],
        images=[{"uri": "half.png"}],
        textures=[{"source": 0}],
        materials=[{"name": "brick", **material}],
    )
    return file(folder / "a.glb", glb(header, data))


PICTURE = {"baseColorTexture": {"index": 0}}


@pytest.mark.parametrize(
    ("mode", "alpha", "opaque"),
    [
        ({"alphaMode": "MASK"}, 1.0, [1.0, 0.0]),
        ({"alphaMode": "MASK", "alphaCutoff": 0.1}, 1.0, None),
        ({"alphaMode": "BLEND"}, 0.5, [0.5, 0.1]),
        ({}, 0.5, None),
    ],
)
def test_cut_outs_of_gltf_stay(
    tmp_path: Path, mode: dict[str, Any], alpha: float, opaque: list[float] | None
) -> None:
    """By default, where the material is guessed by its name."""
    pbr = {**PICTURE, "baseColorFactor": [1, 1, 1, alpha]}
    material = only_material(taken(sheet(tmp_path, pbrMetallicRoughness=pbr, **mode)))
    if opaque is None:
        assert material.opacity is None
        return
    np.testing.assert_allclose(material.opacity[0, [0, 7]], opaque, atol=2e-3)
    assert material.reflectance == find_material("brick").reflectance


def only_material(report: Any) -> Material:
    (thing,) = report.written.scene.objects
    return thing.material


@pytest.mark.parametrize(
    ("lines", "opaque"),
    [
        ("d 0.1", 0.1),
        ("Tr 0.9", 0.1),
        ("d 1\nTr 0.9", None),
        ("map_d half.png", [1.0, 0.2]),
        ("map_d half.png\nd 0.5", [0.5, 0.1]),
        ("map_d grey.png", [1.0, 0.4]),
    ],
)
def test_cut_outs_of_obj_stay(tmp_path: Path, lines: str, opaque: Any) -> None:
    """A picture's opacity is its alpha, or how bright it is without one."""
    half_picture(tmp_path / "half.png")
    grey = np.full((4, 8), 255, np.uint8)
    grey[:, 4:] = 102
    Image.fromarray(grey).save(tmp_path / "grey.png")
    file(tmp_path / "a.mtl", f"newmtl brick\n{lines}\n")
    report = taken(file(tmp_path / "a.obj", f"mtllib a.mtl\n{SQUARE}usemtl brick\n{FACE}"))
    opacity = only_material(report).opacity
    if isinstance(opaque, list):
        np.testing.assert_allclose(opacity[0, [0, 7]], opaque, atol=2e-3)
    else:
        assert opacity == opaque


def test_surfaces_that_let_all_light_pass_are_left_out(tmp_path: Path) -> None:
    file(tmp_path / "a.mtl", "newmtl brick\nd 0.0\nnewmtl grass\nKd 0 1 0\n")
    body = f"mtllib a.mtl\n{SQUARE}usemtl brick\n{FACE}usemtl grass\n{FACE}"
    report = taken(file(tmp_path / "a.obj", body))
    assert only_material(report).name == "grass"
    assert any("lets all light pass" in note for note in report.notes)
    assert report.warnings


@pytest.mark.parametrize(
    ("name", "body", "opaque"),
    [
        ("a.sdf", sdf("<transparency>0.75</transparency>"), 0.25),
        ("a.xml", mitsuba('<bsdf type="mask"><float name="opacity" value="0.25"/>'
                          '<bsdf type="diffuse"/></bsdf>'), 0.25),
        ("a.dae", collada().replace("</diffuse>", "</diffuse><transparent><color>1 1 1 1</color>"
         "</transparent><transparency><float>0.25</float></transparency>"), 0.25),
    ],
)  # fmt: skip
def test_transparency_of_other_formats_stays(
    tmp_path: Path, name: str, body: str, opaque: float
) -> None:
    report = taken(file(tmp_path / name, body))
    assert {thing.material.opacity for thing in report.written.scene.objects} == {opaque}


@pytest.mark.parametrize(("mode", "opaque"), [("A_ONE", [1.0, 0.2]), ("RGB_ZERO", [0.75, 0.75])])
def test_pictures_of_transparency_of_collada_stay(
    tmp_path: Path, mode: str, opaque: list[float]
) -> None:
    """Without texture coordinates their mean counts."""
    half_picture(tmp_path / "half.png")
    picture = (
        '<newparam sid="u"><surface type="2D"><init_from>i</init_from></surface></newparam>'
        '<newparam sid="w"><sampler2D><source>u</source></sampler2D></newparam><technique sid="t">'
    )
    transparent = (
        f'</diffuse><transparent opaque="{mode}"><texture texture="w" texcoord="c"/></transparent>'
        "<transparency><float>0.25</float></transparency>"
    )
    body = collada(texture="half.png").replace('<technique sid="t">', picture)
    report = taken(file(tmp_path / "a.dae", body.replace("</diffuse>", transparent)))
    expected = np.mean(opaque) if mode == "RGB_ZERO" else 0.25 * np.mean(opaque)
    for thing in report.written.scene.objects:
        assert thing.material.opacity == pytest.approx(expected, rel=2e-3)
    assert not report.warnings


def test_equal_transparency_makes_one_material(tmp_path: Path) -> None:
    visual = (
        '<visual name="{}"><pose>{} 0 0 0 0 0</pose><geometry><sphere/></geometry>'
        "<transparency>0.75</transparency></visual>"
    )
    more = "".join(visual.format(f"v{number}", 3 * number) for number in (1, 2))
    taken(file(tmp_path / "a.sdf", sdf("", more)))
    text = (tmp_path / "taken" / "scene.yaml").read_text()
    assert text.count("opacity: 0.25") == 1


def test_what_colladas_call_transparent_altogether_stays_with_a_warning(tmp_path: Path) -> None:
    body = collada().replace(
        "</diffuse>", "</diffuse><transparency><float>0</float></transparency>"
    )
    report = taken(file(tmp_path / "a.dae", body))
    assert any("it is taken for opaque" in warning for warning in report.warnings)


def test_a_pane_is_as_clear_as_glass_is(tmp_path: Path) -> None:
    """Its refraction says already how much passes."""
    file(tmp_path / "a.mtl", "newmtl glass-pane\nd 0.1\n")
    report = taken(file(tmp_path / "a.obj", f"mtllib a.mtl\n{SQUARE}usemtl glass-pane\n{FACE}"))
    material = only_material(report)
    assert isinstance(material.bsdf, ThinPane)
    assert material.opacity is None


@pytest.mark.parametrize(
    ("name", "body"),
    [
        ("a.ply", ply("property uchar red\nproperty uchar green\nproperty uchar blue\n", "",
                      "5 5 5")),
        ("a.obj", "v 0 0 0 .02 .02 .02\nv 1 0 0 .02 .02 .02\nv 0 1 0 .02 .02 .02\nf 1 2 3\n"),
    ],
)  # fmt: skip
def test_colours_at_vertices_count(tmp_path: Path, name: str, body: str) -> None:
    report = taken(file(tmp_path / name, body))
    assert only_material(report).name == "paint-black"
    assert any("colours at vertices count by their mean" in note for note in report.notes)


def colored(make: Callable[..., bytes] = glb, factor: float = 1.0, **material: Any) -> bytes:
    """A glTF triangle with red 0.5, 0 and 1 at its vertices, so 0.5 in the mean."""
    colors = np.array([[0.5, 1, 1], [0, 1, 1], [1, 1, 1]], "<f4")
    rows = [{"bufferView": i, "componentType": 5126, "count": 3, "type": "VEC3"} for i in range(2)]
    views = [{"buffer": 0, "byteOffset": 36 * i, "byteLength": 36} for i in range(2)]
    pbr = {"baseColorFactor": [factor, 1, 1, 1], "metallicFactor": 0}
    header = triangle_header(
        meshes=primitive(attributes={"POSITION": 0, "COLOR_0": 1}, material=0),
        accessors=rows, bufferViews=views, buffers=[{"byteLength": 72}],
        materials=[{"name": "m", "pbrMetallicRoughness": pbr, **material}],
    )  # fmt: skip
    return make(header, TRIANGLE + colors.tobytes())


def test_colours_at_vertices_of_gltf_multiply_the_material_s(tmp_path: Path) -> None:
    report = taken(file(tmp_path / "a.glb", colored(factor=0.6)), surfaces="file")
    assert only_material(report).reflectance == pytest.approx(0.3, rel=1e-3)


def test_hidden_nodes_of_gltf_are_left_out(tmp_path: Path) -> None:
    hidden = {"KHR_node_visibility": {"visible": False}}
    nodes = [{"mesh": 0}, {"children": [2], "extensions": hidden}, {"mesh": 0}]
    report = taken(file(tmp_path / "a.glb", gltf(nodes=nodes, scenes=[{"nodes": [0, 1]}])))
    assert len(report.written.scene.objects) == 1
    assert "nodes that the file hides are left out, with all below" in report.notes


def test_only_hidden_nodes_are_refused(tmp_path: Path) -> None:
    hidden = {"KHR_node_visibility": {"visible": False}}
    with pytest.raises(InputError, match="holds no triangles"):
        taken(file(tmp_path / "a.glb", gltf(nodes=[{"mesh": 0, "extensions": hidden}])))


@pytest.mark.parametrize(
    ("mesh", "node", "scale"), [([1.0], None, 3.0), ([1.0], [0.5], 2.0), (None, None, 1.0)]
)
def test_morphs_of_gltf_have_their_weights(
    tmp_path: Path, mesh: list[float] | None, node: list[float] | None, scale: float
) -> None:
    """The target moves every vertex by twice its place; a node's weights come before the mesh's."""
    move = (2 * np.frombuffer(TRIANGLE, "<f4")).tobytes()
    rows = [{"bufferView": i, "componentType": 5126, "count": 3, "type": "VEC3"} for i in range(2)]
    views = [{"buffer": 0, "byteOffset": 36 * i, "byteLength": 36} for i in range(2)]
    meshes: list[dict[str, Any]] = primitive(targets=[{"POSITION": 1}])
    nodes: list[dict[str, Any]] = [{"mesh": 0}]
    if mesh is not None:
        meshes[0]["weights"] = mesh
    if node is not None:
        nodes[0]["weights"] = node
    header = triangle_header(meshes=meshes, nodes=nodes, accessors=rows, bufferViews=views,
                             buffers=[{"byteLength": 72}])  # fmt: skip
    report = taken(file(tmp_path / "a.gltf", json.dumps(with_data(header, TRIANGLE + move))))
    extents = trimesh.util.concatenate([t.mesh for t in report.written.scene.objects]).extents
    assert extents.max() == pytest.approx(scale)


def with_data(header: dict[str, Any], data: bytes) -> dict[str, Any]:
    """The header with its buffer within."""
    import base64

    header["buffers"][0]["uri"] = "data:;base64," + base64.b64encode(data).decode()
    return header

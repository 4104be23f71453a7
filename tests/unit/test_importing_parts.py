"""One bad part of a foreign file is left out, and noted; all else is read as if it were not there.

Bombs, links out of the folders and sizes stay refused, on the lenient way, too.
"""

import io
import itertools
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from foreign import (
    TRIANGLE,
    assert_same,
    collada,
    glb,
    taken,
    tetrahedron,
    triangle_header,
    written,
)
from reconstruction.base.errors import InputError
from spisim.scene.description import BoxObject, CylinderObject, SphereObject
from spisim_formats.library.units import _resized
from spisim_formats.library.xml import parse_lenient_xml

BOX = "<box><size>1 2 3</size></box>"
LAUGHS = "<!DOCTYPE x [<!ENTITY a 'ha'>" + "".join(
    f"<!ENTITY {name} '{f'&{before};' * 10}'>" for before, name in itertools.pairwise("abcdefghi")
)


def sdf(path: Path, *geometries: str, more: str = "") -> Path:
    """A world of one model to each geometry, a metre apart."""
    models = "".join(
        f"<model name='m{k}'><pose>{2 * k} 0 0 0 0 0</pose><link name='l'>"
        f"<visual name='v'><geometry>{geometry}</geometry></visual></link></model>"
        for k, geometry in enumerate(geometries)
    )
    path.write_text(f"<sdf version='1.9'><world name='w'>{models}{more}</world></sdf>")
    return path


def mesh(uri: str, more: str = "") -> str:
    return f"<mesh><uri>{uri}</uri>{more}</mesh>"


def left_out(report) -> list[str]:
    assert any("left out; the notes say" in each for each in report.warnings)
    return [note for note in report.notes if note.startswith("left out: ")]


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("crate</d", "bed curtains / rail & curtain <3 &nbsp;</d"),
        ("name='l'", "name=l"),
        ("name='l'", "name='l' name='other' hidden"),
        ("crate</d", "a\x01b</d"),
        ("crate", "<!-- a -- b -->"),
        ("<sdf", "<!-- first -->\n<?xml version='1.0'?>\n<sdf"),
        ("<sdf", "\n <?xml version='1.0'?><sdf"),
        ("name='l'", "name='l' gz:kind='a'"),
        ("<d>crate</d>", "<a::b>1</a::b>"),
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_xml_that_can_be_mended(tmp_path: Path, before: str, after: str, encoding: str) -> None:
    text = "<sdf version='1.9'><model name='m'><d>crate</d><link name='l'><visual name='v'>"
    text += f"<geometry>{BOX}</geometry></visual></link></model></sdf>"
    assert before in text
    (tmp_path / "a.sdf").write_bytes(text.replace(before, after, 1).encode(encoding))
    report = taken(tmp_path / "a.sdf")
    assert_same(written(report), trimesh.creation.box((1, 2, 3)))
    assert any(
        "a.sdf: not valid XML" in note and "as it was meant" in note for note in report.notes
    )


def test_texts_are_what_they_were_meant_to_be() -> None:
    text = "<a k='x & y' n=3><![CDATA[1 & 2 < 3]]> & &lt;b> &#65; &eacute;</a>"
    notes: list[str] = []
    root = parse_lenient_xml(text.encode(), Path("a.xml"), notes.append)
    assert (root.attrib, root.text) == ({"k": "x & y", "n": "3"}, "1 & 2 < 3 & <b> A &eacute;")
    assert len(notes) == 1


@pytest.mark.parametrize(
    "text",
    [
        LAUGHS + "]><sdf><d>&i; & &i;</d></sdf>",
        "<!DOCTYPE x [<!ENTITY a SYSTEM 'file:///etc/hostname'>]><sdf n=1>&a;</sdf>",
        "<!-- a -- b --><!DOCTYPE x SYSTEM 'http://x.org/x.dtd'><sdf>&</sdf>",
        "<sdf><model name='m'>&",
        "<sdf><model name='m'></sdf> & ",
        "<sdf>" * 1000 + "&" + "</sdf>" * 1000,
    ],
)
def test_the_lenient_way_is_no_way_around(tmp_path: Path, text: str) -> None:
    """Neither entities, nor other files, nor what is cut off, nor depth."""
    (tmp_path / "a.sdf").write_text(text)
    with pytest.raises(InputError, match=r"document type|not valid XML|nested more than"):
        taken(tmp_path / "a.sdf")


@pytest.mark.parametrize(
    "piece", ["<!--", "<![CDATA[", "<?", "<a '\"", '<a b="', "<a x ", "&", "<"]
)
def test_mending_takes_time_in_proportion(piece: str) -> None:
    """A quadratic search would take minutes."""
    with pytest.raises(InputError):
        parse_lenient_xml(piece.encode() * 100_000, Path("a.xml"), print)


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        (mesh("gone.dae"), "no file 'gone.dae'"),
        (mesh("../secret.stl"), "outside the folders"),
        (mesh("bad.stl"), "bad.stl: cannot be read as STL"),
        (mesh("a.stl", "<submesh><name>nose</name></submesh>"), "no submesh 'nose'"),
        (mesh("a.stl", "<scale>1 0 1</scale>"), "a scale is zero"),
        ("<bax/>", "geometry bax is unknown"),
        ("<sphere><radius>-1</radius></sphere>", "radius should be a positive number"),
    ],
)
def test_visuals(tmp_path: Path, bad: str, message: str) -> None:
    (tmp_path / "in").mkdir()
    tetrahedron().export(tmp_path / "secret.stl")
    tetrahedron().export(tmp_path / "in" / "a.stl")
    (tmp_path / "in" / "bad.stl").write_bytes(bytes(90))
    report = taken(sdf(tmp_path / "in" / "a.sdf", BOX, bad))
    assert_same(written(report), trimesh.creation.box((1, 2, 3)))
    (note,) = left_out(report)
    assert "model 'm1'" in note
    assert message in note
    with pytest.raises(InputError, match=message):
        taken(sdf(tmp_path / "in" / "b.sdf", bad), overwrite=True)


def test_models_and_what_describes_them(tmp_path: Path) -> None:
    """A broken description of a model is no reason to lose it; a bomb in one loses that alone."""
    for name, config in (
        ("crate", "<model><sdf>model.sdf</sdf><description>a & b</description></model>"),
        ("cut", "<model><sdf>mod"),
        ("laughs", LAUGHS + "]><model><sdf>&i;</sdf></model>"),
    ):
        (tmp_path / name).mkdir()
        sdf(tmp_path / name / "model.sdf", BOX)
        text = (tmp_path / name / "model.sdf").read_text()
        text = text.replace("<world name='w'>", "").replace("</world>", "")
        (tmp_path / name / "model.sdf").write_text(text)
        (tmp_path / name / "model.config").write_text(config)
    (tmp_path / "bomb").mkdir()
    (tmp_path / "bomb" / "model.sdf").write_text(LAUGHS + "]><sdf>&i; &</sdf>")
    includes = "".join(
        f"<include><uri>model://{name}</uri><name>{name}</name></include>"
        for name in ("crate", "cut", "laughs", "bomb", "../secret", "gone")
    )
    report = taken(sdf(tmp_path / "a.sdf", more=includes))
    assert len(report.written.scene.objects) == 3
    message = " ".join(left_out(report))
    for word in ("cut/model.config", "laughs/model.config", "bomb/model.sdf", "secret", "gone"):
        assert word in message


def test_older_roots(tmp_path: Path) -> None:
    file = sdf(tmp_path / "a.sdf", BOX)
    file.write_text(file.read_text().replace("sdf version='1.9'", "gazebo version='1.2'")
                    .replace("</sdf>", "</gazebo>"))  # fmt: skip
    assert_same(written(taken(file)), trimesh.creation.box((1, 2, 3)))


@pytest.mark.parametrize("folder", ["models", "."])
def test_files_in_the_model_path(tmp_path: Path, folder: str) -> None:
    """`file://models/…` is meant from one of Gazebo's folders, or is in the folder `models`."""
    (tmp_path / "worlds").mkdir()
    (tmp_path / "models" / "crate" / "meshes").mkdir(parents=True)
    tetrahedron().export(tmp_path / "models" / "crate" / "meshes" / "a.stl")
    file = sdf(tmp_path / "worlds" / "a.sdf", mesh("file://models/crate/meshes/a.stl"))
    assert taken(file, model_path=(tmp_path / folder,)).triangles == 4
    other = sdf(tmp_path / "worlds" / "b.sdf", mesh("file://models/../../crate/meshes/a.stl"))
    with pytest.raises(InputError, match=r"outside the folders|no file"):
        taken(other, model_path=(tmp_path / folder,), overwrite=True)


def test_groups_of_obj_are_submeshes(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 5\ng nose\nusemtl red\nf 1 2 3\n"
    (tmp_path / "a.obj").write_text(text + "g tail\nusemtl red\nf 1 2 4\n")
    report = taken(sdf(tmp_path / "a.sdf", mesh("a.obj", "<submesh><name>nose</name></submesh>")))
    assert report.triangles == 1
    assert report.bounds_m[1, 2] == 0


TWO = (
    collada()
    .replace(
        "</library_geometries>",
        '<geometry id="h"><mesh><source id="q"><float_array id="qa" count="9">{}</float_array>'
        '<technique_common><accessor source="#qa" count="3" stride="3">'
        '<param name="X" type="float"/>'
        '<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common>'
        '</source><vertices id="w"><input semantic="POSITION" source="#q"/></vertices><triangles '
        'count="1"><input semantic="VERTEX" source="#w" offset="0"/><p>0 1 2</p></triangles></mesh>'
        "</geometry></library_geometries>",
    )
    .replace(
        "</visual_scene>", '<node name="other"><instance_geometry url="#h"/></node></visual_scene>'
    )
)
SOUND = "0 0 0 1 0 0 0 1 0"


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        (SOUND, "0 0 0 1 0 0 0 NaN 0", "geometry 'h': a float_array has numbers that are not fin"),
        (SOUND, "0 0 0 1 0 0 0 x 0", "geometry 'h': Corrupted"),
        (SOUND, "0 0 0 1 0 0", "geometry 'h'"),
        (SOUND, "0 0 0 1 0 0 2 0 0", "has no area"),
        ("<p>0 1 2<", "<p>0 1 7<", "geometry 'h'"),
        ('url="#h"', 'url="#k"', "geometry '#k' is not in the file"),
        ('name="other">', 'name="other"><translate>0 0</translate>', "node 'other': its translate"),
        ('name="other">', 'name="other"><translate>0 0 inf</translate>', "not made of finite"),
    ],
)
def test_geometries_of_collada(tmp_path: Path, before: str, after: str, message: str) -> None:
    sound = TWO.replace("{}", SOUND)
    assert before in sound
    (tmp_path / "a.dae").write_text(collada())
    (tmp_path / "b.dae").write_text(sound.replace(before, after))
    expected = written(taken(tmp_path / "a.dae"))
    report = taken(tmp_path / "b.dae", overwrite=True)
    assert_same(written(report), expected)
    assert message in " ".join(left_out(report))


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("<diffuse><color>0.9 0.9 0.9 1</color></diffuse>",
         '<diffuse><texture texture="i"/></diffuse>', "the reference to a file is empty"),
        ('<instance_effect url="#e"/>', '<instance_effect url="#gone"/>', "gone"),
        ("0.9 0.9 0.9 1", "0.9 x 0.9 1", "effect 'e'"),
        ('url="#s"', 'url="#gone"', "gone"),
        ('name="first"', "name=first", "as it was meant"),
        ("Rusty Steel", "Rust & Steel", "as it was meant"),
    ],
)  # fmt: skip
def test_materials_and_pictures_of_collada(
    tmp_path: Path, before: str, after: str, message: str
) -> None:
    """All geometry stays where a picture has no file, an effect is broken, or a text is."""
    text = collada(texture="x").replace("<init_from>x</init_from>", "")
    (tmp_path / "a.dae").write_text(collada())
    (tmp_path / "b.dae").write_text(text.replace(before, after))
    expected = written(taken(tmp_path / "a.dae"))
    report = taken(tmp_path / "b.dae", overwrite=True)
    assert_same(written(report), expected)
    assert message in " ".join(report.notes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"nodes": [{"mesh": 0, "children": [0]}]}, "node 0 is reached twice"),
        ({"nodes": [{"mesh": 0}], "scenes": [{"nodes": [0, 0]}]}, "node 0 is reached twice"),
        ({"nodes": [{"mesh": 0}, {"mesh": 7}], "scenes": [{"nodes": [0, 1]}]}, "refers to mesh 7"),
        ({"nodes": [{"mesh": 0}, {"mesh": 0, "scale": "x"}], "scenes": [{"nodes": [0, 1]}]},
         "node 1: cannot be read|a scale"),
        ({"nodes": [{"mesh": 0}, {"mesh": 0, "scale": [1, 0, 1]}], "scenes": [{"nodes": [0, 1]}]},
         "a scale is zero"),
        ({"nodes": [{"mesh": 0}, {"mesh": 0, "translation": [1e9, 0, 0]}],
          "scenes": [{"nodes": [0, 1]}]}, "reaches 1e+09 m"),
        ({"meshes": [{"primitives": [{"attributes": {"POSITION": 0}},
                                     {"attributes": {"POSITION": 5}}]}]}, "refers to accessor 5"),
        ({"meshes": [{"primitives": [{"attributes": {"POSITION": 0}},
                                     {"attributes": {}}]}]}, "mesh 'mesh 0': cannot be read"),
        ({"meshes": [{"primitives": [{"attributes": {"POSITION": 0}},
                                     {"attributes": {"POSITION": 1}}]}],
          "buffers": [{"byteLength": 36}, {"byteLength": 36, "uri": "gone.bin"}],
          "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 1, "byteLength": 36}],
          "accessors": [{"bufferView": i, "componentType": 5126, "count": 3, "type": "VEC3"}
                        for i in range(2)]}, "no file 'gone.bin'"),
    ],
)  # fmt: skip
def test_parts_of_gltf(tmp_path: Path, changes: dict, message: str) -> None:
    (tmp_path / "a.glb").write_bytes(glb(triangle_header(), TRIANGLE))
    (tmp_path / "b.glb").write_bytes(glb(triangle_header(**changes), TRIANGLE))
    report = taken(tmp_path / "a.glb")
    again = taken(tmp_path / "b.glb", overwrite=True)
    assert again.triangles == report.triangles == 1
    np.testing.assert_allclose(again.bounds_m, report.bounds_m)
    assert any(word in " ".join(left_out(again)) for word in message.split("|"))


def test_notes_have_an_end(tmp_path: Path) -> None:
    report = taken(sdf(tmp_path / "a.sdf", BOX, *["<bax/>"] * 1100))
    assert len(report.notes) == 1000
    assert report.notes[-1] == "and more like these"


STAGE = """#usda 1.0
(
  metersPerUnit = 1
  upAxis = "Z"
)
def Xform "hall" {arcs}
{{
  def Cube "crate" (prepend apiSchemas = ["MaterialBindingAPI"])
  {{
    rel material:binding = </hall/m1>
  }}
  def Material "m1"
  {{
    token outputs:surface.connect = </hall/m1/shader.outputs:surface>
    def Shader "shader"
    {{
      uniform token info:id = "UsdPreviewSurface"
      color3f inputs:diffuseColor.connect = </hall/m1/picture.outputs:rgb>
      token outputs:surface
    }}
    def Shader "picture"
    {{
      uniform token info:id = "UsdUVTexture"
      asset inputs:file = @{picture}@
      float3 outputs:rgb
    }}
  }}
  {more}
}}
"""
CUBE = trimesh.creation.box((2, 2, 2))
TRIANGLE_POINTS = "point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]"


def stage(path: Path, arcs: str = "", more: str = "", picture: str = "a.png") -> Path:
    pytest.importorskip("pxr")
    path.write_text(STAGE.format(arcs=arcs, more=more, picture=picture))
    return path


def package(path: Path, files: dict[str, bytes], compression: int = zipfile.ZIP_STORED) -> Path:
    """A package whose files begin at multiples of 64 bytes, as they must."""
    pytest.importorskip("pxr")
    with zipfile.ZipFile(path, "w", compression) as archive:
        for name, data in files.items():
            header = zipfile.ZipInfo(name)
            header.compress_type = compression
            header.extra = bytes(-(archive.start_dir + 30 + len(name)) % 64)
            archive.writestr(header, data)
    return path


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("paint.mtlx", "<?xml version='1.0'?><materialx/>", "cannot be read as OpenUSD"),
        ("bad.usda", "no layer", "cannot be read as OpenUSD"),
        ("gone.usda", None, "there is no such file"),
        ("`${NAME}`.usda", None, "there is no such file"),
    ],
)
@pytest.mark.parametrize("arc", ["references", "payload"])
def test_layers(tmp_path: Path, name: str, text: str | None, message: str, arc: str) -> None:
    """A stage stays where one of its layers is none, and the layer's file is not changed."""
    file = stage(tmp_path / "a.usda", f"(prepend {arc} = @./{name}@)")
    if text is not None:
        (tmp_path / name).write_text(text)
    before = file.read_text()
    report = taken(file)
    assert_same(written(report), CUBE)
    (note,) = left_out(report)
    assert name in note
    assert message in note
    assert file.read_text() == before


def test_layers_outside_of_the_folders(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    stage(tmp_path / "secret.usda")
    (tmp_path / "in" / "link.usda").symlink_to(tmp_path / "secret.usda")
    for reference in ("../secret.usda", "./link.usda", str(tmp_path / "secret.usda")):
        file = stage(tmp_path / "in" / "a.usda", f"(prepend references = @{reference}@)")
        with pytest.raises(InputError, match="outside the folders"):
            taken(file, overwrite=True)


@pytest.mark.parametrize(
    "lines",
    [
        ('def Mesh "m"', "int[] faceVertexCounts = [3]", "int[] faceVertexIndices = [0, 1, 7]",
         TRIANGLE_POINTS, "vertex not in the file"),
        ('def Mesh "m"', "int[] faceVertexCounts = [3, 3]", "int[] faceVertexIndices = [0, 1, 2]",
         TRIANGLE_POINTS, "do not fit"),
        ('def Sphere "m"', "double radius = -1", "radius should be a positive number"),
        ('def Cube "m"', "double3 xformOp:scale = (1, 0, 1)",
         'uniform token[] xformOpOrder = ["xformOp:scale"]', "a scale is zero"),
    ],
)  # fmt: skip
def test_prims(tmp_path: Path, lines: tuple[str, ...]) -> None:
    kind, *fields, message = lines
    more = "\n".join([kind, "{", *fields, "}"])
    report = taken(stage(tmp_path / "a.usda", more=more))
    assert_same(written(report), CUBE)
    assert message in " ".join(left_out(report))


def test_packages(tmp_path: Path) -> None:
    """A layer, another that it refers to, one that is missing, and a picture."""
    text = stage(tmp_path / "a.usda", picture="maps/a.png").read_text()
    arcs = "(prepend references = [@b.usda@, @gone.usda@])"
    first = '#usda 1.0\n(\n metersPerUnit = 1\n upAxis = "Z"\n)\ndef "hall" ' + arcs + " {}"
    inner = text.replace('def Xform "hall"', 'def Xform "hall" ').replace(
        ' metersPerUnit = 1', ' defaultPrim = "hall"\n metersPerUnit = 1')  # fmt: skip
    picture = io.BytesIO()
    Image.new("RGB", (2, 2), (188, 0, 0)).save(picture, "png")
    files = {"a.usda": first.encode(), "b.usda": inner.encode(), "maps/a.png": picture.getvalue()}
    report = taken(package(tmp_path / "a.usdz", files))
    assert_same(written(report), CUBE)
    (thing,) = report.written.scene.objects
    assert thing.material.reflectance == pytest.approx(0.7 * 188 / 255, abs=2e-3)
    assert any("gone.usda" in note for note in left_out(report))


@pytest.mark.parametrize("name", ["../a.usda", "/etc/a.usda", "b/../../a.usda", "C:/a.usda"])
def test_packages_that_reach_out(tmp_path: Path, name: str) -> None:
    text = stage(tmp_path / "b.usda").read_bytes()
    with pytest.raises(InputError, match="holds a file outside of it"):
        taken(package(tmp_path / "a.usdz", {"a.usda": text, name: text}))


def test_packages_that_refer_out(tmp_path: Path) -> None:
    """Beside a package's own files there are none by a relative path, and none by others."""
    (tmp_path / "in").mkdir()
    stage(tmp_path / "secret.usda")
    for reference in ("../secret.usda", "../../secret.usda"):
        text = stage(tmp_path / "b.usda", f"(prepend references = @{reference}@)").read_bytes()
        file = package(tmp_path / "in" / "a.usdz", {"a.usda": text})
        report = taken(file, overwrite=True)
        assert_same(written(report), CUBE)
        assert any("there is no such file" in note for note in left_out(report))
    reference = str(tmp_path / "secret.usda")
    text = stage(tmp_path / "b.usda", f"(prepend references = @{reference}@)").read_bytes()
    with pytest.raises(InputError, match="outside the folders"):
        taken(package(tmp_path / "in" / "a.usdz", {"a.usda": text}), overwrite=True)


def test_packages_that_are_bombs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = stage(tmp_path / "b.usda").read_bytes()
    file = package(tmp_path / "a.usdz", {"a.usda": text + b"\n" * 10**7}, zipfile.ZIP_DEFLATED)
    with pytest.raises(InputError, match="compressed or encrypted"):
        taken(file)
    (tmp_path / "b.usdz").write_bytes(b"PK\x03\x04" + bytes(100))
    with pytest.raises(InputError, match="no archive"):
        taken(tmp_path / "b.usdz")
    monkeypatch.setattr("spisim_formats.usd.package.MAX_FILES", 1)
    with pytest.raises(InputError, match="2 files; more than 1"):
        taken(package(tmp_path / "c.usdz", {"a.usda": text, "b.usda": text}))


def test_shapes_grow_with_the_unit_of_their_file() -> None:
    given = {"name": "a", "material": "white"}
    box = BoxObject(shape="box", size_m=(1, 2, 3), **given)
    rod = CylinderObject(shape="cylinder", radius_m=1, height_m=4, **given)
    assert _resized(box, 0.5).size_m == (0.5, 1, 1.5)
    assert _resized(SphereObject(shape="sphere", radius_m=3, **given), 0.5).radius_m == 1.5
    assert (_resized(rod, 0.5).radius_m, _resized(rod, 0.5).height_m) == (0.5, 2)

"""Textures of foreign files: their mean, or the whole picture, as reflectance at 1550 nm."""

import base64
import io
import struct
import zlib
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from commands import mistake
from foreign import MILLIMETRES_Y_UP, TRIANGLE, collada, glb, taken, triangle_header
from reconstruction.base.errors import InputError
from spisim.base.config import linear
from spisim.base.config.linear import read_exr_red
from spisim.scene import load_scene
from spisim.scene.shapes import texture_coordinates
from spisim_formats.library.textures import GAMMA, RULE

#: Left half dark, right half bright red; green and blue do not count.
PICTURE = np.zeros((4, 8, 3), np.uint8)
PICTURE[:, :4] = 51, 255, 0
PICTURE[:, 4:] = 204, 0, 255
MEAN = 0.5
OBJ = "mtllib a.mtl\nv 0 0 0\nv 4 0 0\nv 0 4 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m1\nf 1/1 2/2 3/3\n"


def packed(picture: np.ndarray = PICTURE, form: str = "png") -> bytes:
    data = io.BytesIO()
    Image.fromarray(picture).save(data, form)
    return data.getvalue()


def obj(folder: Path, line: str = "map_Kd front.png", name: str = "m1") -> Path:
    (folder / "a.obj").write_text(OBJ.replace("m1", name))
    (folder / "a.mtl").write_text(f"newmtl {name}\nKd 0 0 0\n{line}\n")
    (folder / "front.png").write_bytes(packed())
    return folder / "a.obj"


def gltf(folder: Path, image: dict, material: dict | None = None, data: bytes = b"") -> Path:
    pbr = {"baseColorTexture": {"index": 0}, "metallicFactor": 0}
    views = [{"buffer": 0, "byteLength": 36}]
    views.append({"buffer": 0, "byteOffset": 36, "byteLength": len(data)})
    header = triangle_header(
        images=[image],
        textures=[{"source": 0}],
        bufferViews=views,
        buffers=[{"byteLength": 36 + len(data)}],
        materials=[{"name": "m1", "pbrMetallicRoughness": pbr | (material or {})}],
    )
    header["meshes"][0]["primitives"][0]["material"] = 0
    (folder / "a.glb").write_bytes(glb(header, TRIANGLE + data))
    return folder / "a.glb"


def textured_gltf(folder: Path, corners: bytes, picture: bytes) -> Path:
    """A triangle with texture coordinates and a picture in the buffer."""
    starts = np.cumsum([0, len(TRIANGLE), len(corners)]).tolist()
    sizes = [len(TRIANGLE), len(corners), len(picture)]
    header = triangle_header(
        images=[{"bufferView": 2, "mimeType": "image/png"}],
        textures=[{"source": 0}],
        bufferViews=[
            {"buffer": 0, "byteOffset": start, "byteLength": size}
            for start, size in zip(starts, sizes, strict=True)
        ],
        buffers=[{"byteLength": sum(sizes)}],
        materials=[{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
    )
    header["accessors"].append({"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"})
    (triangle,) = header["meshes"][0]["primitives"]
    triangle |= {"material": 0, "attributes": {"POSITION": 0, "TEXCOORD_0": 1}}
    (folder / "a.glb").write_bytes(glb(header, TRIANGLE + corners + picture))
    return folder / "a.glb"


def reflectance(report) -> float:
    (thing,) = report.written.scene.objects
    assert report.materials[0][0].how == "texture"
    return thing.material.reflectance


def test_mean_of_obj(tmp_path: Path) -> None:
    report = taken(obj(tmp_path))
    assert reflectance(report) == pytest.approx(RULE * MEAN, abs=1e-3)
    assert any("tells little of 1550 nm" in note for note in report.notes)
    (row,) = load_scene(report.written.scene_file).objects
    assert "front.png" in row.material.source
    assert "guess" in row.material.source


@pytest.mark.parametrize("form", ["png", "jpeg", "bmp", "tga", "webp"])
def test_formats(tmp_path: Path, form: str) -> None:
    file = obj(tmp_path, f"map_Kd -s 2 2 1 front.{form}")
    grey = np.full((8, 8, 3), 128, np.uint8)
    (tmp_path / f"front.{form}").write_bytes(packed(grey, form))
    assert reflectance(taken(file)) == pytest.approx(RULE * 128 / 255, abs=5e-3)


@pytest.mark.parametrize("where", ["buffer", "text", "beside"])
def test_mean_of_gltf(tmp_path: Path, where: str) -> None:
    data = packed()
    (tmp_path / "front face.png").write_bytes(data)
    image = {
        "buffer": {"bufferView": 1, "mimeType": "image/png"},
        "text": {"uri": "data:image/png;base64," + base64.b64encode(data).decode()},
        "beside": {"uri": "front%20face.png"},
    }[where]
    report = taken(gltf(tmp_path, image, data=data))
    assert reflectance(report) == pytest.approx(RULE * MEAN, abs=1e-3)


def test_a_factor_and_transparency_count(tmp_path: Path) -> None:
    clear = np.dstack([PICTURE, np.full((4, 8), 255, np.uint8)])
    clear[:, :4, 3] = 0
    data = packed(clear)
    material = {"baseColorFactor": [0.25, 1, 1, 1]}
    report = taken(gltf(tmp_path, {"bufferView": 1}, material, data))
    assert reflectance(report) == pytest.approx(RULE * 0.8 * 0.25**GAMMA, abs=1e-3)


def test_mean_of_collada_and_its_coordinates(tmp_path: Path) -> None:
    """Corners of one vertex with other coordinates become two vertices."""
    text = collada(MILLIMETRES_Y_UP, "front.png")
    effect = (
        '<newparam sid="su"><surface type="2D"><init_from>i</init_from></surface></newparam>'
        '<newparam sid="sa"><sampler2D><source>su</source></sampler2D></newparam>'
        '<technique sid="t">'
    )
    text = text.replace('<technique sid="t">', effect).replace("Rusty Steel", "m1")
    text = text.replace(
        "<diffuse><color>0.9 0.9 0.9 1</color></diffuse>",
        '<diffuse><texture texture="sa" texcoord="uv"/></diffuse>',
    )
    source = (
        '<source id="t"><float_array id="ta" count="6">0 0 1 0 0 0.5</float_array>'
        '<technique_common><accessor source="#ta" count="3" stride="2"><param name="S" '
        'type="float"/><param name="T" type="float"/></accessor></technique_common></source>'
        '<vertices id="v">'
    )
    text = text.replace('<vertices id="v">', source)
    text = text.replace(
        'offset="0"/>', 'offset="0"/><input semantic="TEXCOORD" source="#t" offset="1" set="0"/>'
    )
    text = text.replace("0 2 1 0 1 3 0 3 2 1 2 3", " ".join(
        f"{vertex} {k % 3}" for k, vertex in enumerate([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3])
    ))  # fmt: skip
    (tmp_path / "a.dae").write_text(text)
    (tmp_path / "front.png").write_bytes(packed())
    report = taken(tmp_path / "a.dae")
    thing = report.written.scene.objects[0]
    assert thing.material.reflectance == pytest.approx(RULE * MEAN, abs=1e-3)
    uv = texture_coordinates(thing.mesh)
    assert uv is not None
    np.testing.assert_allclose(uv[thing.mesh.faces], [[[0, 0], [1, 0], [0, 0.5]]] * 4)
    assert thing.mesh.is_volume or len(thing.mesh.vertices) > 4


@pytest.mark.parametrize(
    ("raw", "mean"), [("false", MEAN), ("true", (0.2**GAMMA + 0.8**GAMMA) / 2)]
)
def test_mean_of_mitsuba(tmp_path: Path, raw: str, mean: float) -> None:
    (tmp_path / "a.xml").write_text(
        '<scene version="3.0.0"><shape type="cube"><bsdf type="diffuse"><texture type="bitmap" '
        'name="reflectance"><string name="filename" value="front.png"/>'
        f'<boolean name="raw" value="{raw}"/></texture></bsdf></shape></scene>'
    )
    (tmp_path / "front.png").write_bytes(packed())
    assert reflectance(taken(tmp_path / "a.xml")) == pytest.approx(RULE * mean, abs=1e-3)


def test_open_exr(tmp_path: Path) -> None:
    red = np.full((4, 4), 0.25, np.float32)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"R": red, "G": red * 0, "B": red * 0}).write(str(tmp_path / "b.exr"))
    report = taken(obj(tmp_path, "map_Kd b.exr"))
    assert reflectance(report) == pytest.approx(RULE * 0.25**GAMMA, abs=1e-3)


def test_gazebo(tmp_path: Path) -> None:
    (tmp_path / "front.png").write_bytes(packed())
    (tmp_path / "a.sdf").write_text(
        "<sdf version='1.9'><model name='m'><link name='l'><visual name='v'><geometry><box/>"
        "</geometry><material><pbr><metal><albedo_map>front.png</albedo_map></metal></pbr>"
        "</material></visual></link></model></sdf>"
    )
    assert reflectance(taken(tmp_path / "a.sdf")) == pytest.approx(RULE * MEAN, abs=1e-3)


def test_names_come_first(tmp_path: Path) -> None:
    """The material's, then the picture's."""
    assert taken(obj(tmp_path, name="old_brickwall")).materials[0][0].material == "brick"
    file = obj(tmp_path, "map_Kd .\\tex\\oak_wood.png")
    (tmp_path / "tex").mkdir()
    (tmp_path / "tex" / "oak_wood.png").write_bytes(packed())
    assert "wood" in taken(file, overwrite=True).materials[0][0].material


def test_the_whole_picture(tmp_path: Path) -> None:
    """It lies as in the file: u to the right, v up; and the import can be repeated."""
    picture = PICTURE.copy()
    picture[:2] = 0
    file = obj(tmp_path)
    (tmp_path / "front.png").write_bytes(packed(picture))
    for overwrite in (False, True):
        report = taken(file, textures="picture", overwrite=overwrite)
    (thing,) = report.written.scene.objects
    assert thing.material.reflectance == RULE
    assert thing.material.texture is not None
    np.testing.assert_allclose(thing.material.texture, picture[..., 0] / 255, atol=1e-3)
    assert [path.suffix for path in report.written.mesh_files] == [".ply", ".png"]


@pytest.mark.parametrize(("form", "rows"), [("obj", [3, 3, 0]), ("gltf", [0, 0, 3])])
def test_corners_have_the_pixels_of_their_coordinates(tmp_path: Path, form: str, rows) -> None:
    """Coordinates (0, 0), (1, 0), (0, 1) of one triangle: v goes up in OBJ and down in glTF."""
    picture = np.zeros((4, 4, 3), np.uint8)
    picture[...] = np.arange(10, 250, 15).reshape(4, 4, 1)
    if form == "obj":
        file = obj(tmp_path)
        (tmp_path / "front.png").write_bytes(packed(picture))
    else:
        corners = np.array([[0, 0], [1, 0], [0, 1]], "<f4").tobytes()
        file = textured_gltf(tmp_path, corners, packed(picture))
    (thing,) = taken(file, textures="picture").written.scene.objects
    texture, uv = thing.material.texture, texture_coordinates(thing.mesh)
    assert texture is not None
    inside = 0.9 * uv + 0.05 * (uv.sum(axis=0) - uv)
    seen = [texture[int((1 - v) * 4), int(u * 4)] for u, v in inside]
    np.testing.assert_allclose(seen, picture[rows, [0, 3, 0], 0] / 255, atol=1e-3)


def test_not_at_all(tmp_path: Path) -> None:
    assert taken(obj(tmp_path), textures="off").materials[0][0].how == "default"


def test_without_coordinates_the_mean_is_taken(tmp_path: Path) -> None:
    data = packed()
    report = taken(gltf(tmp_path, {"bufferView": 1}, data=data), textures="picture")
    assert reflectance(report) == pytest.approx(RULE * MEAN, abs=1e-3)
    assert report.written.scene.objects[0].material.texture is None


def huge() -> bytes:
    """A PNG file that tells of a hundred billion pixels."""
    head = struct.pack(">2I5B", 400_000, 300_000, 8, 2, 0, 0, 0)
    chunk = b"IHDR" + head
    return (
        b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + chunk + struct.pack(">I", zlib.crc32(chunk))
    )


@pytest.mark.parametrize(
    "data", [b"no picture", packed()[:45], huge()], ids=["text", "cut", "huge"]
)
def test_damaged_pictures_are_told(tmp_path: Path, data: bytes) -> None:
    file = obj(tmp_path)
    (tmp_path / "front.png").write_bytes(data)
    report = taken(file)
    assert report.materials[0][0].how == "default"
    assert any("front.png" in note and "not used" in note for note in report.notes)


@pytest.mark.parametrize("image", [{"bufferView": 7}, {"uri": "data:image/png;base64,?"}, {}])
def test_damaged_references_are_told(tmp_path: Path, image: dict) -> None:
    report = taken(gltf(tmp_path, image))
    assert report.materials[0][0].how == "default"
    assert any("not used" in note for note in report.notes)


def test_pictures_outside_of_the_folders_are_not_read(tmp_path: Path) -> None:
    inner = tmp_path / "inner"
    inner.mkdir()
    file = obj(inner, "map_Kd ../front.png")
    (inner / "front.png").unlink()
    (tmp_path / "front.png").write_bytes(packed())
    report = taken(file)
    assert report.materials[0][0].how == "default"
    assert any("outside" in note for note in report.notes)


@pytest.mark.parametrize("name", ["../front.png", "C:\\models\\front.png", "/home/them/front.png"])
@pytest.mark.parametrize("folder", [".", "materials/textures", "../materials/textures"])
def test_pictures_are_found_by_their_name(tmp_path: Path, name: str, folder: str) -> None:
    """Of another machine, and where Gazebo's models have theirs; a note tells which is taken."""
    inner = tmp_path / "meshes"
    inner.mkdir()
    file = obj(inner, f"map_Kd {name}")
    (inner / folder).mkdir(parents=True, exist_ok=True)
    (inner / "front.png").rename(inner / folder / "front.png")
    report = taken(file, model_path=(tmp_path,))
    assert report.materials[0][0].how == "texture"
    assert any("front.png is taken, by its name" in note for note in report.notes)


def test_an_unknown_use_is_refused_by_the_command(tmp_path: Path) -> None:
    arguments = ("scenes", "import", obj(tmp_path), "-o", tmp_path / "a.yaml")
    assert "mean" in mistake(*arguments, "--textures", "pictures")


def test_pictures_of_as_many_pixels_as_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    picture = np.ones((3, 4), np.float32)
    OpenEXR.File({}, {"R": OpenEXR.Channel(picture)}).write(str(tmp_path / "a.exr"))
    monkeypatch.setattr(linear, "MAX_PIXELS", 12)
    np.testing.assert_array_equal(read_exr_red(tmp_path / "a.exr"), picture)
    monkeypatch.setattr(linear, "MAX_PIXELS", 11)
    with pytest.raises(InputError, match="at most 11 pixels"):
        read_exr_red(tmp_path / "a.exr")

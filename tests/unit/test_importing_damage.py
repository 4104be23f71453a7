"""Files with random damage: each is read, or refused with an InputError, and nothing else."""

import json
import random
from collections.abc import Callable
from pathlib import Path

import pytest
import trimesh

from foreign import READERS, TRIANGLE, collada, glb, tetrahedron, triangle_header
from reconstruction.errors import InputError
from spisim.scene.importing.files import Folders
from spisim.scene.importing.units import to_metres

TOKENS = (b"-1", b"0", b"nan", b"1e999", b"99999999999", b"null", b"[]", b"{}", b"<", b"/", b"\0")
OBJ = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\no X\nusemtl a b\nf 1/1 2/1 3/1 4/1\nf 1//1 2 3\n"
SDF = """<sdf version="1.9"><world name="w"><frame name="f"><pose>1 2 3 0 0 0</pose></frame>
<model name="m"><pose relative_to="f" degrees="true">0 0 0 0 0 90</pose><link name="l">
<visual name="a"><geometry><box><size>1 2 3</size></box></geometry></visual>
<visual name="b"><pose>0 0 1 0 0 0</pose><geometry><cylinder><radius>1</radius><length>2</length>
</cylinder></geometry><material><diffuse>1 1 1 1</diffuse></material></visual>
</link></model></world></sdf>"""
MITSUBA = """<scene version="3.0.0"><default name="r" value="2"/><bsdf type="diffuse" id="walls">
<rgb name="reflectance" value="0.5, 0.5, 0.5"/></bsdf><shape type="sphere"><float name="radius"
value="$r"/><point name="center" x="1" y="2" z="3"/><ref id="walls"/></shape><shape type="cube">
<transform name="to_world"><scale value="2"/><rotate x="1" angle="30"/><lookat origin="1 2 3"
target="0 0 0" up="0 0 1"/></transform></shape></scene>"""
SOUND: dict[str, Callable[[], bytes | str]] = {
    "a.glb": lambda: glb(triangle_header(), TRIANGLE),
    "a.gltf": lambda: json.dumps(triangle_header(buffers=[{"byteLength": 36, "uri": "a.bin"}])),
    "a.dae": collada,
    "binary.ply": lambda: tetrahedron().export(file_type="ply"),
    "text.ply": lambda: tetrahedron().export(file_type="ply", encoding="ascii"),
    "binary.stl": lambda: tetrahedron().export(file_type="stl"),
    "text.stl": lambda: trimesh.exchange.stl.export_stl_ascii(tetrahedron()),
    "a.obj": lambda: OBJ,
    "a.sdf": lambda: SDF,
    "a.xml": lambda: MITSUBA,
}


def damaged(sound: bytes, rng: random.Random) -> bytes:
    """A few bytes changed, cut out, replaced by a token, or repeated elsewhere."""
    data = bytearray(sound)
    for _ in range(rng.choice([1, 1, 2, 5])):
        place, other = rng.randrange(len(data)), rng.randrange(len(data))
        match rng.randrange(4):
            case 0:
                data[place] = rng.randrange(256)
            case 1:
                del data[place : place + rng.randrange(1, 20)]
            case 2:
                data[place : place + rng.randrange(6)] = rng.choice(TOKENS)
            case 3:
                data[place:place] = data[other : other + rng.randrange(1, 40)]
    return bytes(data)


def outcomes(folder: Path, name: str, count: int) -> set[str]:
    sound = SOUND[name]()
    content = sound.encode() if isinstance(sound, str) else sound
    (folder / "a.bin").write_bytes(TRIANGLE)
    file = folder / name
    rng = random.Random(name)
    found = set()
    for _ in range(count):
        file.write_bytes(damaged(content, rng))
        try:
            to_metres(READERS[file.suffix](file, Folders.around(file)), 1.0)
            found.add("read")
        except InputError as error:
            found.add("refused in many lines" if "\n" in str(error) else "refused")
    return found


@pytest.mark.parametrize("name", SOUND)
def test_damage(tmp_path: Path, name: str) -> None:
    assert outcomes(tmp_path, name, 120) == {"read", "refused"}


@pytest.mark.slow
@pytest.mark.parametrize("name", SOUND)
def test_much_damage(tmp_path: Path, name: str) -> None:
    assert outcomes(tmp_path, name, 4000) == {"read", "refused"}

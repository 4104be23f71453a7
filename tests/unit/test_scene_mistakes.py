"""Every mistake in a scene file is told in a sentence."""

from pathlib import Path

import pytest

from reconstruction.base.errors import InputError
from scenefiles import MINIMAL, Load, with_objects
from spisim.scene import load_scene

DRONE = "drone: {position_m: [0, 0, 1], look_at_m: [5, 0, 1]}"


@pytest.mark.parametrize(
    ("wrong", "parts"),
    [
        # (text to replace, replacement), what the message must hold
        (("material: concrete", "material: conrete"), ["objects[0] (wall)", "'concrete'"]),
        (("material: concrete", "materiel: concrete"), ["objects[0]", "'materiel'", "'material'"]),
        (("material: concrete", "material: 5"), ["objects[0].material", "found 5"]),
        (("shape: rectangle", "shape: rectangel"), ["objects[0]", "did you mean 'rectangle'"]),
        (("shape: rectangle, ", ""), ["objects[0]", "mesh", "shape"]),
        (("size_m: [4, 4]", "size_m: [4, -4]"), ["objects[0].size_m[1]", "greater than 0", "-4"]),
        (("size_m: [4, 4]", "size_m: [4]"), ["objects[0].size_m[1]", "missing"]),
        (("size_m: [4, 4]", "size_m: big"), ["objects[0].size_m", "'big'"]),
        (("[5, 0, 1], mat", "[5, 0, .nan], mat"), ["objects[0].translate_m[2]", "finite", "nan"]),
        (("[5, 0, 1], mat", "[.inf, 0, 1], mat"), ["objects[0].translate_m[0]", "finite", "inf"]),
        (("[5, 0, 1], mat", "[yes, 0, 1], mat"), ["objects[0].translate_m[0]", "number", "True"]),
        (("size_m: [4, 4]", "size_m: [4, 4], scale: 0"), ["objects[0].scale", "greater than 0"]),
        (("size_m: [4, 4]", "size_m: [4, 4], instances: []"), ["objects[0].instances"]),
        (("name: test", "nmae: test"), ["'nmae'", "did you mean 'name'"]),
        (("name: test\n", "\n"), ["name", "missing"]),
        ((DRONE, "drone: here"), ["drone", "mapping", "'here'"]),
        ((DRONE, ""), ["drone", "missing"]),
        (("look_at_m: [5, 0, 1]", "look_at_m: [0, 0, 1]"), ["drone", "look_at_m"]),
        (("look_at_m: [5, 0, 1]", "look_at_m: [0, 0, 9]"), ["drone", "up", "line of sight"]),
        (("look_at_m: [5, 0, 1]", "lookat_m: [5, 0, 1]"), ["drone", "did you mean 'look_at_m'"]),
    ],
)
def test_mistake_in_a_field(load: Load, wrong: tuple[str, str], parts: list[str]) -> None:
    text = MINIMAL.replace(*wrong)
    assert text != MINIMAL
    assert_reported(load, text, parts)


@pytest.mark.parametrize(
    ("added", "parts"),
    [
        ("fog: {visibility_m: -50}", ["fog.visibility_m", "greater than 0", "-50"]),
        ("fog: {visibility_m: 50, kind: heavy}", ["fog", "'heavy'", "heavy-advection"]),
        ("fog: {visibility_m: 50, definition: moor}", ["fog", "did you mean 'mor'"]),
        ("fog: {visibility: 50}", ["fog", "did you mean 'visibility_m'"]),
        ("fog: {}", ["fog", "visibility_m or extinction_per_m"]),
        ("fog: {visibility_m: 5, extinction_per_m: 1}", ["fog", "either"]),
        ("fog: {visibility_m: 5, albedo: 1}", ["fog", "albedo does not go with visibility_m"]),
        ("fog: {extinction_per_m: 1, kind: x}", ["fog", "kind does not go with extinction_per_m"]),
        ("fog: {extinction_per_m: 1, albedo: 1.5}", ["fog.albedo", "1.5"]),
        ("fog: {extinction_per_m: 1, g: 1}", ["fog.g", "less than 1"]),
        ("ambient: {sun_klx: -1}", ["ambient.sun_klx", "-1"]),
        ("ambient: {sun_direction: [0, 0, 0]}", ["ambient", "sun_direction"]),
        ("materials: {m: {reflectance: 1.5, source: x}}", ["materials.m.reflectance", "1.5"]),
        ("materials: {m: {reflectance: 0.5}}", ["materials.m.source", "missing"]),
        ("name: again", ["'name' is given twice"]),
        ("fog: [", ["not valid YAML", "line"]),
        ("fog: !!python/object/apply:os.getcwd []", ["not valid YAML"]),
    ],
)
def test_mistake_in_another_section(load: Load, added: str, parts: list[str]) -> None:
    assert_reported(load, f"{MINIMAL}{added}\n", parts)


@pytest.mark.parametrize(
    ("item", "parts"),
    [
        (
            "name: a, mesh: sold.ply, material: brick",
            ["objects[1] (a)", "did you mean 'solid.ply'"],
        ),
        ("name: a, mesh: solid.ply, size_m: [1, 1], material: brick", ["'size_m'", "objects[1]"]),
        ("name: wall, mesh: solid.ply, translate_m: [3, 0, 0], material: brick", ["'wall'"]),
        ("name: '', mesh: solid.ply, material: brick", ["objects[1].name"]),
    ],
)
def test_mistake_in_an_object(load: Load, item: str, parts: list[str]) -> None:
    assert_reported(load, with_objects(item), parts)


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("", ["mapping", "None"]),
        ("- a\n- b\n", ["mapping", "['a', 'b']"]),
        ("just text", ["mapping", "'just text'"]),
        (MINIMAL.split("objects")[0], ["objects", "missing"]),
        (MINIMAL.split("objects")[0] + "objects: []\n", ["objects", "at least 1"]),
        (MINIMAL.split("objects")[0] + "objects: none\n", ["objects", "'none'"]),
        (MINIMAL.split("objects")[0] + "objects: [wall]\n", ["objects[0]", "'wall'"]),
    ],
)
def test_no_scene_at_all(load: Load, text: str, parts: list[str]) -> None:
    assert_reported(load, text, parts)


def assert_reported(load: Load, text: str, parts: list[str]) -> None:
    """Loading the text raises one short InputError that holds the file's name and all parts."""
    with pytest.raises(InputError) as caught:
        load(text)
    message = str(caught.value)
    assert "scene.yaml" in message
    for part in parts:
        assert part in message
    assert len(message.splitlines()) == 1
    assert "pydantic" not in message


def test_binary_garbage(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_bytes(bytes(range(256)))
    with pytest.raises(InputError, match=r"scene\.yaml: not a text file"):
        load_scene(path)
    path.write_bytes(b"name: \x00\x01\n")
    with pytest.raises(InputError, match=r"scene\.yaml.*not valid YAML"):
        load_scene(path)


def test_missing_scene_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"absent\.yaml: no such file"):
        load_scene(tmp_path / "absent.yaml")
    (tmp_path / "folder.yaml").mkdir()
    with pytest.raises(InputError, match=r"folder\.yaml: not a regular file"):
        load_scene(tmp_path / "folder.yaml")


def test_unknown_scene_names_the_nearest() -> None:
    with pytest.raises(InputError, match=r"'warehose'.*did you mean 'warehouse'"):
        load_scene("warehose")


def test_materials_are_replaced_by_known_ones(load: Load) -> None:
    with pytest.raises(InputError, match=r"material_swaps: unknown material.*did you mean"):
        load(MINIMAL + "material_swaps: {concrete: brik}\n")

"""Names, words and colours of foreign materials, and names that are hard to write."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml

from foreign import TRIANGLE, glb, taken, tetrahedron, triangle_header
from reconstruction.base.errors import InputError
from spisim.scene.materials import material_table
from spisim_formats.library.content import Part, Surface
from spisim_formats.library.materials import match
from spisim_formats.library.textures import Pictured

KEYWORDS = yaml.safe_load(
    (
        Path(__file__).parents[2] / "formats" / "spisim_formats" / "library" / "keywords.yaml"
    ).read_text()
)


def part(name: str | None, color=None, words=(), called: str = "Cube") -> Part:
    return Part(called, tetrahedron(), np.eye(4), Surface(name, color, tuple(words)))


def test_every_entry_names_a_material_that_there_is() -> None:
    given = set(material_table())
    assert set(KEYWORDS["words"].values()) <= given
    assert {KEYWORDS[kind] for kind in ("white", "black", "colored", "nothing")} <= given


@pytest.mark.parametrize(
    ("surface", "expected", "how"),
    [
        (part("concrete-weathered"), "concrete-weathered", "name"),
        (part("Concrete_Weathered.002"), "concrete-weathered", "name"),
        (part("brick"), "brick", "name"),
        (part("BrickWall_02"), "brick", "guess"),
        (part("old_brickwall"), "brick", "guess"),
        (part("M_PaintedMetal"), "steel-painted", "guess"),
        (part("rusty steel"), "steel-rusty", "guess"),
        (part("weathered wood planks"), "wood-weathered", "guess"),
        (part("Window.001"), "glass-pane", "guess"),
        (part("Material.001", words=("leather_diffuse",)), "leather", "guess"),
        (part("Material.001", called="grass patch"), "grass", "guess"),
        (part("BathroomMirror"), "aluminium-polished", "guess"),
        (part("Carbon_Fiber"), "carbon-fibre", "guess"),
        (part("charcoal_dark"), "charcoal", "guess"),
        (part("plasterboard wall"), "plasterboard", "guess"),
        (part("Textile_3"), "polyester-fabric", "guess"),  # no tile
        (part("FiberglassHull"), "fibreglass", "guess"),  # no pane
        (part("Surface.001"), "concrete", "default"),  # no face
        (part("chair"), "concrete", "default"),  # no hair
        (part("Material.001", (0.9, 0.9, 0.9)), "paint-white", "guess"),
        (part("Material.001", (0.01, 0.0, 0.02)), "paint-black", "guess"),
        (part("Material.001", (0.9, 0.1, 0.1)), "steel-painted", "default"),
        (part("Material.001"), "concrete", "default"),
        (part(None), "concrete", "default"),
        (part("device"), "concrete", "default"),  # no ice in it
        (part("background"), "concrete", "default"),  # no ground
        (part("Underground_2"), "concrete", "default"),
        (part("woodpecker"), "concrete", "default"),
        (part("concretefloor"), "concrete", "guess"),
        (part("treetrunk"), "bark", "guess"),
        (part("Material.001", (0.9, 0.9, 0.9), called="asphalt"), "asphalt", "guess"),
    ],
)
def test_matches(surface: Part, expected: str, how: str) -> None:
    result = match(surface, {}, Pictured("mean"))
    assert (result.material, result.how) == (expected, how)
    assert result.why


def test_the_users_choice_comes_first() -> None:
    result = match(part("concrete"), {"concrete": "snow"}, Pictured("off"))
    assert (result.material, result.how) == ("snow", "map")


def obj_of(path: Path, *materials: str) -> Path:
    rows = [f"usemtl {name}\nf 1 2 {k + 3}" for k, name in enumerate(materials)]
    points = ["v 0 0 0", "v 1 0 0", *(f"v 0 1 {k}" for k in range(len(materials)))]
    path.write_text("\n".join([*points, *rows, ""]))
    return path


def test_map_of_materials(tmp_path: Path) -> None:
    (tmp_path / "map.yaml").write_text("Mystery 1: snow\nbrick: glass-pane\n")
    report = taken(
        obj_of(tmp_path / "a.obj", "Mystery 1", "brick"), materials=tmp_path / "map.yaml"
    )
    rows = yaml.safe_load(report.written.scene_file.read_text())
    assert sorted(row["material"] for row in rows["objects"]) == ["glass-pane", "snow"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("brick: sno", "map.yaml: brick: unknown material 'sno': did you mean 'snow'"),
        ("brik: snow", "map.yaml: the file has no material 'brik': did you mean 'brick'"),
        ("- brick", "expected lines of"),
        ("brick: [snow]", "expected lines of"),
        ("brick: {", "expected lines of"),
        ("", "expected lines of"),
        ("!!python/object/apply:os.system ['echo']: x", "expected lines of"),
    ],
)
def test_maps_that_cannot_be_used(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "map.yaml").write_text(text)
    with pytest.raises(InputError, match=message):
        taken(obj_of(tmp_path / "a.obj", "brick"), materials=tmp_path / "map.yaml")
    assert not (tmp_path / "taken").exists()


@pytest.mark.parametrize(
    "name",
    ["a: b # c", "../../../etc/cron.d/x", "[red]x[/red]", "x\ny\0z", "Küche 1", "%TAG", "-", " ",
     "😀", "a" * 5000, "!!python/object:os.system", "null", "1"],
)  # fmt: skip
def test_names_that_are_hard_to_write(tmp_path: Path, name: str) -> None:
    header = triangle_header(nodes=[{"mesh": 0, "name": name}], materials=[{"name": name}])
    header["meshes"][0]["primitives"][0]["material"] = 0
    (tmp_path / "a.glb").write_bytes(glb(header, TRIANGLE))
    report = taken(tmp_path / "a.glb")
    assert len(report.written.scene.objects) == 1
    (mesh,) = report.written.mesh_files
    assert mesh.parent == tmp_path / "taken" / "scene-meshes"
    assert len(mesh.name) <= 50


def test_names_are_made_unique_also_among_copies(tmp_path: Path) -> None:
    """A copied object `a` becomes a-1 and a-2, which another may be called already."""
    scene = trimesh.Scene()
    scene.geometry.update({"one": tetrahedron(), "two": trimesh.creation.box((1, 1, 1))})
    shift = trimesh.transformations.translation_matrix
    scene.graph.update("a-1", geometry="two", matrix=shift([0, 0, 5]))
    scene.graph.update("a", geometry="one", matrix=shift([5, 0, 0]))
    scene.graph.update("b", geometry="one", matrix=shift([9, 0, 0]))
    scene.export(tmp_path / "a.glb")
    names = [thing.name for thing in taken(tmp_path / "a.glb").written.scene.objects]
    assert names == ["a-1", "a 2-1", "a 2-2"]

"""Import of Mitsuba scenes: shapes, transforms, parameters, includes, the sensor."""

from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest
import trimesh

from foreign import READERS, Y_UP, assert_same, taken, tetrahedron, written
from mitsuba_scenes import CUBE, scene, shape, turned
from reconstruction.base.errors import InputError
from spisim_formats.library.files import Folders


def cube_at(matrix: np.ndarray) -> trimesh.Trimesh:
    return CUBE.copy().apply_transform(matrix)


@pytest.mark.parametrize(
    ("steps", "matrix"),
    [
        ('<translate x="1" z="3"/>', trimesh.transformations.translation_matrix([1, 0, 3])),
        ('<translate value="1 2 3"/>', trimesh.transformations.translation_matrix([1, 2, 3])),
        ('<scale value="2"/>', np.diag([2.0, 2, 2, 1])),
        ('<scale x="2" z="0.5"/>', np.diag([2.0, 1, 0.5, 1])),
        ('<scale value="-1, 2, 3"/>', np.diag([-1.0, 2, 3, 1])),
        ('<rotate y="1" angle="30"/>', turned([0, 1, 0], 30)),
        ('<rotate value="1 1 0" angle="30"/>', turned([1, 1, 0], 30)),
        (
            '<scale x="3"/><rotate z="1" angle="90"/><translate x="5"/>',
            trimesh.transformations.translation_matrix([5, 0, 0])
            @ turned([0, 0, 1], 90)
            @ np.diag([3.0, 1, 1, 1]),
        ),
        (
            '<matrix value="1 0.5 0 7 0 1 0 8 0 0 2 9 0 0 0 1"/>',
            np.array([[1, 0.5, 0, 7], [0, 1, 0, 8], [0, 0, 2, 9], [0, 0, 0, 1]]),
        ),
        (
            '<matrix value="0 -1 0 1 0 0 0 0 1"/>',
            np.array([[0.0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]),
        ),
        (
            '<lookat origin="1 2 3" target="1 2 8" up="0 1 0"/>',  # x left, y up, z forward
            trimesh.transformations.translation_matrix([1, 2, 3]),
        ),
        (
            '<lookat origin="0 0 0" target="4 0 0" up="0 0 1"/>',
            np.array([[0.0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]]),
        ),
    ],
)
def test_transforms(tmp_path: Path, steps: str, matrix: np.ndarray) -> None:
    """A cube with a mark, so that turns by 90° tell, too."""
    tetrahedron().export(tmp_path / "w.ply")
    body = shape("cube", "", steps)
    body += shape("ply", '<string name="filename" value="w.ply"/>', steps)
    expected = trimesh.util.concatenate([cube_at(matrix), tetrahedron().apply_transform(matrix)])
    got = written(taken(scene(tmp_path / "a.xml", body)))
    np.testing.assert_allclose(got.bounds, expected.bounds, rtol=0, atol=1e-6)
    assert got.volume == pytest.approx(expected.volume, rel=1e-6)
    np.testing.assert_allclose(got.center_mass, expected.center_mass, rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("body", "bounds", "area"),
    [
        (shape("rectangle", "", '<scale x="2" y="3"/>'), [[-2, -3, 0], [2, 3, 0]], 24),
        (shape("disk", "", '<scale value="2"/>'), [[-2, -2, 0], [2, 2, 0]], 4 * np.pi),
        (
            shape("cylinder", '<float name="radius" value="0.5"/>'
                  '<point name="p0" x="1" y="0" z="0"/><point name="p1" x="3" y="0" z="0"/>'),
            [[1, -0.5, -0.5], [3, 0.5, 0.5]],
            2 * np.pi,
        ),
        (
            shape("sphere", '<point name="center" value="1, 2, 3"/>'
                  '<float name="radius" value="2"/>', '<translate z="1"/>'),
            [[-1, 0, 2], [3, 4, 6]],
            16 * np.pi,
        ),
    ],
    ids=["rectangle", "disk", "cylinder", "sphere"],
)  # fmt: skip
def test_shapes(tmp_path: Path, body: str, bounds: list, area: float) -> None:
    mesh = written(taken(scene(tmp_path / "a.xml", body)))
    np.testing.assert_allclose(mesh.bounds, bounds, rtol=0, atol=2e-3)
    assert mesh.area == pytest.approx(area, rel=2e-3)


def test_a_mesh_file_is_written_once(tmp_path: Path) -> None:
    tetrahedron().export(tmp_path / "w.ply")
    name = '<string name="filename" value="w.ply"/>'
    body = shape("ply", name) + shape("ply", name, '<translate x="3"/>')
    report = taken(scene(tmp_path / "a.xml", body))
    assert len(report.written.mesh_files) == 1
    assert len(report.written.scene.objects) == 2


def test_cylinders_are_open_and_face_out(tmp_path: Path) -> None:
    mesh = written(taken(scene(tmp_path / "a.xml", shape("cylinder"))))
    assert not mesh.is_watertight
    outward = mesh.triangles_center * [1, 1, 0]
    assert (np.einsum("tk,tk->t", outward, mesh.face_normals) > 0.9).all()


def test_flipped_normals(tmp_path: Path) -> None:
    flip = '<boolean name="flip_normals" value="true"/>'
    report = taken(scene(tmp_path / "a.xml", shape("cube", flip, '<scale value="5"/>')))
    assert written(report).volume == pytest.approx(-1000)


def test_parameters_includes_and_references(tmp_path: Path) -> None:
    """A default counts from where it stands on; the first one of a name holds."""
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "box.obj")
    (tmp_path / "parts").mkdir()
    scene(
        tmp_path / "parts" / "more.xml",
        '<default name="x" value="99"/><bsdf type="twosided" id="Walls">'
        '<bsdf type="diffuse"><rgb name="reflectance" value="#ff0000"/></bsdf></bsdf>'
        '<shape type="obj"><string name="filename" value="../box.obj"/>'
        '<transform name="to_world"><translate x="$x"/></transform><ref id="Walls"/></shape>',
    )
    body = '<default name="part" value="more"/><default name="x" value="7"/>'
    report = taken(scene(tmp_path / "a.xml", body + '<include filename="parts/$part.xml"/>'))
    box = trimesh.creation.box((1, 1, 1)).apply_translation([7, 0, 0])
    assert_same(written(report), box)
    assert report.materials[0][0].source == "Walls"
    assert report.written.scene.objects[0].material.name == "paint-white"


@pytest.mark.parametrize(
    ("bsdf", "expected"),
    [
        ('<bsdf type="roughconductor"><string name="material" value="Al"/></bsdf>',
         "aluminium-rough"),
        ('<bsdf type="roughconductor"><string name="material" value="Au"/></bsdf>',
         "aluminium-rough"),  # bare, and as bright as gold to 0.2; not painted
        ('<bsdf type="thindielectric"/>', "glass-pane"),
        ('<bsdf type="diffuse" id="red brick"/>', "brick"),
        (
            '<bsdf type="mask"><float name="opacity" value="1"/><bsdf type="diffuse" id="grass"/>'
            "</bsdf>",
            "grass",
        ),
        ('<bsdf type="diffuse"><rgb name="reflectance" value="0.01"/></bsdf>', "paint-black"),
        ('<bsdf type="diffuse"><rgb name="reflectance" value="0.9 0.9 0.85"/></bsdf>',
         "paint-white"),
        ('<bsdf type="diffuse"><rgb name="reflectance" value="0.5 0.1 0.1"/></bsdf>',
         "steel-painted"),
        ("", "concrete"),
    ],
)  # fmt: skip
def test_materials(tmp_path: Path, bsdf: str, expected: str) -> None:
    report = taken(scene(tmp_path / "a.xml", shape("cube", bsdf)))
    assert report.written.scene.objects[0].material.name == expected


def test_the_sensor_becomes_the_drone_and_tells_what_is_up(tmp_path: Path) -> None:
    sensor = (
        '<sensor type="perspective"><transform name="to_world">'
        '<lookat origin="0, 1, 8" target="0, 1, 0" up="0, 1, 0"/></transform></sensor>'
    )
    report = taken(scene(tmp_path / "a.xml", sensor + shape("cube")))
    np.testing.assert_allclose(report.drone.position_m, [0, -8, 1], atol=1e-12)
    np.testing.assert_allclose(report.drone.look_at_m, [0, -7, 1], atol=1e-12)
    assert report.drone.ahead_m == pytest.approx(7)
    assert_same(written(report), cube_at(Y_UP))


def test_a_sensor_inside_an_object_is_no_place_for_the_drone(tmp_path: Path) -> None:
    sensor = '<sensor type="perspective"/>'
    report = taken(scene(tmp_path / "a.xml", sensor + shape("cube")))
    assert report.drone.why == "proposed"
    assert any("camera" in note for note in report.notes)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (shape("serialized"), "serialized shape: the reference to a file is empty"),
        (shape("teapot"), "shape 'teapot' is not supported: .*allowed: obj, ply"),
        (shape("hair"), "shape 'hair' is not supported"),
        (shape("shapegroup"), "has no shapes that can be read"),
        (shape("ply", '<string name="filename" value="gone.ply"/>'), "ply shape: no file 'gone.p"),
        (shape("ply", '<string name="filename" value="../gone.ply"/>'), "outside the folders"),
        (shape("ply"), "the reference to a file is empty"),
        (shape("cube", "", '<skew x="1"/>'), "a.xml: unexpected <skew> element inside <tr"),
        (shape("cube", "", '<scale value="0"/>'), "a scale is zero"),
        (shape("cube", "", '<scale x="one"/>'), 'a.xml: could not parse floating point value "o'),
        (shape("cube", "", '<rotate angle="3"/>'), "rotation axis cannot be zero"),
        (shape("cube", "", '<matrix value="1 2"/>'), "matrix must have 9 or 16 values, got 2"),
        (shape("sphere", '<float name="radius" value="-1"/>'), "radius should be a positive"),
        (shape("cube", "", '<scale value="$x"/>'), r"\$x has no <default>"),
        (shape("cube", '<ref id="wal"/>') + '<bsdf type="diffuse" id="wall"/>', "did you mean 'wa"),
        (
            shape("sphere", '<string name="radius" value="1"/>'),
            "radius is of another type",
        ),
        (shape("cube", "", '<rotate value="1 nan 0" angle="3"/>'), "expected 3 finite numbers"),
        ('<shape type="cube" id="a"/>' * 2, 'a.xml: duplicate ID: "a"$'),
        (
            shape(
                "cube",
                '<float name="(line 99, col 1)" value="1"/><ref name="(line 99, col 1)" id="a"/>',
            ),
            "multiple times",
        ),
        ("<shape/>", 'a.xml: missing required attribute "type" in <shape>'),
        ('<shape type="cube"><include filename="a.xml"/></shape>', "include within <shape>"),
        ('<include filename="a.xml"/>', "includes itself"),
        ('<include filename="gone.xml"/>', "no file 'gone.xml'"),
    ],
)
def test_refused(tmp_path: Path, body: str, message: str) -> None:
    file = scene(tmp_path / "a.xml", body)
    with pytest.raises(InputError, match=message):
        taken(file)
    assert [path.name for path in tmp_path.iterdir()] == ["a.xml"]


@pytest.mark.parametrize("version", ["0.6.0", ""])
def test_older_formats_are_refused(tmp_path: Path, version: str) -> None:
    with pytest.raises(InputError, match="format 2 or 3 is expected"):
        taken(scene(tmp_path / "a.xml", shape("cube"), version))


def test_parameters_that_double_are_stopped(tmp_path: Path) -> None:
    """What entities do in a billion laughs, defaults could do as well."""
    rows = '<default name="p0" value="0123456789"/>' + "".join(
        f'<default name="p{i + 1}" value="{f"$p{i}" * 10}"/>' for i in range(20)
    )
    with pytest.raises(InputError, match="over 100,000 letters"):
        taken(scene(tmp_path / "a.xml", rows))


def test_includes_that_double_are_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each file in turn includes the next one twice."""
    monkeypatch.setattr("spisim_formats.mitsuba.elements.MAX_INCLUDES", 20)
    for i in range(10):
        scene(tmp_path / f"{i}.xml", f'<include filename="{i + 1}.xml"/>' * 2)
    scene(tmp_path / "10.xml", shape("cube"))
    with pytest.raises(InputError, match="more than 15 includes in one another, or 20"):
        taken(tmp_path / "0.xml")


def test_a_mistake_in_an_included_file_is_told_of_that_file(tmp_path: Path) -> None:
    scene(tmp_path / "more.xml", shape("cube") + shape("cube", "\n", '<scale x="one"/>'))
    with pytest.raises(InputError, match=r"more\.xml: could not parse"):
        taken(scene(tmp_path / "a.xml", '<include filename="more.xml"/>'))


def test_neither_spectra_nor_paths_are_looked_up(tmp_path: Path) -> None:
    """Mitsuba's parser would open the one, and search the other from then on, whatever is read."""
    spectrum = '<bsdf type="diffuse"><spectrum name="reflectance" filename="/gone.spd"/></bsdf>'
    before = str(mi.file_resolver())
    body = '<path value="/gone"/><path value="."/>' + shape("cube", spectrum)
    assert taken(scene(tmp_path / "a.xml", body)).triangles == 12
    assert str(mi.file_resolver()) == before


def test_a_sensor_that_looks_down_tells_what_is_up(tmp_path: Path) -> None:
    sensor = (
        '<sensor type="perspective"><transform name="to_world">'
        '<lookat origin="0, 9, 8" target="0, 0, 0" up="0, 1, 0"/></transform></sensor>'
    )
    assert taken(scene(tmp_path / "a.xml", sensor + shape("cube"))).up == "y"


def test_bsdfs_that_refer_to_each_other(tmp_path: Path) -> None:
    body = (
        '<bsdf type="mask" id="a"><ref id="b"/></bsdf><bsdf type="mask" id="b"><ref id="a"/></bsdf>'
    )
    report = taken(scene(tmp_path / "a.xml", body + shape("cube", '<ref id="a"/>')))
    assert len(report.materials) == 1


@pytest.mark.slow
def test_a_long_chain_of_references(tmp_path: Path) -> None:
    """Resolved by Mitsuba's parser, it would end the process."""
    count = 100_000
    rows = "".join(f'<bsdf type="mask" id="b{i}"><ref id="b{i + 1}"/></bsdf>' for i in range(count))
    body = f'{rows}<bsdf type="diffuse" id="b{count}"/>' + shape("cube", '<ref id="b0"/>')
    file = scene(tmp_path / "a.xml", body)
    (part,) = READERS[".xml"](file, Folders.around(file)).parts
    assert part.surface.words == ("mask",) * count + ("diffuse",)


def test_instances(tmp_path: Path) -> None:
    group = (
        '<shape type="shapegroup" id="g">' + shape("cube", "", '<translate x="3"/>') + "</shape>"
    )
    copies = "".join(
        f'<shape type="instance"><ref id="g"/><transform name="to_world"><translate z="{z}"/>'
        "</transform></shape>"
        for z in (0, 9)
    )
    shift = trimesh.transformations.translation_matrix
    both = trimesh.util.concatenate([cube_at(shift([3, 0, 0])), cube_at(shift([3, 0, 9]))])
    assert_same(written(taken(scene(tmp_path / "a.xml", group + copies))), both)


def test_paths(tmp_path: Path) -> None:
    """Folders of the scene that may be read, and of those that may not, what is allowed."""
    (tmp_path / "common" / "meshes").mkdir(parents=True)
    tetrahedron().export(tmp_path / "common" / "meshes" / "w.ply")
    scene(
        tmp_path / "common" / "part.xml",
        shape("ply", '<string name="filename" value="meshes/w.ply"/>'),
    )
    (tmp_path / "scenes").mkdir()
    body = '<path value="../common"/><include filename="part.xml"/>'
    file = scene(tmp_path / "scenes" / "a.xml", body)
    with pytest.raises(InputError, match=r"--model-path allows to read in .*common, too"):
        taken(file)
    assert_same(written(taken(file, model_path=(tmp_path / "common",))), tetrahedron())
    inside = scene(tmp_path / "b.xml", '<path value="common"/><include filename="part.xml"/>')
    assert_same(written(taken(inside)), tetrahedron())


def test_what_only_rendering_needs(tmp_path: Path) -> None:
    body = (
        '<integrator type="$integrator"/><sensor type="perspective"><sampler type="independent">'
        '<integer name="sample_count" value="$spp"/></sampler><film type="hdrfilm"/></sensor>'
    )
    assert_same(written(taken(scene(tmp_path / "a.xml", body + shape("cube")))), CUBE)


def test_the_first_sensor_in_the_open_is_the_drone(tmp_path: Path) -> None:
    sensors = "".join(
        f'<sensor type="perspective"><transform name="to_world"><lookat origin="{x} 0 0" '
        'target="-1 0 0" up="0 0 1"/></transform></sensor>'
        for x in (0.2, 6)
    )
    drone = taken(scene(tmp_path / "a.xml", sensors + shape("cube"))).drone
    assert drone.why == "camera 2 of the file"
    np.testing.assert_allclose(drone.position_m, [6, 0, 0])


def test_a_sampler_that_a_sensor_refers_to(tmp_path: Path) -> None:
    body = (
        '<sampler type="independent" id="s"/><sensor type="perspective"><ref id="s"/></sensor>'
        + shape("cube")
    )
    assert_same(written(taken(scene(tmp_path / "a.xml", body))), CUBE)


def test_shapes_that_cannot_be_read_are_left_out(tmp_path: Path) -> None:
    gone = shape("obj", '<string name="filename" value="gone.obj"/>')
    report = taken(scene(tmp_path / "a.xml", gone + shape("hair") + shape("cube")))
    assert_same(written(report), CUBE)
    assert any(note.startswith("left out: ") and "gone.obj" in note for note in report.notes)
    assert any("shape 'hair' is not supported" in note for note in report.notes)
    with pytest.raises(InputError, match=r"no shapes.*no file 'gone\.obj'"):
        taken(scene(tmp_path / "b.xml", gone), overwrite=True)

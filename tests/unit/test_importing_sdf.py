"""Import of Gazebo worlds: poses relative to frames, included models, simple shapes, meshes."""

from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
import trimesh

from foreign import assert_same, collada, taken, tetrahedron, written
from reconstruction.base.errors import InputError
from spisim.scene.pose import pose_matrix


def visual(geometry: str, rest: str = "", name: str = "v") -> str:
    return f'<visual name="{name}"><geometry>{geometry}</geometry>{rest}</visual>'


BOX = visual("<box><size>1 2 3</size></box>")


def model(body: str, name: str = "m", pose: str = "") -> str:
    return f'<model name="{name}">{pose}<link name="l">{body}</link></model>'


def world(path: Path, body: str) -> Path:
    path.write_text(f'<sdf version="1.9"><world name="w">{body}</world></sdf>')
    return path


def posed(*matrices: np.ndarray) -> trimesh.Trimesh:
    """The box of `BOX` at a chain of poses."""
    mesh = trimesh.creation.box((1, 2, 3))
    for matrix in reversed(matrices):
        mesh.apply_transform(matrix)
    return mesh


def at(*pose: float) -> np.ndarray:
    """x y z and roll pitch yaw in degrees."""
    return pose_matrix(pose[3:], pose[:3])


@pytest.fixture
def models(tmp_path: Path) -> Path:
    """A search path with a model in two versions, whose mesh is COLLADA in millimetres, y up."""
    crate = tmp_path / "models" / "crate"
    (crate / "meshes").mkdir(parents=True)
    (crate / "model.config").write_text(
        '<model><sdf version="1.4">old.sdf</sdf><sdf version="1.6"> new.sdf </sdf></model>'
    )
    (crate / "meshes" / "wedge.dae").write_text(collada())
    mesh = "<mesh><uri>model://crate/meshes/wedge.dae</uri><scale>1 2 1</scale></mesh>"
    body = "<pose>0 0 0.5 0 0 0</pose>" + visual(mesh, "<pose>1 0 0 0 0 0</pose>")
    (crate / "new.sdf").write_text(
        f'<sdf version="1.6">{model(body, "crate", "<pose>0 0 9 0 0 0</pose>")}</sdf>'
    )
    return tmp_path / "models"


def wedges() -> trimesh.Trimesh:
    """Both tetrahedra of the file in metres, axes as they stand there, as in Gazebo."""
    turn = trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0])
    turn[0, 3] = 0.5
    both = [tetrahedron().apply_transform(turn), tetrahedron().apply_translation([0, 0, -4])]
    return trimesh.util.concatenate(both).apply_scale([1, 2, 1])


def test_included_models(tmp_path: Path, models: Path) -> None:
    file = world(
        tmp_path / "a.world",
        "<include><uri>model://crate</uri></include>"
        "<include><uri>model://crate</uri><name>second</name>"
        '<pose degrees="true">3 0 0 0 0 90</pose></include>',
    )
    expected = [
        wedges().apply_transform(outer @ at(0, 0, 0.5, 0, 0, 0) @ at(1, 0, 0, 0, 0, 0))
        for outer in (at(0, 0, 9, 0, 0, 0), at(3, 0, 0, 0, 0, 90))
    ]
    report = taken(file, model_path=(models,))
    assert_same(written(report), trimesh.util.concatenate(expected))
    assert report.up == "z"
    names = [thing.name for thing in report.written.scene.objects]
    assert len(set(names)) == 4
    assert len(report.written.mesh_files) == 2  # shared by both models


def test_relative_uris_of_an_included_model_start_from_its_folder(
    tmp_path: Path, models: Path
) -> None:
    mesh = "<mesh><uri>meshes/wedge.dae</uri><scale>1 2 1</scale></mesh>"
    (models / "crate" / "new.sdf").write_text(f'<sdf version="1.6">{model(visual(mesh))}</sdf>')
    file = world(tmp_path / "a.sdf", "<include><uri>models/crate</uri></include>")
    assert_same(written(taken(file)), wedges())


def test_a_model_finds_its_own_meshes(models: Path) -> None:
    assert len(taken(models / "crate" / "new.sdf").written.mesh_files) == 2


@pytest.mark.parametrize("tag", ["model", "link", "frame", "joint", "visual"])
def test_poses_relative_to_frames(tmp_path: Path, tag: str) -> None:
    """Frames of all kinds, each relative to the one before."""
    a, b, c, d = at(1, 2, 3, 10, 20, 30), at(0, 0, 1, 90, 0, 0), at(0, 5, 0, 0, 45, 0), at(
        2, 0, 0, 0, 0, 60
    )  # fmt: skip
    texts = {
        "model": (
            '<model name="one"><pose degrees="true">1 2 3 10 20 30</pose><frame name="f">'
            '<pose degrees="true">0 0 1 90 0 0</pose></frame><link name="x"/></model>'
            '<model name="m"><pose relative_to="one::f" degrees="true">0 5 0 0 45 0</pose>'
            f'<link name="l"><pose degrees="true">2 0 0 0 0 60</pose>{BOX}</link></model>',
            (a, b, c, d),
        ),
        "link": (
            '<model name="m"><pose degrees="true">1 2 3 10 20 30</pose><link name="p">'
            '<pose degrees="true">0 0 1 90 0 0</pose></link><link name="l">'
            f'<pose relative_to="p" degrees="true">0 5 0 0 45 0</pose>{BOX}</link></model>',
            (a, b, c),
        ),
        "frame": (
            '<frame name="g"><pose degrees="true">1 2 3 10 20 30</pose></frame>'
            '<frame name="f" attached_to="g"><pose degrees="true">0 0 1 90 0 0</pose></frame>'
            '<model name="m"><pose relative_to="f" degrees="true">0 5 0 0 45 0</pose>'
            f'<link name="l">{BOX}</link></model>',
            (a, b, c),
        ),
        "joint": (
            '<model name="m"><link name="p"><pose degrees="true">1 2 3 10 20 30</pose></link>'
            '<joint name="j" type="fixed"><parent>l</parent><child>p</child>'
            '<pose degrees="true">0 0 1 90 0 0</pose></joint>'
            f'<link name="l"><pose relative_to="j" degrees="true">0 5 0 0 45 0</pose>{BOX}</link>'
            "</model>",
            (a, b, c),
        ),
        "visual": (
            '<model name="m"><link name="p"><pose degrees="true">1 2 3 10 20 30</pose></link>'
            '<link name="l"><pose>9 9 9 0 0 0</pose>'
            + BOX.replace("<geo", '<pose relative_to="p" degrees="true">0 0 1 90 0 0</pose><geo')
            + "</link></model>",
            (a, b),
        ),
    }
    text, chain = texts[tag]
    assert_same(written(taken(world(tmp_path / "a.sdf", text))), posed(*chain))


def test_nested_models_and_placement_frames(tmp_path: Path) -> None:
    inner = model(BOX, "inner", '<pose degrees="true">0 0 1 0 0 90</pose>')
    text = (
        '<model name="outer" placement_frame="inner::l"><pose>4 0 0 0 0 0</pose>'
        f'<link name="x"/>{inner}</model>'
    )
    assert_same(written(taken(world(tmp_path / "a.sdf", text))), posed(at(4, 0, 0, 0, 0, 0)))
    text = text.replace(' placement_frame="inner::l"', "")
    report = taken(world(tmp_path / "a.sdf", text), overwrite=True)
    assert_same(written(report), posed(at(4, 0, 0, 0, 0, 0), at(0, 0, 1, 0, 0, 90)))
    assert [thing.name for thing in report.written.scene.objects] == ["outer inner v"]


def test_rotation_by_quaternion_and_radians(tmp_path: Path) -> None:
    half = 0.5**0.5
    quaternion = f'<pose rotation_format="quat_xyzw">1 0 0 0 0 {half} {half}</pose>'
    radians = "<pose>1 0 0 0 0 1.5707963267948966</pose>"
    for pose in (quaternion, radians):
        file = world(tmp_path / "a.sdf", model(BOX, pose=pose))
        assert_same(written(taken(file, overwrite=True)), posed(at(1, 0, 0, 0, 0, 90)))


@pytest.mark.parametrize(
    ("geometry", "size", "volume"),
    [
        ("<box><size>1 2 3</size></box>", (1, 2, 3), 6),
        ("<sphere><radius>2</radius></sphere>", (4, 4, 4), 4 / 3 * np.pi * 8),
        ("<cylinder><radius>1</radius><length>3</length></cylinder>", (2, 2, 3), 3 * np.pi),
        ("<cone><radius>1</radius><length>3</length></cone>", (2, 2, 3), np.pi),
        ("<ellipsoid><radii>1 2 3</radii></ellipsoid>", (2, 4, 6), 8 * np.pi),
        ("<capsule><radius>1</radius><length>3</length></capsule>", (2, 2, 5), 13 / 3 * np.pi),
    ],
)
def test_shapes(tmp_path: Path, geometry: str, size: tuple, volume: float) -> None:
    """Centred on their pose; the volume lacks what flat triangles cut off a round surface."""
    file = world(tmp_path / "a.sdf", model(visual(geometry), pose="<pose>1 2 3 0 0 0</pose>"))
    mesh = written(taken(file))
    middle = np.array([1, 2, 3])
    half = np.array(size) / 2
    np.testing.assert_allclose(mesh.bounds, [middle - half, middle + half], rtol=0, atol=2e-3)
    assert 0.995 * volume < mesh.volume <= volume * (1 + 1e-9)


def test_a_plane_faces_its_normal(tmp_path: Path) -> None:
    plane = "<plane><normal>1 0 0</normal><size>4 4</size></plane>"
    mesh = written(taken(world(tmp_path / "a.sdf", model(visual(plane)))))
    np.testing.assert_allclose(mesh.face_normals, [[1, 0, 0]] * 2, rtol=0, atol=1e-6)
    np.testing.assert_allclose(mesh.extents, [0, 4, 4], rtol=0, atol=1e-6)


@pytest.mark.parametrize("center", [False, True])
def test_one_submesh(tmp_path: Path, models: Path, center: bool) -> None:
    only = f"<submesh><name>second</name><center>{center}</center></submesh>"
    mesh = f"<mesh><uri>model://crate/meshes/wedge.dae</uri>{only}</mesh>"
    got = written(taken(world(tmp_path / "a.sdf", model(visual(mesh))), model_path=(models,)))
    expected = tetrahedron().apply_translation([0, 0, -4])
    if center:
        expected.apply_translation(-expected.bounds.mean(axis=0))
    assert_same(got, expected)


@pytest.mark.parametrize(
    ("material", "expected"),
    [
        ("<script><name>Gazebo/WoodFloor</name></script>", "wood-dry"),
        ("<diffuse>1 1 1 1</diffuse>", "paint-white"),
        ("<ambient>0.5 0.1 0.1 1</ambient>", "steel-painted"),
        ("<pbr><metal><albedo_map>brick_albedo.png</albedo_map></metal></pbr>", "brick"),
        ("<pbr><metal><metalness>1.0</metalness></metal></pbr>", "steel-painted"),
        ("", "concrete"),
    ],
)
def test_materials(tmp_path: Path, material: str, expected: str) -> None:
    rest = f"<material>{material}</material>"
    report = taken(world(tmp_path / "a.sdf", model(visual(BOX_SHAPE, rest))))
    assert report.written.scene.objects[0].material.name == expected
    assert any("brick_albedo" in note for note in report.notes) == ("albedo" in material)


BOX_SHAPE = "<box><size>1 1 1</size></box>"


def test_what_is_left_out_is_told(tmp_path: Path) -> None:
    heightmap = visual("<polyline><height>1</height></polyline>", name="hills")
    unseen = visual(BOX_SHAPE, "<transparency>1</transparency>", "ghost")
    body = '<light name="lamp" type="point"/><actor name="a"/>' + model(
        BOX + heightmap + unseen + "<collision name='c'/>"
    )
    report = taken(world(tmp_path / "a.sdf", body))
    text = " ".join(report.notes)
    assert all(word in text for word in ("lamps", "<actor>", "polyline", "ghost"))
    assert len(report.written.scene.objects) == 1


MESH = "<mesh><uri>{}</uri></mesh>"


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (model(visual(MESH.format("gone.dae"))), "visual 'v': mesh: no file 'gone.dae'; searched"),
        (model(visual(MESH.format("model://gone/a.dae"))), "no file 'model://gone/a.dae'"),
        (model(visual(MESH.format("https://x.org/a.dae"))), "on the network"),
        (model(visual(MESH.format("../../etc/passwd"))), "outside the folders"),
        (model(visual(MESH.format("file:///etc/passwd"))), "outside the folders"),
        (model(visual(MESH.format("model://../../a.dae"))), "outside the folders"),
        (model(visual(MESH.format(""))), "empty"),
        (model(visual(MESH.format("a.world"))), "mesh 'a.world': .*allowed: .dae, .glb"),
        (model(visual("<bax/>")), "geometry bax is unknown"),
        (
            model(visual("<box><size>1 2</size></box>")),
            "expected 3 finite numbers; found '1 2'",
        ),
        (model(visual("<box><size>1 2 0</size></box>")), "size should be a positive number"),
        (model(visual("<sphere><radius>nan</radius></sphere>")), "radius: expected 1 finite"),
        (model(visual("<sphere><radius/></sphere>")), "sphere: radius: expected 1 finite numbers"),
        (model(visual("<heightmap><uri>h.png</uri></heightmap>")), "heightmap: no file 'h.png'"),
        ('<light type="directional"><direction>0 0 0</direction></light>' + model(BOX), "is zero"),
        ('<light type="directional"><diffuse>1 x</diffuse></light>' + model(BOX), "diffuse|colour"),
        (model(BOX, pose="<pose>1 2 3</pose>"), "model 'm': pose: expected 6 finite numbers"),
        (model(BOX, pose="<pose>nan 2 3 0 0 0</pose>"), "expected 6 finite numbers; found .nan"),
        (model(BOX, pose='<pose relative_to="nn"/>'), "no frame 'nn'"),
        (
            '<frame name="a" attached_to="b"/><frame name="b" attached_to="a"/>'
            + model(BOX, pose='<pose relative_to="a"/>'),
            "circle: m → a → b → a",
        ),
        ("<include><uri>model://gone</uri></include>", "include 'model://gone': no file"),
        ("<include><uri>a.world</uri></include>", "includes itself: .*a.world → .*a.world"),
        ('<light name="l"/>', "has no visuals"),
    ],
)
def test_refused(tmp_path: Path, body: str, message: str) -> None:
    file = world(tmp_path / "a.world", body)
    with pytest.raises(InputError, match=message):
        taken(file)
    assert [path.name for path in tmp_path.iterdir()] == ["a.world"]


def test_models_that_include_each_other(tmp_path: Path) -> None:
    for name, other in (("a", "b"), ("b", "a")):
        body = f"<include><uri>{other}.sdf</uri></include>"
        text = f'<sdf version="1.9"><model name="{name}">{body}</model></sdf>'
        (tmp_path / f"{name}.sdf").write_text(text)
    with pytest.raises(InputError, match=r"a.sdf → .*b.sdf → .*a.sdf"):
        taken(tmp_path / "a.sdf")


def test_includes_that_double_are_stopped(tmp_path: Path) -> None:
    """Fifteen files of ten includes each stand for 10^15 models."""
    for level in range(15):
        rows = "".join(
            f"<include><uri>{level + 1}.sdf</uri><name>n{i}</name></include>" for i in range(10)
        )
        text = f'<sdf version="1.9"><model name="m">{rows}</model></sdf>'
        (tmp_path / f"{level}.sdf").write_text(text)
    (tmp_path / "15.sdf").write_text(f'<sdf version="1.9">{model("")}</sdf>')
    with pytest.raises(InputError, match="more than 5,000 includes"):
        taken(tmp_path / "0.sdf")


def test_includes_that_are_nested_too_deeply(tmp_path: Path) -> None:
    for level in range(30):
        body = f"<include><uri>{level + 1}.sdf</uri></include>"
        text = f'<sdf version="1.9"><model name="m">{body}</model></sdf>'
        (tmp_path / f"{level}.sdf").write_text(text)
    with pytest.raises(InputError, match="nested more than 16 deep"):
        taken(tmp_path / "0.sdf")


def test_what_other_parsers_overlook(tmp_path: Path) -> None:
    """Dashes in comments, prefixes without a name space, two colons, space before all."""
    text = (
        '\n<?xml version="1.0"?><!-- gz sim -r --headless -->\n<sdf version="1.9">'
        '<world name="w" gz:expressed_in="x"><gz::system a="1"/><gz:frame/>'
        f"{model(BOX)}</world></sdf>"
    )
    (tmp_path / "a.sdf").write_text(text)
    assert_same(written(taken(tmp_path / "a.sdf")), posed(np.eye(4)))


def test_document_types_are_not_put_together(tmp_path: Path) -> None:
    text = '<!DOC<!-- -->TYPE sdf [<!ENTITY a "b">]><sdf version="1.9"/>'
    (tmp_path / "a.sdf").write_text(text)
    with pytest.raises(InputError, match=r"not valid XML|document type"):
        taken(tmp_path / "a.sdf")


def test_joints_and_links_of_one_name(tmp_path: Path) -> None:
    body = (
        '<model name="m"><link name="wheel"><pose>5 0 0 0 0 0</pose></link>'
        '<joint name="wheel"><child>wheel</child><pose>0 9 0 0 0 0</pose></joint>'
        f'<link name="hub"><pose relative_to="wheel">1 0 0 0 0 0</pose>{BOX}</link></model>'
    )
    report = taken(world(tmp_path / "a.sdf", body))
    assert_same(written(report), posed(at(6, 0, 0, 0, 0, 0)))
    assert any("'wheel'" in note for note in report.notes)


def test_merged_models_lend_their_frames(tmp_path: Path) -> None:
    text = f'<sdf version="1.9"><model name="base"><link name="top"><pose>0 0 2 0 0 0</pose>{BOX}'
    (tmp_path / "base.sdf").write_text(f"{text}</link></model></sdf>")
    body = (
        '<model name="m"><include merge="true"><uri>base.sdf</uri><pose>4 0 0 0 0 0</pose>'
        f'</include><link name="more"><pose relative_to="top">0 0 3 0 0 0</pose>{BOX}</link>'
        "</model>"
    )
    both = [posed(at(4, 0, 2, 0, 0, 0)), posed(at(4, 0, 5, 0, 0, 0))]
    got = written(taken(world(tmp_path / "a.sdf", body)))
    assert_same(got, trimesh.util.concatenate(both))


def test_includes_without_a_scheme(models: Path, tmp_path: Path) -> None:
    file = world(tmp_path / "a.sdf", "<include><uri>crate</uri></include>")
    assert len(taken(file, model_path=(models,)).written.scene.objects) == 2
    with pytest.raises(InputError, match="include 'crate': no file 'crate'"):
        taken(file, overwrite=True)


def test_missing_files_are_left_out(tmp_path: Path) -> None:
    body = "".join(
        [
            "<include><uri>https://fuel.gazebosim.org/1.0/a/models/Oak</uri></include>",
            "<include><uri>model://../secret</uri></include>",
            model(BOX + visual(MESH.format("gone.dae"), name="gone")),
        ]
    )
    file = world(tmp_path / "a.sdf", body)
    report = taken(file)
    assert_same(written(report), posed(np.eye(4)))
    left_out = [note for note in report.notes if note.startswith("left out: ")]
    assert [word in note for note, word in zip(left_out, ("Oak", "secret", "gone"), strict=True)]


def test_nothing_is_left(tmp_path: Path) -> None:
    file = world(tmp_path / "a.sdf", model(visual(MESH.format("gone.dae"))))
    with pytest.raises(InputError, match=r"has no visuals; .*no file 'gone\.dae'"):
        taken(file)


@pytest.mark.parametrize("host", ["fuel.gazebosim.org", "fuel.ignitionrobotics.org"])
def test_what_gazebo_has_downloaded(tmp_path: Path, host: str) -> None:
    """The newest version under names in lower case, whichever name the host has."""
    for version, size in (("2", "1 1 1"), ("10", "1 2 3")):
        home = tmp_path / "fuel" / "fuel.gazebosim.org" / "open robotics" / "models" / "oak tree"
        (home / version).mkdir(parents=True)
        box = visual(f"<box><size>{size}</size></box>")
        text = f'<sdf version="1.9">{model(box)}</sdf>'
        (home / version / "model.sdf").write_text(text)
    (tmp_path / "worlds").mkdir()
    uri = f"https://{host}/1.0/Open Robotics/models/Oak Tree"
    file = world(tmp_path / "worlds" / "a.sdf", f"<include><uri>{uri}</uri></include>")
    assert_same(written(taken(file, fuel=tmp_path / "fuel")), posed(np.eye(4)))
    for outside in ("../..", "..", "x/../.."):
        body = f"<include><uri>https://{host}/1.0/a/models/{outside}</uri></include>"
        with pytest.raises(InputError, match=r"network|outside"):
            taken(
                world(tmp_path / "worlds" / "b.sdf", body), fuel=tmp_path / "fuel", overwrite=True
            )


def test_heightmaps(tmp_path: Path) -> None:
    """The top of the picture is in the north, white is high."""
    picture = np.zeros((3, 5))
    picture[0, 4] = 1.0
    matplotlib.image.imsave(tmp_path / "h.png", picture, cmap="gray", vmin=0, vmax=1)
    shape = "<heightmap><uri>h.png</uri><size>8 4 3</size><pos>0 0 1</pos></heightmap>"
    report = taken(world(tmp_path / "a.sdf", model(visual(shape))))
    mesh = written(report)
    np.testing.assert_allclose(mesh.bounds, [[-4, -2, 1], [4, 2, 4]], atol=1e-6)
    np.testing.assert_allclose(mesh.vertices[mesh.vertices[:, 2].argmax()], [4, 2, 4], atol=1e-6)
    assert len(mesh.faces) == 16
    assert (mesh.face_normals[:, 2] > 0).all()
    assert report.written.scene.objects[0].material.name == "soil-field"


@pytest.mark.parametrize(
    ("size", "message"), [("0 1 1", "size should be positive"), ("1 1 nan", "finite numbers")]
)
def test_heightmaps_that_are_none(tmp_path: Path, size: str, message: str) -> None:
    (tmp_path / "h.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(40))
    shape = f"<heightmap><uri>h.png</uri><size>{size}</size></heightmap>"
    with pytest.raises(InputError, match=message):
        taken(world(tmp_path / "a.sdf", model(visual(shape))))
    shape = "<heightmap><uri>h.png</uri></heightmap>"
    with pytest.raises(InputError, match=r"heightmap: picture 'h\.png' cannot be read"):
        taken(world(tmp_path / "a.sdf", model(visual(shape))))


def test_sun_and_sky(tmp_path: Path) -> None:
    """A light's direction is turned by its pose; brightness is of a clear day."""
    light = (
        '<scene><ambient>0.5 0.5 0.5 1</ambient></scene><light name="sun" type="directional">'
        "<pose degrees='true'>0 0 9 0 0 90</pose><direction>1 0 -1</direction>"
        "<intensity>0.5</intensity><diffuse>0.8 0.8 0.8 1</diffuse></light>"
    )
    ambient = taken(world(tmp_path / "a.sdf", light + model(BOX))).written.scene.ambient
    assert (ambient.sun_klx, ambient.sky_klx) == pytest.approx((40, 10))
    np.testing.assert_allclose(ambient.sun_direction, np.array([0, 1, -1]) / np.sqrt(2), atol=1e-6)


def test_a_sky_alone(tmp_path: Path) -> None:
    body = "<scene><sky/></scene>" + model(BOX)
    ambient = taken(world(tmp_path / "a.sdf", body)).written.scene.ambient
    assert (ambient.sun_klx, ambient.sky_klx) == (0, 20)


def test_a_floor_where_asked_for(tmp_path: Path) -> None:
    file = world(tmp_path / "a.sdf", model(BOX))
    scene = taken(file, ground="grass").written.scene
    thing, floor = scene.objects
    assert (floor.name, floor.material.name) == ("ground", "grass")
    assert floor.mesh.bounds[:, 2] == pytest.approx(thing.mesh.bounds[0, 2])
    assert floor.mesh.extents[0] == pytest.approx(61)
    with pytest.raises(InputError, match="--ground: unknown material 'gras': did you mean 'grass'"):
        taken(file, ground="gras", overwrite=True)

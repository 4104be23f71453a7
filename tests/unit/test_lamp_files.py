"""Lamps and volumes of any shape stand where a scene file puts them; mistakes in them are told."""

import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh

from reconstruction.base.errors import InputError
from spisim.scene import Scene, SceneWarning, load_scene
from spisim.scene.volumes import contains

SCENE = """
name: test
drone: {position_m: [0, 0, 1], look_at_m: [5, 0, 1]}
objects:
  - {name: wall, shape: rectangle, size_m: [4, 4], translate_m: [5, 0, 1], material: concrete}
  - {name: vessel, shape: sphere, radius_m: 0.4, translate_m: [3, 0, 1], material: concrete,
     velocity_m_s: [0, 2, 0]}
"""
BULB = "name: bulb, type: point, position_m: [2, 0, 3]"


def load(folder: Path, lamps: str = "", volumes: str = "") -> Scene:
    text = SCENE
    for name, row in (("lamps", lamps), ("volumes", volumes)):
        text += f"{name}:\n  - {{{row}}}\n" if row else ""
    path = folder / "scene.yaml"
    path.write_text(text, encoding="utf-8")
    return load_scene(path)


@pytest.mark.parametrize(
    ("row", "quantity", "amount", "unit"),
    [
        (BULB + ", intensity_w_per_sr: 2", "power", 8 * np.pi, "W"),
        (BULB + ", luminous_flux_lm: 800", "power", 0.8, "klm"),
        ("name: a, type: area, object: wall, radiance_w_per_m2_sr: 2", "power", 32 * np.pi, "W"),
        ("name: a, type: area, object: wall, power_w: 3", "power", 3, "W"),
        (
            "name: s, type: spot, position_m: [0, 0, 2], direction: [0, 0, -3], cutoff_deg: 60,"
            " beam_deg: 60, intensity_w_per_sr: 1",
            "power",
            np.pi,
            "W",
        ),
        (
            "name: d, type: directional, direction: [0, 0, -2], illuminance_klx: 3",
            "irradiance",
            3,
            "klx",
        ),
        (
            "name: e, type: environment, radiance_w_per_m2_sr: 0.1",
            "mean radiance",
            0.1,
            "W/(m² sr)",
        ),
    ],
)
def test_lamp(tmp_path: Path, row: str, quantity: str, amount: float, unit: str) -> None:
    (lamp,) = load(tmp_path, lamps=row).lamps
    reported = lamp.summary()
    assert (reported["quantity"], reported["unit"]) == (quantity, unit)
    assert reported["amount"] == pytest.approx(amount, rel=1e-6)


def test_environment_of_a_picture(tmp_path: Path) -> None:
    np.save(tmp_path / "hall.npy", np.full((4, 8), 3.0, np.float32))
    (lamp,) = load(
        tmp_path,
        "name: e, type: environment, luminance_kcd_per_m2: 0.5, picture: hall.npy,"
        " rotate_deg: [0, 0, 90]",
    ).lamps
    assert lamp.summary()["amount"] == pytest.approx(1.5)
    np.testing.assert_allclose(lamp.to_world @ [1, 0, 0], [0, 1, 0], atol=1e-12)


@pytest.mark.parametrize(
    ("row", "parts"),
    [
        ("name: a, type: pont", ["lamps[0]", "'pont'", "did you mean 'point'"]),
        ("name: a, position_m: [0, 0, 1]", ["lamps[0]", "type is missing"]),
        (BULB, ["lamps[0]", "intensity_w_per_sr, power_w, luminous_flux_lm"]),
        (BULB + ", power_w: 1, luminous_flux_lm: 3", ["lamps[0]", "needs one of"]),
        (BULB + ", power_w: 0", ["lamps[0].power_w", "greater than 0"]),
        (BULB + ", power_w: .nan", ["lamps[0].power_w"]),
        ("name: a, type: area, object: wal, power_w: 1", ["lamps[0] (a)", "did you mean 'wall'"]),
        (
            "name: a, type: directional, direction: [0, 0, 0], illuminance_klx: 1",
            ["lamps[0] (a)", "direction should not be zero"],
        ),
        (
            "name: a, type: spot, position_m: [0, 0, 0], direction: [1, 0, 0], power_w: 1,"
            " beam_deg: 40",
            ["lamps[0]", "beam_deg", "at most cutoff_deg"],
        ),
        (
            "name: a, type: environment, radiance_w_per_m2_sr: 1, picture: no.npy",
            ["lamps[0] (a)", "no picture 'no.npy'"],
        ),
    ],
)
def test_mistake_in_a_lamp(tmp_path: Path, row: str, parts: list[str]) -> None:
    with pytest.raises(InputError) as raised:
        load(tmp_path, lamps=row)
    for part in parts:
        assert part in str(raised.value)


@pytest.mark.parametrize("values", [-np.ones((4, 8)), np.zeros((4, 8)), np.ones(4)])
def test_unfit_environment(tmp_path: Path, values: np.ndarray) -> None:
    np.save(tmp_path / "hall.npy", values)
    with pytest.raises(InputError, match=r"lamps\[0\] \(e\).*hall.npy"):
        load(tmp_path, "name: e, type: environment, radiance_w_per_m2_sr: 1, picture: hall.npy")


def test_two_lamps_of_one_name(tmp_path: Path) -> None:
    row = BULB + ", power_w: 1"
    with pytest.raises(InputError, match="lamps: two of them are named 'bulb'"):
        load(tmp_path, lamps=row + "}\n  - {" + row)


def test_volume_in_a_ball(tmp_path: Path) -> None:
    (puff,) = load(
        tmp_path, volumes="name: puff, radius_m: 0.5, translate_m: [2, 1, 0], extinction_per_m: 1"
    ).volumes
    points = np.array([[2, 1, 0.49], [2, 1.4, 0.4], [2, 1, -0.51]])
    np.testing.assert_array_equal(contains(puff, points), [True, False, False])


def test_volume_in_a_mesh_that_faces_in(tmp_path: Path) -> None:
    """It is turned: what is filled has no front."""
    mesh = trimesh.creation.box((1, 2, 3))
    mesh.invert()
    mesh.export(tmp_path / "bounds.ply")
    (puff,) = load(
        tmp_path,
        volumes="name: puff, mesh: bounds.ply, scale: 0.5, rotate_deg: [0, 0, 90],"
        " translate_m: [2, 0, 1], extinction_per_m: 1",
    ).volumes
    points = np.array([[2.45, 0.2, 1.7], [2.2, 0.45, 1], [2, 0, 1.8]])
    np.testing.assert_array_equal(contains(puff, points), [True, False, False])
    corners = puff.to_world @ np.array([[0, 0, 0, 1], [1, 1, 1, 1]]).T
    np.testing.assert_allclose(sorted(corners[0]), [1.5, 2.5], atol=1e-9)


def test_volume_in_an_object_moves_with_it(tmp_path: Path) -> None:
    scene = load(tmp_path, volumes="name: milk, object: vessel, extinction_per_m: 1")
    following = scene.at(0.5).volumes[0]
    points = np.array([[3.0, 0, 1], [3.0, 1, 1]])
    np.testing.assert_array_equal(contains(scene.volumes[0], points), [True, False])
    np.testing.assert_array_equal(contains(following, points), [False, True])
    np.testing.assert_allclose(
        following.to_world[:3, 3] - scene.volumes[0].to_world[:3, 3], [0, 1, 0]
    )


@pytest.mark.parametrize(
    ("row", "parts"),
    [
        ("name: a, object: wall", ["volumes[0] (a)", "'wall' is not closed"]),
        ("name: a, object: vesel", ["volumes[0] (a)", "did you mean 'vessel'"]),
        ("name: a, mesh: no.ply", ["volumes[0] (a)", "no mesh 'no.ply'"]),
        ("name: a, radius_m: 0", ["volumes[0].radius_m", "greater than 0"]),
        ("name: a, radius_m: 1, size_m: [1, 1, 1]", ["volumes[0]", "'size_m'"]),
        ("name: a, object: vessel, translate_m: [0, 0, 1]", ["volumes[0]", "'translate_m'"]),
    ],
)
def test_mistake_in_a_volume(tmp_path: Path, row: str, parts: list[str]) -> None:
    with pytest.raises(InputError) as raised:
        load(tmp_path, volumes=row + ", extinction_per_m: 1")
    for part in parts:
        assert part in str(raised.value)


def test_warns_of_volumes_that_overlap_by_their_shapes(tmp_path: Path) -> None:
    """The corner of a ball's box is no part of the ball."""
    ball = "name: a, radius_m: 0.5, extinction_per_m: 1"
    other = "name: b, radius_m: 0.5, extinction_per_m: 1, translate_m: "
    with warnings.catch_warnings():
        warnings.simplefilter("error", SceneWarning)
        load(tmp_path, volumes=ball + "}\n  - {" + other + "[0.8, 0.8, 0]")
    with pytest.warns(SceneWarning, match="overlap"):
        load(tmp_path, volumes=ball + "}\n  - {" + other + "[0.5, 0.3, 0]")

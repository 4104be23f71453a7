"""Meshes that light cannot be traced through soundly are told; sound ones are not."""

import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh

from reconstruction.base.errors import InputError
from scenefiles import MINIMAL, Load, with_objects
from spisim.scene import SceneWarning, soundness


def without_warning(load: Load, text: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load(text)


def solid(path: Path, vertices: np.ndarray, faces: np.ndarray) -> None:
    trimesh.Trimesh(vertices, faces, process=False).export(path)


@pytest.fixture
def odd_meshes(tmp_path: Path) -> None:
    """Meshes with one thing wrong each, next to sound ones that look suspicious."""
    box = trimesh.creation.box((1, 1, 1))
    vertices, faces = np.asarray(box.vertices), np.asarray(box.faces)
    solid(tmp_path / "inverted.ply", vertices, faces[:, ::-1])
    flipped = faces.copy()
    flipped[0] = flipped[0, ::-1]
    solid(tmp_path / "flipped.ply", vertices, flipped)
    fin = np.vstack([faces, [faces[0, 0], faces[0, 1], len(vertices)]])
    solid(tmp_path / "fin.ply", np.vstack([vertices, [2, 2, 2]]), fin)
    solid(tmp_path / "open.ply", vertices, faces[1:])
    solid(tmp_path / "soup.ply", vertices[faces].reshape(-1, 3), np.arange(36).reshape(-1, 3))
    away = np.vstack([vertices, vertices + np.array([1, 1, 0])])
    solid(tmp_path / "touching.ply", away, np.vstack([faces, faces + len(vertices)]))
    solid(tmp_path / "flat.ply", vertices * (1, 1, 0), faces)
    repeated = [[0, 0, 1], [0, 1, 1], [0, 1, 2], [0, 2, 3], [0, 3, 3]]  # a polygon 0 0 1 1 2 3 3
    solid(tmp_path / "repeated.ply", [[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]], repeated)
    hollow = np.vstack([vertices, vertices / 2])
    solid(tmp_path / "hollow.ply", hollow, np.vstack([faces, faces[:, ::-1] + len(vertices)]))


@pytest.mark.usefixtures("odd_meshes")
def test_unsound_meshes_are_named_in_one_warning(load: Load) -> None:
    text = with_objects(
        *(
            f"name: {name}, mesh: {name}.ply, translate_m: [{3 * i}, 5, 0], material: brick"
            for i, name in enumerate(["inverted", "flipped", "fin", "solid", "open"])
        )
    )
    with pytest.warns(SceneWarning) as caught:
        assert len(load(text).objects) == 6
    (warning,) = caught
    message = str(warning.message)
    assert "scene 'test'" in message
    assert "'inverted' (inside out)" in message
    assert "'flipped' (triangles facing in and out)" in message
    assert "'fin' (edges shared by more than two triangles)" in message
    assert not any(name in message for name in ("wall", "solid", "open"))


@pytest.mark.usefixtures("odd_meshes")
@pytest.mark.parametrize("name", ["open", "soup", "touching", "hollow", "flat", "repeated"])
def test_sound_meshes_that_look_suspicious(load: Load, name: str) -> None:
    without_warning(
        load, with_objects(f"name: it, mesh: {name}.ply, translate_m: [3, 5, 0], material: brick")
    )


def test_room_is_sound_only_around_the_drone(load: Load) -> None:
    without_warning(load, with_objects("name: room, mesh: room.ply, material: brick"))
    elsewhere = "name: room, mesh: room.ply, translate_m: [50, 0, 0], material: brick"
    with pytest.warns(SceneWarning, match=r"'room' \(inside out\)"):
        load(with_objects(elsewhere))


def test_a_drone_beyond_all_distances_is_told(load: Load) -> None:
    with pytest.warns(SceneWarning, match=r"the drone is 1e\+12 m from the origin"):
        load(MINIMAL.replace("position_m: [0, 0, 1]", "position_m: [-1.0e+12, 0, 1]"))


@pytest.mark.parametrize(
    ("scale", "x_m", "reported"),
    [
        (1e-4, 500, r"is 0\.0001 m wide"),
        (100, 500, None),
        (3000, 5000, None),  # a hill
        (1, 20_000, r"is 2e\+04 m from the origin"),
    ],
)
def test_sizes_of_another_unit_are_told(
    load: Load, scale: float, x_m: float, reported: str | None
) -> None:
    text = with_objects(
        f"name: other drone, shape: box, size_m: [1, 1, 0.2], scale: {scale},"
        f" translate_m: [{x_m}, 0, 0], material: brick"
    )
    if reported is None:
        without_warning(load, text)
        return
    with pytest.warns(SceneWarning, match=rf"'other drone' {reported}; all lengths are metres"):
        load(text)


@pytest.mark.parametrize("nonsense", ["scale: 1e30", "translate_m: [0, -1e30, 0]"])
def test_what_is_too_far_away_to_trace_is_refused(load: Load, nonsense: str) -> None:
    with pytest.raises(
        InputError, match=r"\(box\): reaches 1e\+30.* m from the origin; at most 1e"
    ):
        load(with_objects(f"name: box, shape: box, size_m: [2, 2, 2], {nonsense}, material: brick"))


@pytest.mark.parametrize(
    ("ambient", "reported"),
    [
        ("sun_klx: 1.0e+9, sun_direction: [0, 0, -1]", "sun_klx 1e+09 is more"),
        ("sky_klx: 200", "sky_klx 200 is more than the 150 klx that daylight has at most"),
        ("sun_klx: 90, sun_direction: [1, 0, 0.1]", "the sun stands below the horizon"),
    ],
)
def test_daylight_that_the_earth_does_not_have_is_told(
    load: Load, ambient: str, reported: str
) -> None:
    with pytest.warns(SceneWarning) as caught:
        load(f"{with_objects()}ambient: {{{ambient}}}\n")
    (warning,) = caught
    assert reported in str(warning.message)


@pytest.mark.parametrize("ambient", ["sun_klx: 130, sky_klx: 20", "sun_direction: [0, 0, 1]"])
def test_daylight_as_it_is_is_fine(load: Load, ambient: str) -> None:
    without_warning(load, f"{with_objects()}ambient: {{{ambient}}}\n")


@pytest.mark.usefixtures("odd_meshes")
def test_copies_are_checked_once_and_named_each(
    load: Load, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They differ by a rotation and a move, which make nothing sound or unsound."""
    checked: list[int] = []
    fault = soundness.fault
    monkeypatch.setattr(soundness, "fault", lambda mesh: checked.append(1) or fault(mesh))
    poses = ", ".join(
        f"{{translate_m: [{3 * i}, 5, 0], rotate_deg: [0, 0, {i}]}}" for i in range(9)
    )
    text = with_objects(f"name: fin, mesh: fin.ply, material: brick, instances: [{poses}]")
    with pytest.warns(SceneWarning, match=r"'fin-1' .*'fin-9' \(edges shared"):
        load(text)
    assert len(checked) == 2  # the wall, and one of the nine

"""Scenes of one stock share what they have in common, and never anything that has changed."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from reconstruction.base.errors import InputError
from spisim.scene import Scene, make_scene
from spisim.scene import load_context as cache_module
from spisim.scene.content import surface_content
from spisim.scene.families import FAMILIES
from spisim.scene.load_context import SceneCache

TEXT = """
name: two
drone: {position_m: [0, 0, 1], look_at_m: [4, 0, HEIGHT]}
fog: {kind: moderate-radiation, visibility_m: VISIBILITY}
materials: {mine: {reflectance: REFLECTANCE, source: test}}
objects:
  - {name: wall, mesh: wall.ply, material: mine, translate_m: [4, 0, 0]}
  - {name: ball, shape: sphere, radius_m: 0.3, material: concrete, translate_m: [3, 0, 1]}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    trimesh.creation.box((0.1, 8, 8)).export(tmp_path / "wall.ply")
    return tmp_path


def made(cache: SceneCache, folder: Path, **words: object) -> Scene:
    text = TEXT
    for word, value in {"HEIGHT": 1, "VISIBILITY": 50, "REFLECTANCE": 0.3, **words}.items():
        text = text.replace(word, str(value))
    return make_scene(text, folder, "test", cache=cache)


def drawn(cache: SceneCache, seed: int, fog: str = "") -> Scene:
    return make_scene(f"family: targets\nseed: {seed}\n{fog}", Path(), "test", cache=cache)


def test_other_weather_and_poses_share_their_objects(folder: Path) -> None:
    cache = SceneCache()
    first = made(cache, folder)
    second = made(cache, folder, HEIGHT=1.2, VISIBILITY=20)
    assert second.objects is first.objects
    assert second.atmosphere.extinction_per_m != first.atmosphere.extinction_per_m
    assert not np.array_equal(second.drone_pose, first.drone_pose)


def test_scenes_without_a_stock_share_nothing(folder: Path) -> None:
    text = TEXT.replace("HEIGHT", "1").replace("VISIBILITY", "50").replace("REFLECTANCE", "0.3")
    first, second = (make_scene(text, folder, "test") for _ in range(2))
    assert first.objects[0].mesh is not second.objects[0].mesh
    assert surface_content(first.objects) == surface_content(second.objects)


def test_another_material_makes_other_objects(folder: Path) -> None:
    cache = SceneCache()
    made(cache, folder)
    assert made(cache, folder, REFLECTANCE=0.4).objects[0].material.reflectance == 0.4


def test_a_file_that_was_written_anew_is_read_anew(folder: Path) -> None:
    cache = SceneCache()
    made(cache, folder)
    file = folder / "wall.ply"
    before = file.stat()
    trimesh.creation.box((0.2, 8, 8)).export(file)
    assert file.stat().st_size == before.st_size
    assert made(cache, folder).objects[0].mesh.extents[0] == pytest.approx(0.2)


def test_objects_that_somebody_changed_are_made_anew(folder: Path) -> None:
    cache = SceneCache()
    first = made(cache, folder)
    first.objects[0].mesh.apply_translation((5, 0, 0))
    assert made(cache, folder).objects[0].mesh.bounds[1, 0] == pytest.approx(4.05)


@pytest.mark.parametrize("content", [None, b"no mesh"])
def test_a_file_that_went_away_or_broke_is_told(folder: Path, content: bytes | None) -> None:
    cache = SceneCache()
    made(cache, folder)
    (folder / "wall.ply").unlink()
    if content is not None:
        (folder / "wall.ply").write_bytes(content)
    with pytest.raises(InputError, match=r"objects\[0\] \(wall\)"):
        made(cache, folder)


def test_draws_of_a_family_are_shared_by_seed(monkeypatch: pytest.MonkeyPatch) -> None:
    family, built = FAMILIES["targets"], []
    build = family.build

    def counted(parameters, rng):  # type: ignore[no-untyped-def]
        built.append(parameters)
        return build(parameters, rng)

    monkeypatch.setattr(cache_module, "MAX_SCENES", 2)
    object.__setattr__(family, "build", counted)
    try:
        cache = SceneCache()
        first = drawn(cache, 3)
        once = len(built)
        again = drawn(cache, 3, "fog: {kind: moderate-radiation, visibility_m: 30}")
        assert len(built) == once
        assert again.objects is first.objects
        drawn(cache, 4)
        drawn(cache, 5)
        others = len(built)
        drawn(cache, 3)  # no longer kept
        assert len(built) > others
    finally:
        object.__setattr__(family, "build", build)


def test_what_is_kept_is_bounded(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache_module, "MAX_TRIANGLES", 6000)  # one scene has 5132
    cache = SceneCache()
    first = made(cache, folder)
    assert made(cache, folder).objects is first.objects
    made(cache, folder, REFLECTANCE=0.5)
    assert made(cache, folder).objects is not first.objects

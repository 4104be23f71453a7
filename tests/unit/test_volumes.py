"""Boxes of fog and smoke stand where a scene file puts them, and mistakes in them are told."""

import warnings
from pathlib import Path

import numpy as np
import pytest

from reconstruction.base.errors import InputError
from spisim.scene import Scene, SceneWarning, load_scene
from spisim.scene.pose import pose_matrix
from spisim.scene.volumes import overlap

SCENE = """
name: test
drone: {position_m: [0, 0, 1], look_at_m: [5, 0, 1]}
objects:
  - {name: wall, shape: rectangle, size_m: [4, 4], translate_m: [5, 0, 1], material: concrete}
volumes:
"""
BANK = "name: bank, size_m: [2, 4, 1], visibility_m: 50"


def load(folder: Path, *volumes: str) -> Scene:
    path = folder / "scene.yaml"
    path.write_text(SCENE + "".join(f"  - {{{volume}}}\n" for volume in volumes))
    return load_scene(path)


def test_box_is_scaled_turned_and_moved(tmp_path: Path) -> None:
    scene = load(tmp_path, BANK + ", translate_m: [3, 1, 2], rotate_deg: [0, 0, 90]")
    (bank,) = scene.volumes
    corners = bank.to_world @ np.array([[0, 0, 0, 1], [1, 0, 0, 1], [1, 1, 1, 1]]).T
    # x of the box (2 m) becomes y, its y (4 m) becomes -x
    np.testing.assert_allclose(corners[:3].T, [[5, 0, 1.5], [5, 2, 1.5], [1, 2, 2.5]], atol=1e-12)
    assert bank.density is None
    assert bank.medium.visibility_m == 50
    assert bank.medium.g == pytest.approx(0.7825, abs=1e-4)
    assert scene.atmosphere.extinction_per_m == 0
    assert scene.at(1.0).volumes == scene.volumes


def test_medium_by_coefficients_with_a_density(tmp_path: Path) -> None:
    plume = np.arange(24).reshape(2, 3, 4) / 23
    np.save(tmp_path / "plume.npy", plume)
    (smoke,) = load(
        tmp_path,
        "name: smoke, size_m: [1, 1, 1], extinction_per_m: 2, albedo: 0.7, phase: {g: 0.27},"
        " density: plume.npy",
    ).volumes
    assert (smoke.medium.extinction_per_m, smoke.medium.albedo, smoke.medium.g) == (2, 0.7, 0.27)
    assert smoke.density is not None
    assert smoke.density.dtype == np.float32
    np.testing.assert_allclose(smoke.density, plume, rtol=1e-6)


@pytest.mark.parametrize(
    ("volume", "parts"),
    [
        ("name: a, size_m: [1, 1, 1]", ["volumes[0]", "visibility_m or extinction_per_m"]),
        ("name: a, size_m: [1, 1, 1], extinction_per_m: 0", ["volumes[0] (a)", "greater than 0"]),
        ("name: a, size_m: [1, 1, 1], extinction_per_m: -1", ["volumes[0].extinction_per_m"]),
        (
            "name: a, size_m: [1, 1, 1], extinction_per_m: 1, albedo: 1.1",
            ["volumes[0].albedo", "less than or equal to 1", "1.1"],
        ),
        (BANK + ", albedo: 0.9", ["volumes[0]", "albedo does not go with visibility_m"]),
        (BANK + ", kind: thick", ["volumes[0] (bank)", "'thick'", "heavy-advection"]),
        (BANK + ", densty: x", ["volumes[0]", "'densty'", "did you mean 'density'"]),
        (BANK.replace("4", "0"), ["volumes[0].size_m[1]", "greater than 0"]),
        (BANK.replace("name: bank, ", ""), ["volumes[0].name", "missing"]),
    ],
)
def test_mistake_in_a_volume(tmp_path: Path, volume: str, parts: list[str]) -> None:
    assert_reported(tmp_path, [volume], parts)


@pytest.mark.parametrize(
    ("density", "parts"),
    [
        (np.ones((2, 2)), ["3-D", "(2, 2)"]),
        (np.ones((2, 0, 2)), ["3-D", "(2, 0, 2)"]),
        (np.full((2, 2, 2), np.nan), ["not finite"]),
        (np.full((2, 2, 2), np.inf), ["not finite"]),
        (np.linspace(-0.1, 1, 8).reshape(2, 2, 2), ["between 0 and 1", "-0.1"]),
        (np.full((2, 2, 2), 1.5), ["between 0 and 1", "1.5"]),
        (np.zeros((2, 2, 2)), ["zero everywhere"]),
        (np.full((2, 2, 2), "x"), ["real numbers"]),
        (np.full((2, 2, 2), 1j), ["real numbers"]),
    ],
    ids=["2-D", "empty", "nan", "inf", "negative", "above 1", "zero", "text", "complex"],
)
def test_unusable_density(tmp_path: Path, density: np.ndarray, parts: list[str]) -> None:
    np.save(tmp_path / "plume.npy", density)
    assert_reported(
        tmp_path, [BANK + ", density: plume.npy"], ["volumes[0] (bank)", "plume", *parts]
    )


def test_missing_or_broken_density(tmp_path: Path) -> None:
    (tmp_path / "plume.npy").write_bytes(b"no array")
    assert_reported(tmp_path, [BANK + ", density: plum.npy"], ["did you mean 'plume.npy'"])
    assert_reported(tmp_path, [BANK + ", density: plume.npy"], ["'plume.npy' cannot be read"])
    np.savez(tmp_path / "many.npz", a=np.ones((2, 2, 2)))
    assert_reported(tmp_path, [BANK + ", density: many.npz"], ["'many.npz' cannot be read"])


def test_two_volumes_of_one_name(tmp_path: Path) -> None:
    assert_reported(tmp_path, [BANK, BANK + ", translate_m: [9, 0, 0]"], ["two of them", "'bank'"])


def assert_reported(folder: Path, volumes: list[str], parts: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        load(folder, *volumes)
    message = str(caught.value)
    for part in ("scene.yaml", "volumes", *parts):
        assert part in message
    assert len(message.splitlines()) == 1


# Volumes in each other's way


def test_overlap_is_told_and_touching_is_not(tmp_path: Path) -> None:
    other = BANK.replace("bank", "plume") + ", translate_m: "
    with pytest.warns(SceneWarning, match="'bank' and 'plume' overlap: their extinctions add"):
        load(tmp_path, BANK, other + "[1.9, 0, 0]")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(load(tmp_path, BANK, other + "[2, 0, 0]").volumes) == 2


def box(
    size: tuple[float, ...], rotate: tuple[float, ...], centre: tuple[float, ...]
) -> np.ndarray:
    return pose_matrix(rotate, centre) @ np.diag([*size, 1]) @ pose_matrix((0, 0, 0), [-0.5] * 3)


@pytest.mark.parametrize("seed", range(30))
def test_overlap_of_random_boxes_agrees_with_points_in_both(seed: int) -> None:
    random = np.random.default_rng(seed)
    first, second = (
        box(random.uniform(0.3, 2, 3), random.uniform(-180, 180, 3), random.uniform(-1, 1, 3))
        for _ in range(2)
    )
    points = random.uniform(size=(20_000, 3))
    inside = (np.linalg.inv(second) @ first @ np.c_[points, np.ones(len(points))].T)[:3]
    shared = ((inside > 0) & (inside < 1)).all(axis=0).mean()
    if overlap(first, second):
        assert shared > 0 or _nearly_apart(first, second)
    else:
        assert shared == 0


def _nearly_apart(first: np.ndarray, second: np.ndarray) -> bool:
    """Whether boxes shrunk by 20 % are apart: then a shared sliver may hold no point."""
    shrink = pose_matrix((0, 0, 0), [0.1] * 3) @ np.diag([0.8, 0.8, 0.8, 1])
    return not overlap(first @ shrink, second @ shrink)


def test_crossed_edges_need_the_axis_between_them() -> None:
    """Two long boxes that cross like an X at a distance: no face separates them, an edge does."""
    bar = (4.0, 0.2, 0.2)
    reach = 0.1 * np.sqrt(2)  # of a square bar that stands on its edge
    lower = box(bar, (45, 0, 0), (0, 0, 0))
    for gap, meets in ((1.02, False), (0.98, True)):
        upper = box(bar, (45, 0, 90), (0, 0, 2 * reach * gap))
        assert overlap(lower, upper) is meets

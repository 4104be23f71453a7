"""The ground truth against trimesh's ray casting, which shares no code with ours."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from raycast import Comparison, compare

import spisim
from spisim.scene import list_scenes, make_scene
from spisim.transport import GroundTruth, ground_truth, ground_truths
from worlds import plane, scene, surface

INSTRUMENT = spisim.load_instrument("paper")


@pytest.mark.parametrize("name", list_scenes())
def test_truth_of_shipped_scenes(name: str) -> None:
    """Pixels that differ are on edges: of a thing, rays in single and double precision pass on
    either side."""
    result = compare(spisim.load_scene(name), INSTRUMENT)
    assert np.median(result.difference_m) < 1e-4
    assert np.max(result.inside_m, initial=0) < 1e-3
    assert np.abs(result.spots_m).max() < 1e-3
    assert np.mean(result.difference_m > 1e-3) < 0.002


def test_the_comparison_sees_a_shift() -> None:
    """A comparison that cannot fail would be none."""
    position = scene(plane(5), surface("ball", trimesh.creation.icosphere(3, 0.4), 0.5))
    ball = position.objects[1].mesh.apply_translation((0, 0, 4))
    result = compare(position, INSTRUMENT)
    assert np.max(result.difference_m) < 1e-4
    shifted = Comparison(result.truth_m + 0.002, result.trimesh_m, result.spots_m, result.edges)
    assert np.min(shifted.inside_m) > 1e-3
    assert 0 < result.edges.sum() < 0.2 * result.edges.size  # the rim of the ball, no more
    assert result.truth_m.min() == pytest.approx(ball.bounds[0, 2], abs=0.01)


WALL = """
  - {name: wall, shape: box, size_m: [1, 9, 9], translate_m: [5.5, 0, 1], material: concrete}"""
POST = """
  - {{name: post, shape: box, size_m: [0.2, 0.2, 3], translate_m: [3.1, {across_m}, 1],
     material: concrete}}"""


def corridor_m(objects: str, towards_x_m: float) -> float:
    drone = f"{{position_m: [0, 0, 1], look_at_m: [{towards_x_m}, 0, 1]}}"
    described = make_scene(f"name: hall\ndrone: {drone}\nobjects:{objects}\n", Path(), "test")
    truth = ground_truth(described, INSTRUMENT, subpixels=1)
    np.testing.assert_allclose(truth.pose, described.drone_pose)
    return truth.corridor_m


def test_the_corridor_ends_at_the_first_surface_within_it() -> None:
    assert corridor_m(WALL + POST.format(across_m=0.35), 5) == pytest.approx(3.0, rel=1e-5)
    # A post beside the corridor, 0.3 m from its axis: the wall is next.
    assert corridor_m(WALL + POST.format(across_m=0.45), 5) == pytest.approx(5.0, rel=1e-5)
    assert np.isnan(corridor_m(WALL, -5))


def test_views_traced_together_have_the_truth_of_each(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Three poses in one scene, two of which fit into a launch, and one of another scene."""
    drone = "{position_m: [0, 0, 1], look_at_m: [5, 0, 1]}"
    post = POST.format(across_m=0.45)
    described = f"name: hall\ndrone: {drone}\nobjects:{WALL}{post}\n"
    hall = make_scene(described, Path(), "test")
    towards_x = hall.drone_pose
    views = [(hall, INSTRUMENT)]
    for across_m in (0.5, -1.0):
        pose = towards_x.copy()
        pose[1, 3] += across_m
        views.append((replace(hall, drone_pose=pose), INSTRUMENT))
    views.append((scene(plane(5)), INSTRUMENT))
    rays = np.prod(INSTRUMENT.imaging.projector.shape)
    monkeypatch.setattr("spisim.transport.truth.RAYS_AT_A_TIME", int(2 * rays))
    results = ground_truths(views)
    assert len({result.corridor_m for result in results}) > 1
    for together, view in zip(results, views, strict=True):
        alone = ground_truth(*view)
        for field in fields(GroundTruth):
            one, other = (getattr(each, field.name) for each in (together, alone))
            np.testing.assert_array_equal(one, other, err_msg=field.name)

"""The ground truth against trimesh's ray casting, which shares no code with ours."""

import numpy as np
import pytest
import trimesh
from raycast import Comparison, compare

import spisim
from spisim.scene import list_scenes
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

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
    found = compare(spisim.load_scene(name), INSTRUMENT)
    assert np.median(found.difference_m) < 1e-4
    assert np.max(found.inside_m, initial=0) < 1e-3
    assert np.abs(found.spots_m).max() < 1e-3
    assert np.mean(found.difference_m > 1e-3) < 0.002


def test_the_comparison_sees_a_shift() -> None:
    """A comparison that cannot fail would be none."""
    place = scene(plane(5), surface("ball", trimesh.creation.icosphere(3, 0.4), 0.5))
    ball = place.objects[1].mesh.apply_translation((0, 0, 4))
    found = compare(place, INSTRUMENT)
    assert np.max(found.difference_m) < 1e-4
    shifted = Comparison(found.truth_m + 0.002, found.trimesh_m, found.spots_m, found.edges)
    assert np.min(shifted.inside_m) > 1e-3
    assert 0 < found.edges.sum() < 0.2 * found.edges.size  # the rim of the ball, no more
    assert found.truth_m.min() == pytest.approx(ball.bounds[0, 2], abs=0.01)

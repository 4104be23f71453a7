"""What is stated as the error of a pixel or a bin: as much as Student's t of its launches."""

from dataclasses import replace

import numpy as np
import pytest
from error_coverage import LIMITS, coverage, student_coverage

import worlds
from spisim.atmosphere import fog
from spisim.scene import Material
from spisim.scene.bsdf import Mirror
from spisim.simulation.light.stated_error import BINS, PIXELS, image_error, moderated
from spisim.transport.engine.estimator import transport_image
from spisim.transport.engine.sampling import MIN_LAUNCHES, PathBudget
from spisim.transport.world import build_world

VIEW = worlds.projector()
END = worlds.detector([0.05, 0.0, 0.0], area_m2=2e-6, half_angle_deg=14)
RUNS = 32


@pytest.mark.parametrize("around", [PIXELS, BINS])
def test_errors_of_the_whole_stay_as_they_are(around):
    """In the mean square, whatever the errors; equal ones each by itself."""
    error = np.random.default_rng(0).exponential(size=(7, 50)) ** 4
    stated = moderated(error, MIN_LAUNCHES, around)
    assert np.sum(stated**2) == pytest.approx(np.sum(error**2), rel=1e-12)
    np.testing.assert_allclose(moderated(np.full((7, 50), 3.0), 5, around), 3)


def test_a_pixel_that_met_nothing_states_what_its_neighbours_do():
    """Of eight launches the mean variance around counts as one degree of freedom in eight."""
    error = np.zeros((9, 9))
    error[4, 4] = 3
    stated = moderated(error, 8, PIXELS)
    assert stated[4, 4] ** 2 == pytest.approx(9 * (7 / 8 + 1 / 8 / 9))
    assert stated[3, 5] ** 2 == pytest.approx(9 / 8 / 9)
    assert np.count_nonzero(stated) == 9


@pytest.mark.parametrize("visibility_m", [None, 50.0], ids=["clear", "fog"])
def test_as_many_estimates_lie_within_their_errors_as_by_student(visibility_m):
    """Within one, two and beyond four, at one path per pixel and launch."""
    position = worlds.scene(*worlds.room())
    if visibility_m is not None:
        position = replace(position, atmosphere=fog(visibility_m, "moderate-radiation"))
    world = build_world(position)
    result = [
        transport_image(world, VIEW, END, PathBudget(MIN_LAUNCHES), seed=seed)
        for seed in worlds.seeds(RUNS)
    ]
    images = np.array([each.mean["image"] for each in result])
    errors = np.array([image_error(each, VIEW.shape).ravel() for each in result])
    off_student = coverage(images, errors) - student_coverage(MIN_LAUNCHES - 1)
    assert np.all(np.abs(off_student) < LIMITS)
    promised = np.mean(np.sum(errors**2, axis=1))
    assert np.sum(images.var(axis=0, ddof=1)) == pytest.approx(promised, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("extinction_per_m", [0.0, 0.06], ids=["clear", "fog"])
def test_beside_a_mirror_few_paths_state_errors_as_good_as_documented(extinction_per_m):
    """The exception of docs/theory/transport.md, at one path per pixel and launch."""
    mirror = replace(
        worlds.plane(4.5, tilt_rad=0.6, half_size_m=0.5),
        name="mirror",
        material=Material("mirror", 0.9, "test", Mirror()),
    )
    objects = (*worlds.room(), mirror)
    scene = worlds.scene(*objects, extinction_per_m=extinction_per_m, g=0.8, albedo=0.98)
    world, view = build_world(scene), worlds.projector(shape=(24, 24))
    result = [
        transport_image(world, view, END, PathBudget(MIN_LAUNCHES), seed=seed)
        for seed in worlds.seeds(RUNS)
    ]
    images = np.array([each.mean["image"] for each in result])
    errors = np.array([image_error(each, view.shape).ravel() for each in result])
    one, two, beyond_four = coverage(images, errors)
    assert 58 < one < 68
    assert 83 < two < 94
    assert beyond_four < 1.8

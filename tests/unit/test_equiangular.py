"""Equi-angular distances along a ray against their closed form in 64 bits."""

import numpy as np
import pytest

from spisim.transport.backend import activate
from spisim.transport.geometry import EquiAngular

# isort: split
import drjit as dr
import mitsuba as mi

U = np.linspace(0, 1, 1001, endpoint=False)
HEIGHTS_M = (1e-4, 0.003, 0.05, 1.0)
INTERVALS_M = ((0.0, 5.0), (0.3, 5.0), (2.0, 2.01), (0.0, np.inf))
FEET_M = (-4.0, -0.001, 0.0, 1.0, 3.0)


def about(height_m, foot_m, near_m, far_m):
    activate()
    ray = mi.Ray3f(mi.Point3f(0, 0, 0), mi.Vector3f(0, 0, 1))
    return EquiAngular.about(mi.Point3f(height_m, 0, foot_m), ray, mi.Float(far_m), near_m)


@pytest.mark.parametrize("height_m", HEIGHTS_M)
@pytest.mark.parametrize("foot_m", FEET_M)
@pytest.mark.parametrize(("near_m", "far_m"), INTERVALS_M)
def test_samples_and_density_are_those_of_the_closed_form(height_m, foot_m, near_m, far_m):
    """Also beside the ray, where all angles are nearly right."""
    h, foot, near = (np.float64(np.float32(each)) for each in (height_m, foot_m, near_m))
    low, high = np.arctan2(near - foot, h), np.arctan2(np.float32(far_m) - foot, h)
    angular = about(height_m, foot_m, near_m, far_m)
    u = np.float64(np.float32(U))
    wanted = foot + h * np.tan(low + u * (high - low))
    sampled = np.float64(angular.sample(mi.Float(U)))
    moved = np.abs(sampled - wanted)
    assert np.all(moved < 2e-6 * (np.abs(wanted - foot) + np.abs(foot)) + 1e-6 * h)
    density = h / ((high - low) * (h**2 + (wanted - foot) ** 2))
    ours = np.float64(angular.density(mi.Float(wanted)))
    some = np.abs(wanted - foot) > 0.01 * abs(foot)  # elsewhere distances have too few bits
    assert ours[some] == pytest.approx(density[some], rel=2e-5)


def test_samples_stay_between_the_ends():
    angular = about(0.01, 0.0, 0.3, 8.0)
    sampled = np.array(angular.sample(mi.Float(np.nextafter(np.float32(1), 0), 0.0, 0.5)))
    assert np.all((sampled >= 0.3 * (1 - 1e-6)) & (sampled <= 8 * (1 + 1e-6)))
    assert dr.all(angular.span > 0)

"""Depth completion: a map corrected by points whose depth is known better."""

from dataclasses import replace

import numpy as np
import pytest

from reconstruction.capture import Optics
from reconstruction.depth.completion import MapCompletion, Seen
from reconstruction.depth.method import DepthEstimate

SHAPE = 64, 64
TRUE_M, STATED_M = 5.0, 4.0
"""Depth of a wall, and that which a map states."""
LIT = np.ones(SHAPE)


@pytest.fixture(scope="module")
def complete():
    return MapCompletion(Optics(0.4, 0.4), SHAPE)


@pytest.fixture(scope="module")
def stated():
    return DepthEstimate(np.full(SHAPE, STATED_M), np.full(SHAPE, 0.2), np.full(SHAPE, 0.05))


def points(count):
    pixel = np.random.default_rng(1).uniform(0, 63, (count, 2))
    known, variance = np.full(count, np.log(TRUE_M)), np.full(count, 0.01**2)
    return Seen(np.arange(count), pixel, known, variance, np.zeros(count))


@pytest.mark.parametrize("count", [100, 300, 600])
def test_points_correct_a_map_that_is_wrong_everywhere(complete, stated, count):
    result = complete(LIT, stated, points(count))
    assert np.median(result.depth_m) == pytest.approx(TRUE_M, rel=0.04)
    assert np.median(result.sigma) < 0.8 * 0.2
    assert np.median(result.no_return) < 0.8 * 0.05


def test_a_map_without_points_is_what_it_was(complete, stated):
    assert complete(LIT, stated, points(0)) is stated


def test_a_map_that_states_no_probability_of_nothing_gets_none(complete, stated):
    result = complete(LIT, replace(stated, no_return=None), points(20))
    assert result.no_return is None

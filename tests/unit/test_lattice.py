"""Light between the nodes of a lattice."""

from types import SimpleNamespace

import numpy as np
import pytest

from spisim.simulation.light import Transport
from spisim.simulation.light.lattice import Lattice, simplices

LENGTHS_M = 0.02 * (np.arange(500) + 0.5)


def solution(path_m=4.0, strength=1.0):
    """A spot each that sees a surface, and fog next to the instrument."""
    surfaces = np.zeros((4, LENGTHS_M.size))
    position = path_m / 0.02 - 0.5
    before = int(position)
    surfaces[:, before] = strength * (1 - position + before)
    surfaces[:, before + 1] = strength * (position - before)
    fog = np.zeros_like(surfaces)
    fog[:, 10:20] = 0.3
    fields = dict.fromkeys(Transport.__dataclass_fields__, 0.0)
    fields |= {
        "image": np.full((2, 2), strength),
        "image_error": np.zeros((2, 2)),
        "spot_histogram": surfaces + fog,
        "path_length_m": LENGTHS_M,
        "extra": {"spot_orders": np.stack([surfaces, fog, 0 * fog])},
    }
    return Transport(**fields)


def test_shares_of_nodes_lead_back_to_the_place():
    positions = np.random.default_rng(0).uniform(-3, 3, (200, 6))
    nodes, fractions = simplices(positions)
    assert nodes.shape == (200, 7, 6)
    np.testing.assert_allclose(fractions.sum(axis=1), 1)
    assert (fractions >= 0).all()
    np.testing.assert_allclose(np.einsum("mk,mkd->md", fractions, nodes), positions, atol=1e-6)


def test_on_the_way_along_an_axis_there_are_two_nodes():
    asked = []

    def solve(node):
        asked.append(node)
        return solution()

    lattice = Lattice(solve, 10)
    lattice.light(np.array([[0.2, 3.0, -1.0], [0.9, 3.0 + 1e-9, -1.0]]))
    assert sorted(asked) == [(0, 3, -1), (1, 3, -1)]
    lattice.light(np.array([[0.5, 3.0, -1.0]]))
    assert lattice.solved == 2


def test_only_the_last_ones_are_kept():
    lattice = Lattice(lambda node: solution(), 2)
    for node in ((0,), (1,), (0,), (2,), (0,), (1,)):
        lattice.at(node)
    assert lattice.solved == 4  # 0, 1, 2, and 1 again


def test_the_echo_of_a_surface_lies_between_and_keeps_its_strength():
    """Two halves 10 cm of path apart would lose 3 % of their modulation at 240 MHz."""
    lattice = Lattice(lambda node: solution(4.0 - 0.1 * node[0], 1.0 + node[0]), 10)
    light = lattice.light(np.array([[0.25], [0.35]]))
    means = light.between(np.zeros((1, 2))).means(
        np.array([each.spot_histogram for each in light.transports])
    )[0, 0]
    assert means.sum() == pytest.approx(1.3 + 3.0)
    np.testing.assert_allclose(means[10:20], 0.3)
    echo = means.copy()
    echo[10:20] -= 0.3
    assert echo @ LENGTHS_M / echo.sum() == pytest.approx(3.97)
    wave = np.exp(2j * np.pi * 240e6 / 299792458 * LENGTHS_M)
    assert abs(echo @ wave) == pytest.approx(1.3, rel=3e-3)


def test_two_surfaces_are_both_seen():
    lattice = Lattice(lambda node: solution(4.0 + 2.0 * node[0]), 10)
    light = lattice.light(np.array([[0.25]]))
    first, second = (each.spot_histogram[0] for each in light.transports)
    assert first[199:201].sum() == pytest.approx(1.0)
    assert second[299:301].sum() == pytest.approx(1.0)


def test_light_that_comes_from_no_surface_stays():
    empty = SimpleNamespace(count=0)

    def solve(node):
        result = solution(strength=0.0)
        empty.count += 1
        return result

    light = Lattice(solve, 10).light(np.array([[0.5]]))
    assert empty.count == 2
    np.testing.assert_allclose(light.transports[0].spot_histogram[:, 10:20], 0.3)

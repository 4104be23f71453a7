"""Low-discrepancy points: evenly spread within a sequence, independent between them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from spisim.transport.backend import activate
from spisim.transport.engine.points import Points

# isort: split
import drjit as dr
import mitsuba as mi

COUNT, SEQUENCES = 16, 4096


@pytest.fixture(scope="module")
def drawn() -> NDArray[np.float64]:
    """Numbers (5, sequences, points): one alone, then two pairs."""
    return draw(seed=3)


def draw(seed: int) -> NDArray[np.float64]:
    activate()
    return np.stack([row.numpy().reshape(COUNT, SEQUENCES).T for row in _rows(seed)]).astype(float)


def _rows(seed: int) -> Iterator[mi.Float]:
    lane = dr.arange(mi.UInt32, COUNT * SEQUENCES)
    points = Points.of(lane // SEQUENCES, lane % SEQUENCES, mi.UInt32(seed))
    yield points.next_1d()
    for _ in range(2):
        pair = points.next_2d()
        yield from (pair.x, pair.y)


def test_every_elementary_interval_holds_one_point(drawn: NDArray[np.float64]) -> None:
    alone, x, y, *_ = drawn
    for columns in (1, 2, 4, 8, 16):
        cells = np.floor(x * columns) * (COUNT // columns) + np.floor(y * (COUNT // columns))
        np.testing.assert_array_equal(np.sort(cells), np.tile(np.arange(COUNT), (SEQUENCES, 1)))
    np.testing.assert_array_equal(
        np.sort(np.floor(alone * COUNT)), np.tile(np.arange(COUNT), (SEQUENCES, 1))
    )


def test_every_number_is_uniform_and_no_two_are_related(drawn: NDArray[np.float64]) -> None:
    waves = np.concatenate([f(2 * np.pi * k * drawn) for f in (np.sin, np.cos) for k in (1, 2)])
    products = np.einsum("isp,jsp->ijs", waves, waves) / COUNT - 0.5 * np.eye(len(waves))[..., None]
    spread = products.std(axis=2, ddof=1) / np.sqrt(SEQUENCES)
    z = products.mean(axis=2) / np.maximum(spread, 1e-7)
    assert np.abs(z).max() < 4.5
    single = waves[:, :, 0]  # one point of each sequence, as an estimate with one path takes it
    assert np.abs(single.mean(axis=1) / np.sqrt(0.5 / SEQUENCES)).max() < 4.5


def test_sequences_have_independent_errors(drawn: NDArray[np.float64]) -> None:
    means = np.exp(drawn).mean(axis=2) - (np.e - 1)
    neighbours = means[:, :-1] * means[:, 1:]
    z = neighbours.mean(axis=1) / neighbours.std(axis=1) * np.sqrt(SEQUENCES - 1)
    assert np.abs(z).max() < 4


def test_smooth_integrands_are_quiet(drawn: NDArray[np.float64]) -> None:
    random = np.exp(drawn[0]).std() / np.sqrt(COUNT)
    assert np.exp(drawn).mean(axis=2).std(axis=1).max() < 0.1 * random


def test_the_same_seed_gives_the_same_points(drawn: NDArray[np.float64]) -> None:
    np.testing.assert_array_equal(draw(seed=3), drawn)
    assert not np.isin(draw(seed=4)[0, 0], drawn[0, 0]).any()

"""Sums of light: exact, or an error."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import worlds
from reconstruction.base.errors import InputError
from spisim.scene import Material
from spisim.transport import TransportWarning
from spisim.transport.backend import activate
from spisim.transport.engine.sampling import PathBudget, repeat
from spisim.transport.engine.tally import (
    Contribution,
    HistogramTally,
    ImageTally,
    PathLengthBins,
    PhasorTally,
    Sums,
    Tallies,
)
from spisim.transport.world import build_world

# isort: split
import mitsuba as mi

SEED = np.random.SeedSequence(0)
BINS = PathLengthBins(4, 0.5)


def added(values: list[float], length_m: float = 0.0) -> Sums:
    """Contributions of these sizes to the second of two cells."""
    activate()
    tallies = Tallies(
        2,
        [
            ImageTally,
            partial(PhasorTally, frequencies_hz=[1e6]),
            partial(HistogramTally, bins=BINS),
        ],
    )
    value, length = mi.Float(np.array(values, dtype=np.float32)), mi.Float(length_m)
    tallies.add(
        Contribution(value, mi.UInt32(1), length, mi.UInt32(0), mi.Bool(True), mi.UInt32(0))
    )
    return tallies.read(area_m2=0.5)


def test_sums_are_exact_up_to_the_limit() -> None:
    result = added([2.0**14, 2.0**13, 2.0**-48])
    np.testing.assert_array_equal(next(result.values)["image"], [0, 2.0**13 + 2.0**12 + 2.0**-49])
    assert result.dropped == 0


@pytest.mark.parametrize(
    "values",
    [[2.0**15], [2.0**14, 2.0**14], [2.0**15, 2.0**15], [2.0**14] * 4, [1e30], [40.0] * 1000],
    ids=["one", "half way round", "once round", "in steps", "huge", "many"],
)
def test_a_sum_beyond_the_limit_is_an_error(values: list[float]) -> None:
    with pytest.raises(InputError, match=r"per m² of detector; less than 32768 can be summed"):
        added(values)


def test_what_is_not_finite_is_left_out_and_counted() -> None:
    result = added([1.0, np.nan, np.inf, -np.inf, 2.0])
    np.testing.assert_array_equal(next(result.values)["image"], [0, 1.5])
    assert result.dropped == 3


@pytest.mark.parametrize("length_m", [np.nan, np.inf])
def test_light_of_no_path_length_is_left_out_and_counted(length_m: float) -> None:
    result = added([1.0, 2.0], length_m)
    assert result.dropped == 2
    for values in next(result.values).values():
        np.testing.assert_array_equal(values, np.zeros_like(values))


def test_what_was_left_out_is_told_once() -> None:
    def launch(samples: int, seeds: object, replicas: int) -> Sums:
        return added([1.0, np.nan])

    with pytest.warns(
        TransportWarning, match="^8 contributions of light were not finite"
    ) as reported:
        result = repeat(launch, PathBudget(8), 2, SEED, None)
    assert len(reported) == 1
    assert result.dropped == 8
    np.testing.assert_array_equal(result.mean["image"], [0, 0.5])


def test_a_material_without_a_reflectance_is_told() -> None:
    sheet = worlds.plane(3.0)
    material = Material("m", np.nan, "test")
    position = worlds.scene(*worlds.room(), replace(sheet, material=material))
    with pytest.warns(TransportWarning, match="not finite"):
        worlds.image(build_world(position), worlds.projector(), worlds.detector(), 8, SEED)


def test_a_wall_right_before_the_instrument_is_refused() -> None:
    position = worlds.scene(worlds.plane(1e-3, 1.0, half_size_m=0.1))
    with pytest.raises(InputError, match="too close to source and detector"):
        worlds.image(
            build_world(position), worlds.projector(1.0, (2, 2)), worlds.detector(), 8, SEED
        )

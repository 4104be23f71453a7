"""Random values of configuration files."""

from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from spisim.base.config.distributions import Distribution, is_distribution, stream

ADAPTER: TypeAdapter[Any] = TypeAdapter(Distribution)


def draws(description: dict[str, Any], number: int = 4000) -> list[Any]:
    distribution, rng = ADAPTER.validate_python(description), stream(0, "test")
    return [distribution.draw(rng) for _ in range(number)]


def test_uniform_numbers_have_its_mean_and_spread() -> None:
    values = np.array(draws({"uniform": [2.0, 4.0]}))
    assert values.min() >= 2
    assert values.max() <= 4
    assert abs(values.mean() - 3) < 4 * (2 / np.sqrt(12)) / np.sqrt(len(values))


def test_integers_are_drawn_where_asked_for_both_bounds_included() -> None:
    integers = draws({"uniform": [1, 4], "integer": True})
    assert set(integers) == {1, 2, 3, 4}
    assert all(isinstance(each, int) for each in integers)
    assert len(set(draws({"uniform": [-3, 3]}))) > 3900
    np.testing.assert_array_equal(draws({"uniform": [-3, 3]}), draws({"uniform": [-3.0, 3.0]}))
    assert max(draws({"uniform": [1, 10**30]})) > 10**29


def test_logarithms_are_uniform() -> None:
    values = np.log(draws({"log_uniform": [1.0, 100.0]}))
    expected = np.log(100) / 2
    assert abs(values.mean() - expected) < 4 * (np.log(100) / np.sqrt(12)) / np.sqrt(len(values))


def test_normal_numbers_keep_within_their_bounds() -> None:
    values = np.array(draws({"normal": [0.0, 1.0]}))
    assert abs(values.mean()) < 4 / np.sqrt(len(values))
    assert abs(values.std() - 1) < 4 / np.sqrt(2 * len(values))
    cut = draws({"normal": [0.0, 1.0], "within": [0.0, 0.5]})
    assert min(cut) >= 0
    assert max(cut) <= 0.5


def test_choices_come_as_often_as_their_weights() -> None:
    values = draws({"choice": ["a", "b"], "weights": [3, 1]})
    assert abs(values.count("a") - 3000) < 4 * np.sqrt(4000 * 0.75 * 0.25)
    assert set(draws({"choice": [1, "x", {"deep": 2.0}.get("deep")]})) == {1, "x", 2.0}


def test_streams_depend_on_seed_and_keys_alone() -> None:
    assert stream(1, "a", 2).random() == stream(1, "a", 2).random()
    others = {stream(*key).random() for key in [(1, "a", 2), (2, "a", 2), (1, "b", 2), (1, "a", 3)]}
    assert len(others) == 4


@pytest.mark.parametrize(
    ("description", "reported"),
    [
        ({"uniform": [4, 2]}, "lower and a higher bound"),
        ({"uniform": [2, 2]}, "lower and a higher bound"),
        ({"log_uniform": [0, 2]}, "greater than 0"),
        ({"normal": [0, 0]}, "greater than 0"),
        ({"normal": [0, 1], "within": [10, 12]}, "three standard deviations"),
        ({"normal": [0, 1], "within": [0, 1e-6]}, "too narrow"),
        ({"choice": []}, "at least 1"),
        ({"choice": [1, 2], "weights": [1]}, "one for each choice"),
        ({"choice": [1, 2], "weights": [0, 0]}, "a finite sum above 0"),
        ({"choice": [1, 2], "weights": [1e308, 1e308]}, r"within ±1e\+30"),
        ({"uniform": [-1.7e308, 1.7e308]}, r"within ±1e\+30"),
        ({"uniform": [1, 2], "extra": 1}, "unknown field 'extra'"),
        ({"uniform": [1, 2], "integer": 1}, "valid boolean"),
        ({"uniform": [1.5, 4], "integer": True}, r"should be integers within ±2⁵³, not \[1.5, 4"),
        ({"uniform": [0, 10**17], "integer": True}, "should be integers within ±2⁵³"),
    ],
)
def test_what_cannot_be_drawn_from_is_refused(description: dict[str, Any], reported: str) -> None:
    with pytest.raises(ValidationError, match=reported):
        ADAPTER.validate_python(description)


def test_what_is_a_distribution() -> None:
    assert is_distribution({"choice": [1]})
    assert not is_distribution({"visibility_m": 50})
    assert not is_distribution([1, 2])

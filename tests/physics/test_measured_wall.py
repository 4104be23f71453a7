"""The preset `tmf8820` is like a real one before a wall, where nothing was fitted."""

from pathlib import Path

import measured_spad
import measured_wall
import pytest

from reconstruction.base.errors import InputError


@pytest.fixture(scope="module")
def figures() -> dict[str, float]:
    compared = measured_spad.compare_wall(measured_wall.SHIPPED, True)
    return {check.name: check.value for check in compared.checks}


@pytest.mark.parametrize(
    ("name", "limit"),
    [
        ("shape beyond 160 mm, rms over peak", 0.03),
        ("shape below 160 mm, rms over peak", 0.06),
        ("total counts, worst", 0.05),
        ("background before the pulse, rms", 0.1),
        ("background behind the pulse, rms", 0.1),
        ("delay against the arm, mm rms", 1.5),
        ("error of our ranges over that of the sensor's", 1.0),
    ],
)
def test_errors_are_within_what_is_promised(
    figures: dict[str, float], name: str, limit: float
) -> None:
    assert 0 < figures[name] < limit


def test_counts_scatter_as_measured(figures: dict[str, float]) -> None:
    assert figures["scatter of counts, simulated over measured"] == pytest.approx(1, abs=0.25)
    assert 1.8 < figures["scatter of counts over Poisson's"] < 3


def test_what_is_judged_was_not_fitted() -> None:
    wall = measured_wall.read_wall(measured_wall.SHIPPED)
    assert wall.fitted.sum() == 20
    assert (~wall.fitted).sum() == 9


def test_a_folder_without_the_wall_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"wall_distances\.json: no such file"):
        measured_wall.read_wall(tmp_path)

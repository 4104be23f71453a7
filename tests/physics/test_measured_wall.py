"""The preset `tmf8820` is like a real one before a wall, where nothing was fitted."""

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
import measured_spad
import measured_wall

from reconstruction.base.errors import InputError


@pytest.fixture(scope="module")
def figures() -> dict[str, float]:
    return {check.name: check.value for check in measured_spad.wall(measured_wall.SHIPPED)}


@pytest.mark.parametrize(
    ("name", "limit"),
    [
        ("wall, shape beyond 160 mm, rms over peak", 0.03),
        ("wall, shape below 160 mm, rms over peak", 0.06),
        ("wall, total counts, worst", 0.05),
        ("wall, background before the pulse, rms", 0.1),
        ("wall, background behind the pulse, rms", 0.1),
        ("wall, delay against the arm, mm rms", 1.5),
        ("wall, our range's error over the sensor's", 1.0),
    ],
)
def test_errors_are_within_what_is_promised(
    figures: dict[str, float], name: str, limit: float
) -> None:
    assert 0 < figures[name] < limit


def test_counts_scatter_as_measured(figures: dict[str, float]) -> None:
    assert figures["wall, scatter of counts, simulated over measured"] == pytest.approx(1, abs=0.25)
    assert 1.8 < figures["wall, scatter of counts over Poisson's"] < 3


def test_what_is_judged_was_not_fitted() -> None:
    wall = measured_wall.read_wall(measured_wall.SHIPPED)
    assert wall.fitted.sum() == 20
    assert (~wall.fitted).sum() == 9


def test_a_folder_without_the_wall_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"wall_distances\.json: no such file"):
        measured_wall.read_wall(tmp_path)

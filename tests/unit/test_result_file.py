"""Results that hold little: one image, one row of pixels."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from reconstruction import Capture, Reconstructor, read_result
from reconstruction.exports.results import _optics
from reconstruction.outputs import write_outputs


def test_a_result_of_one_image_alone_is_read_back(capture: Capture, tmp_path: Path) -> None:
    result = Reconstructor(capture.setup, image="zero-filled", ranging=(), depth=())(
        capture.frame()
    )
    write_outputs(result, capture, tmp_path / "out")
    outcome = read_result(tmp_path / "out" / "result.h5")
    assert list(outcome.images) == ["zero-filled"]
    np.testing.assert_array_equal(outcome.image, result.image)


@pytest.mark.parametrize(
    ("shape", "expected"), [((6, 8), (0.2, 0.1)), ((1, 8), (0.2, 0.2)), ((6, 1), (0.1, 0.1))]
)
def test_optics_of_a_result_are_those_of_its_rays(
    shape: tuple[int, int], expected: tuple[float, float]
) -> None:
    """Rays of lengths √(1 + x² + y²); one row or column of pixels states the other side, too."""
    down, across = (
        tangent * (2 * np.arange(count) + 1 - count) / count
        for tangent, count in zip((0.1, 0.2), shape, strict=True)
    )
    lengths = np.sqrt(1 + across**2 + down[:, None] ** 2)
    result = _optics(SimpleNamespace(range_over_depth=lengths))
    assert result is not None
    assert (result.tan_half_width, result.tan_half_height) == pytest.approx(expected)

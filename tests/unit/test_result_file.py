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


def test_optics_of_one_row_of_pixels_are_those_across() -> None:
    """Rays of lengths √(1 + x² + y²): along the row they tell the field, across they cannot."""
    tangents = 0.2 * (2 * np.arange(8) + 1 - 8) / 8
    lengths = np.sqrt(1 + tangents**2)[None]
    result = _optics(SimpleNamespace(range_over_depth=lengths))
    assert result is not None
    assert (result.tan_half_width, result.tan_half_height) == pytest.approx((0.2, 0.2))

"""The zero-filled inverse: exact with all coefficients, the least-energy image without."""

import numpy as np

from images import image_from
from reconstruction.operators import fwht, make_plan


def test_all_coefficients_give_the_image_back():
    image = np.random.default_rng(0).random((8, 16))
    index = make_plan((8, 16), polarity="signed").index
    coefficients = fwht(image.ravel())[index]
    assert np.allclose(image_from(coefficients, index, (8, 16), "zero-filled"), image)


def test_what_was_not_measured_is_zero():
    image = np.random.default_rng(1).random((8, 8))
    index = make_plan((8, 8), 10, polarity="signed").index
    coefficients = fwht(image.ravel())[index]
    spectrum = fwht(image_from(coefficients, index, (8, 8), "zero-filled").ravel())
    assert np.allclose(spectrum[index], coefficients)
    assert np.allclose(np.delete(spectrum, index), 0)

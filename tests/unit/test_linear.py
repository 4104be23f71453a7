"""The zero-filled inverse: exact with all coefficients, the least-energy image without."""

import numpy as np

from reconstruction.image import zero_filled
from reconstruction.operators import fwht, make_plan


def test_all_coefficients_give_the_image_back():
    image = np.random.default_rng(0).random((8, 16))
    index = make_plan((8, 16), polarity="signed").index
    assert np.allclose(zero_filled((8, 16), index, fwht(image.ravel())[index]), image)


def test_what_was_not_measured_is_zero():
    image = np.random.default_rng(1).random((8, 8))
    index = make_plan((8, 8), 10, polarity="signed").index
    spectrum = fwht(zero_filled((8, 8), index, fwht(image.ravel())[index]).ravel())
    assert np.allclose(spectrum[index], fwht(image.ravel())[index])
    assert np.allclose(np.delete(spectrum, index), 0)

"""Distributions of single numbers against scipy.special."""

import numpy as np
import pytest
from scipy.special import chdtri, ndtr

from reconstruction.ranging.fog.numerics import chi_squared_limit, normal_cdf


@pytest.mark.parametrize("sigmas", [-8.0, -3.0, -0.1, 0.0, 0.5, 4.0, np.inf])
def test_the_share_below(sigmas: float) -> None:
    np.testing.assert_allclose(normal_cdf(sigmas), ndtr(sigmas), rtol=1e-13)


@pytest.mark.parametrize("freedom", [1, 2, 3, 4, 7, 15, 200])
@pytest.mark.parametrize("fraction", [1e-9, 1e-3, 0.5, 0.999])
def test_the_limit_of_chi_squared(freedom: int, fraction: float) -> None:
    expected = chdtri(freedom, fraction)
    np.testing.assert_allclose(chi_squared_limit(freedom, fraction), expected, rtol=1e-9)

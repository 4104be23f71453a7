"""Distributions of single numbers against scipy.special."""

import numpy as np
import pytest
from scipy.special import chdtri, ndtr

from reconstruction.ranging.fog.chances import chi_squared_limit, normal_share


@pytest.mark.parametrize("deviations", [-8.0, -3.0, -0.1, 0.0, 0.5, 4.0, np.inf])
def test_the_share_below(deviations: float) -> None:
    np.testing.assert_allclose(normal_share(deviations), ndtr(deviations), rtol=1e-13)


@pytest.mark.parametrize("freedom", [1, 2, 3, 4, 7, 15, 200])
@pytest.mark.parametrize("share", [1e-9, 1e-3, 0.5, 0.999])
def test_the_limit_of_chi_squared(freedom: int, share: float) -> None:
    expected = chdtri(freedom, share)
    np.testing.assert_allclose(chi_squared_limit(freedom, share), expected, rtol=1e-9)

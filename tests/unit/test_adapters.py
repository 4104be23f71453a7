"""The operator as other libraries have theirs: the same products, and their solvers work."""

import numpy as np
import pytest

from images import natural_image
from reconstruction.operators import decoder_for, make_plan

IMAGE = natural_image(16, 0)
OPERATOR = decoder_for(make_plan((16, 16), 100, polarity="signed")).operator
VALUES = OPERATOR.forward(IMAGE)


def test_pylops_inverts_it():
    pylops = pytest.importorskip("pylops")
    from reconstruction.adapters.pylops import linear_operator

    operator = linear_operator(OPERATOR)
    pylops.utils.dottest(operator, 100, 256)
    np.testing.assert_allclose(operator @ IMAGE.ravel(), VALUES)
    found = pylops.optimization.leastsquares.regularized_inversion(
        operator, VALUES, [], iter_lim=50
    )[0]
    np.testing.assert_allclose(found.reshape(16, 16), OPERATOR.least_energy(VALUES), atol=1e-8)


def test_deepinv_inverts_it():
    pytest.importorskip("deepinv")
    import torch

    from reconstruction.adapters.deepinv import linear_physics

    physics = linear_physics(OPERATOR)
    image = torch.as_tensor(IMAGE)[None, None]
    coefficients = physics.A(image)
    np.testing.assert_allclose(coefficients[0].numpy() * OPERATOR.row_length, VALUES)
    assert float(physics.adjointness_test(image)) == pytest.approx(0, abs=1e-8)
    found = physics.A_dagger(coefficients)[0, 0].numpy()
    np.testing.assert_allclose(found, OPERATOR.least_energy(VALUES), atol=1e-3)
